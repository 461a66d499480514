"""Coefficients of the ellipsoid alone: the minimum's numbers and refusals, in less time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.ellipsoid_batch import (
    CAUSES,
    ellipsoid_batch,
    ellipsoid_coefficients,
)
from bench.calibration.fit import Cause
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from numpy.typing import NDArray

STATION = np.array([211.0, 0.0, 453.0])
SHAPE = np.array([[1.10, 0.05, -0.03], [0.05, 0.92, 0.04], [-0.03, 0.04, 1.04]])
OFFSET_MG = np.array([180.0, -250.0, 90.0])


def readings_mg(
    units: int, count: int, tilt_deg: float, noise_mg: float, seed: int = 1
) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    tilts_deg = rng.uniform(-tilt_deg, tilt_deg, (2, count))
    axes = ned_from_body(rng.uniform(0.0, 360.0, count), *tilts_deg)
    field_mg = np.einsum("nji,j->ni", axes, STATION) @ SHAPE + OFFSET_MG
    return field_mg + rng.normal(0.0, noise_mg, (units, count, 3))


@pytest.mark.parametrize(
    ("count", "tilt_deg", "noise_mg"),
    [(36, 180.0, 0.5), (36, 45.0, 0.5), (12, 180.0, 5.0), (12, 45.0, 0.5), (36, 20.0, 0.3)],
)
def test_coefficients_alone_are_those_of_the_minimum_and_refused_as_it_is(
    count: int, tilt_deg: float, noise_mg: float
) -> None:
    field_mg = readings_mg(300, count, tilt_deg, noise_mg)
    fits = ellipsoid_batch(field_mg, noise_mg, station_field_mg=STATION)
    found = ellipsoid_coefficients(field_mg, noise_mg, station_field_mg=STATION)

    assert (found.cause == fits.cause).all()
    assert found.field_mg == pytest.approx(fits.field_mg)
    good = fits.cause == 0
    rows, columns = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    off = np.concatenate(
        [
            (found.matrix - fits.matrix)[good][:, rows, columns],
            (found.offset_mg - fits.offset_mg)[good],
        ],
        axis=1,
    )
    sd = np.sqrt(np.diagonal(fits.covariance[good], axis1=1, axis2=2))
    assert (np.abs(off) <= 0.05 * sd).all()


def test_without_a_station_the_matrix_has_determinant_one() -> None:
    found = ellipsoid_coefficients(readings_mg(5, 36, 60.0, 0.3), 0.3)

    assert np.linalg.det(found.matrix) == pytest.approx(np.ones(5), abs=1e-6)


def test_one_unit_is_fitted_as_among_many_of_another_block() -> None:
    field_mg = readings_mg(600, 36, 60.0, 0.3)
    many = ellipsoid_coefficients(field_mg.reshape(2, 300, 36, 3), 0.3, station_field_mg=STATION)
    one = ellipsoid_coefficients(field_mg[-1], 0.3, station_field_mg=STATION)

    assert many.matrix.shape == (2, 300, 3, 3)
    assert one.cause.shape == ()
    assert many.offset_mg[1, -1] == pytest.approx(one.offset_mg, abs=1e-9)
    assert many.matrix[1, -1] == pytest.approx(one.matrix, abs=1e-12)


def test_each_bad_unit_has_its_own_cause_and_leaves_the_others_alone() -> None:
    good = readings_mg(1, 60, 60.0, 0.3)[0]
    still = np.tile([100.0, 20.0, 400.0], (60, 1))
    flat = good * [1.0, 1.0, 0.0]
    beyond = 1e9 * good
    held = np.minimum(good, np.quantile(good, 0.8, axis=0))
    moving = good + 300.0 * np.sin(np.linspace(0, 20, 60))[:, None] * [1.0, -1.0, 0.5]
    one_pose_off = good.copy()
    one_pose_off[7] += 30.0
    every = np.stack([good, still, flat, beyond, held, moving, one_pose_off, good])

    found = ellipsoid_coefficients(every, 0.3)

    causes = [CAUSES[code] for code in found.cause]
    assert causes[:5] == [None, Cause.NO_TURN, Cause.TILT_TOO_SMALL, Cause.NO_TURN, Cause.SATURATED]
    assert causes[5] is not None
    assert causes[6:] == [Cause.RESIDUAL_TOO_LARGE, None]
    refused = found.cause != 0
    assert (found.matrix[refused] == np.eye(3)).all()
    assert (found.offset_mg[refused] == 0.0).all()
    assert found.offset_mg[0] == pytest.approx(OFFSET_MG, abs=1.0)
    assert (found.offset_mg[7] == found.offset_mg[0]).all()


def test_too_few_readings_are_refused() -> None:
    found = ellipsoid_coefficients(readings_mg(3, 8, 60.0, 0.1), 0.1)

    assert {CAUSES[code] for code in found.cause} == {Cause.TOO_FEW}


def test_values_that_are_not_finite_are_an_error() -> None:
    field_mg = readings_mg(2, 36, 60.0, 0.3)
    field_mg[1, 3, 0] = np.nan

    with pytest.raises(ValueError, match="must be finite"):
        ellipsoid_coefficients(field_mg, 0.3)
