"""The ellipsoid that always exists, and what is made of it."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.ellipsoid import fit_ellipsoid
from bench.calibration.ellipsoid_specific import ellipsoid_specific, witness
from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.taubin import normalised, taubin_batch
from bench.calibration.tilt import ned_from_body

STATION = np.array([211.0, 0.0, 453.0])
SHAPE = np.array([[1.10, 0.05, -0.03], [0.05, 0.92, 0.04], [-0.03, 0.04, 1.04]])
OFFSET = np.array([180.0, -250.0, 90.0])


def readings_mg(units: int, count: int, tilt: float, noise_mg: float, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angles = np.column_stack([rng.uniform(0, 360, count), *rng.uniform(-tilt, tilt, (2, count))])
    field = np.einsum("nji,j->ni", ned_from_body(*angles.T), STATION)
    return field @ SHAPE + OFFSET + rng.normal(0, noise_mg, (units, count, 3))


def test_given_no_noise_when_fitted_then_the_ellipsoid_is_exact() -> None:
    cloud = normalised(readings_mg(3, 40, 180.0, 0.0))
    found = ellipsoid_specific(cloud.points)
    assert found.found.all()
    inside = (cloud.points - found.centre[:, None]) @ found.matrix
    assert np.linalg.norm(inside, axis=-1) == pytest.approx(np.ones((3, 40)), abs=1e-9)


@pytest.mark.parametrize(("count", "tilt", "noise_mg"), [(12, 20.0, 5.0), (200, 10.0, 5.0)])
def test_it_is_an_ellipsoid_where_the_best_quadric_is_none(
    count: int, tilt: float, noise_mg: float
) -> None:
    points = normalised(readings_mg(300, count, tilt, noise_mg)).points
    lost = points[~taubin_batch(points).found]
    assert len(lost) > 20
    found = ellipsoid_specific(lost)
    assert found.found.all()
    axes = np.linalg.eigvalsh(found.matrix)
    assert (axes[:, 0] > 0.0).all()
    assert np.isfinite(found.centre).all()
    assert not found.told_apart.any()


def test_the_constraint_is_met_by_what_it_finds() -> None:
    """4 J - I2 > 0, written apart from the product's form of it."""
    points = normalised(readings_mg(50, 12, 20.0, 5.0)).points
    matrix = ellipsoid_specific(points).matrix
    a, b, c = np.linalg.eigvalsh(matrix @ matrix).T
    assert (4.0 * (a * b + b * c + c * a) - (a + b + c) ** 2 > 0.0).all()


def test_points_in_a_plane_give_no_value_that_is_not_finite() -> None:
    points = readings_mg(1, 30, 180.0, 0.0) * [1.0, 1.0, 0.0]
    found = ellipsoid_specific(points)
    assert np.isfinite(found.matrix).all()
    assert np.isfinite(found.centre).all()


@pytest.mark.parametrize("noise_known", [True, False])
def test_a_fit_that_needs_it_is_refused_and_says_what_it_led_to(noise_known: bool) -> None:
    refused = 0
    for readings in readings_mg(40, 36, 20.0, 5.0):
        data = CalibrationData(
            field_mg=readings,
            field_sd_mg=5.0,
            station_field_mg=STATION,
            noise_known=noise_known,
        )
        fit = fit_ellipsoid(data)
        if fit.cause != Cause.DEGENERATE:
            continue
        refused += 1
        assert fit.extra["degenerate"] == 1.0
        assert fit.extra["specific_field_mg"] == pytest.approx(np.linalg.norm(STATION))
        assert np.isfinite(list(fit.extra.values())).all()
        assert fit.matrix is None
        predicted = fit.extra.get("specific_predicted_heading_rms_deg", np.inf)
        assert predicted > 3.0
    assert refused > 0


def test_its_witness_is_the_ellipsoid_where_there_is_one() -> None:
    found = witness(readings_mg(1, 60, 180.0, 0.5)[0], 0.5, None)
    offset_mg = [found[f"specific_offset_{axis}_mg"] for axis in "xyz"]
    assert offset_mg == pytest.approx(OFFSET, abs=1.0)
    strength_mg = np.linalg.norm(STATION) * np.cbrt(np.linalg.det(SHAPE))
    assert found["specific_field_mg"] == pytest.approx(strength_mg, rel=0.002)
    assert found["specific_residual_rms_mg"] == pytest.approx(0.5, rel=0.3)
    assert found["specific_predicted_heading_rms_deg"] < 0.1
