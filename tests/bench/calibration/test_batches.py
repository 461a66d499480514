"""Kernels over many units give each unit what its single fit gives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.bound import Conditions, heading_bound
from bench.calibration.ellipsoid import fit_ellipsoid
from bench.calibration.ellipsoid_batch import CAUSES, ellipsoid_batch
from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.taubin import normalised, taubin_batch
from bench.calibration.tilt import ned_from_body
from bench.calibration.truth_aided import fit_truth_aided
from bench.calibration.truth_aided_batch import CAUSES as TRUTH_CAUSES
from bench.calibration.truth_aided_batch import truth_aided_batch
from bench.calibration.truth_aided_linear import CAUSES as LINEAR_CAUSES
from bench.calibration.truth_aided_linear import truth_aided_linear

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

STATION = np.array([211.0, 0.0, 453.0])
SHAPE = np.array([[1.10, 0.05, -0.03], [0.05, 0.92, 0.04], [-0.03, 0.04, 1.04]])


def readings_mg(
    units: int, count: int, tilt: float, noise_mg: float, seed: int = 1
) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    angles = np.column_stack([rng.uniform(0, 360, count), *rng.uniform(-tilt, tilt, (2, count))])
    field = np.einsum("nji,j->ni", ned_from_body(*angles.T), STATION)
    return field @ SHAPE + [180.0, -250.0, 90.0] + rng.normal(0, noise_mg, (units, count, 3))


@pytest.mark.parametrize(
    ("count", "tilt", "noise_mg"), [(36, 45.0, 0.5), (12, 60.0, 0.5), (200, 20.0, 0.3)]
)
def test_ellipsoids_of_many_units_are_those_of_single_fits(
    count: int, tilt: float, noise_mg: float
) -> None:
    field_mg = readings_mg(8, count, tilt, noise_mg)
    fits = ellipsoid_batch(field_mg, noise_mg, station_field_mg=STATION)
    for unit, readings in enumerate(field_mg):
        fit = fit_ellipsoid(
            CalibrationData(field_mg=readings, field_sd_mg=noise_mg, station_field_mg=STATION)
        )
        assert fit.cause is None
        assert CAUSES[fits.cause[unit]] is None
        assert fits.matrix[unit] == pytest.approx(fit.matrix, abs=3e-6)
        assert fits.offset_mg[unit] == pytest.approx(fit.offset_mg, abs=2e-3)
        assert np.diag(fits.covariance[unit]) == pytest.approx(np.diag(fit.covariance), rel=1e-4)
        assert fits.predicted_max_deg[unit] == pytest.approx(
            fit.predicted_heading_max_deg, rel=1e-4
        )
        assert fits.chi2_reduced[unit] == pytest.approx(fit.chi2_reduced, rel=1e-4)


def test_each_unit_of_a_batch_has_its_own_cause() -> None:
    good = readings_mg(1, 60, 60.0, 0.3)[0]
    still = np.tile([100.0, 20.0, 400.0], (60, 1))
    flat = good * [1.0, 1.0, 0.0]
    held = np.minimum(good, np.quantile(good, 0.8, axis=0))
    moving = good + 300.0 * np.sin(np.linspace(0, 20, 60))[:, None] * [1.0, -1.0, 0.5]
    fits = ellipsoid_batch(np.stack([good, still, flat, held, moving]), 0.3)
    assert [CAUSES[code] for code in fits.cause[:4]] == [
        None,
        Cause.NO_TURN,
        Cause.TILT_TOO_SMALL,
        Cause.SATURATED,
    ]
    assert fits.cause[4] != 0
    assert (fits.matrix[1:] == np.eye(3)).all()
    assert all(np.isfinite(getattr(fits, name)).all() for name in fits.__slots__)


def test_too_few_readings_are_refused_for_all_units() -> None:
    fits = ellipsoid_batch(readings_mg(3, 8, 60.0, 0.1), 0.1)
    assert {CAUSES[code] for code in fits.cause} == {Cause.TOO_FEW}


def test_weak_readings_are_not_accepted_for_an_optimistic_prediction() -> None:
    """Twelve poses to 20 deg leave 4 deg; a lucky draw must not pass for 2."""
    fits = ellipsoid_batch(readings_mg(2000, 12, 20.0, 0.5), 0.5, station_field_mg=STATION)
    assert (fits.cause != 0).mean() > 0.999


def test_taubin_of_clean_points_is_the_ellipsoid() -> None:
    points = normalised(readings_mg(2, 30, 180.0, 0.0))
    starts = taubin_batch(points.points)
    assert starts.found.all()
    assert starts.told_apart.all()
    inside = (points.points - starts.centre[:, None]) @ starts.matrix
    assert np.linalg.norm(inside, axis=-1) == pytest.approx(np.ones((2, 30)), abs=1e-9)


@pytest.mark.parametrize("with_accelerometer", [True, False])
def test_truth_aided_fits_of_many_units_are_those_of_single_fits(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64], with_accelerometer: bool
) -> None:
    truths = [drawn(seed, azimuth_deg=0.5, north_deg=0.1, east_deg=-0.2) for seed in range(4)]
    accel_g = np.stack([truth.data.accel_g for truth in truths])
    data = truths[0].data
    fits = truth_aided_batch(
        eol_deg,
        np.stack([truth.data.field_mg for truth in truths]),
        accel_g if with_accelerometer else None,
        field_sd_mg=data.field_sd_mg,
        accel_sd_g=data.accel_sd_g,
        rig_sd_deg=data.rig_sd_deg,
        station_field_mg=data.station_field_mg,
    )
    for unit, truth in enumerate(truths):
        alone = (
            truth.data
            if with_accelerometer
            else CalibrationData(
                field_mg=truth.data.field_mg,
                azimuth_deg=eol_deg[:, 0],
                pitch_deg=eol_deg[:, 1],
                roll_deg=eol_deg[:, 2],
                field_sd_mg=data.field_sd_mg,
                rig_sd_deg=data.rig_sd_deg,
                station_field_mg=data.station_field_mg,
            )
        )
        fit = fit_truth_aided(alone)
        assert fits.gain[unit] @ fit.matrix == pytest.approx(np.eye(3), abs=1e-6)
        assert fits.offset_mg[unit] == pytest.approx(fit.offset_mg, abs=1e-3)
        assert fits.field_azimuth_deg[unit] == pytest.approx(
            fit.extra["field_azimuth_deg"], abs=1e-6
        )
        assert np.diag(fits.covariance[unit]) == pytest.approx(np.diag(fit.covariance), rel=1e-5)
        assert fits.predicted_rms_deg[unit] == pytest.approx(
            fit.predicted_heading_rms_deg, rel=1e-5
        )


def test_truth_aided_units_are_refused_one_by_one(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    truth = drawn(1)
    stuck = truth.data.field_mg.copy()
    stuck[:, 1] = stuck[:, 0]
    wrong = truth.data.field_mg[::-1]
    fits = truth_aided_batch(
        eol_deg,
        np.stack([truth.data.field_mg, stuck, wrong]),
        np.stack([truth.data.accel_g] * 3),
        field_sd_mg=0.35,
        accel_sd_g=0.0005,
        rig_sd_deg=0.02,
        station_field_mg=truth.data.station_field_mg,
    )
    assert TRUTH_CAUSES[fits.cause[0]] is None
    assert TRUTH_CAUSES[fits.cause[1]] == Cause.DEGENERATE
    assert fits.cause[2] != 0
    assert all(np.isfinite(getattr(fits, name)).all() for name in fits.__slots__)


def test_level_poses_determine_no_unit(drawn: Callable[..., Any]) -> None:
    level = np.column_stack([np.arange(0.0, 360.0, 15.0), np.zeros((24, 2))])
    data = drawn(1, level).data
    fits = truth_aided_batch(
        level,
        data.field_mg,
        data.accel_g,
        field_sd_mg=0.35,
        accel_sd_g=0.0005,
        rig_sd_deg=0.02,
        station_field_mg=data.station_field_mg,
    )
    assert TRUTH_CAUSES[int(fits.cause)] == Cause.NOT_OBSERVABLE


def test_one_matrix_product_fits_all_units_in_a_known_field_as_well_as_the_bound(
    eol_deg: NDArray[np.float64],
) -> None:
    rng = np.random.default_rng(4)
    gain = np.eye(3) + 0.1 * rng.normal(size=(3, 3))
    actual_deg = eol_deg + rng.normal(0.0, 0.05, (3000, *eol_deg.shape))
    axes = ned_from_body(*np.moveaxis(actual_deg, -1, 0))
    field_mg = np.einsum("bnji,j->bni", axes, STATION) @ gain.T + [180.0, -250.0, 90.0]
    field_mg += rng.normal(0.0, 0.5, field_mg.shape)
    noise = {"field_sd_mg": 0.5, "rig_sd_deg": 0.05}
    fits = truth_aided_linear(eol_deg, field_mg, station_field_mg=STATION, **noise)
    assert (fits.cause == 0).all()
    conditions = Conditions(
        station_field_mg=STATION, accel_sd_g=None, direction_known=True, gain=gain, **noise
    )
    bound = heading_bound("truth_aided", eol_deg, conditions).covariance
    error = np.concatenate(
        [(np.linalg.inv(fits.matrix) - gain).reshape(-1, 9), fits.offset_mg - [180, -250, 90]],
        axis=1,
    )
    distance = np.einsum("bi,ij,bj->b", error, np.linalg.inv(bound), error) / 12.0
    assert distance.mean() == pytest.approx(1.0, abs=0.04)


def test_units_of_one_matrix_product_are_refused_one_by_one(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    truth = drawn(1)
    flat = truth.data.field_mg.copy()
    flat[:, 1] = flat[:, 0]
    station_mg = truth.data.station_field_mg
    given = {"field_sd_mg": 0.35, "rig_sd_deg": 0.02, "station_field_mg": station_mg}
    both = np.stack([truth.data.field_mg, flat, truth.data.field_mg[::-1]])
    fits = truth_aided_linear(eol_deg, both, **given)
    found = [LINEAR_CAUSES[code] for code in fits.cause]
    assert found == [None, Cause.DEGENERATE, Cause.RESIDUAL_TOO_LARGE]
    assert (fits.matrix[1:] == np.eye(3)).all()
    level = eol_deg[:, 1:].any(axis=1) == np.False_
    fits = truth_aided_linear(eol_deg[level], both[:, level], **given)
    assert {LINEAR_CAUSES[code] for code in fits.cause} == {Cause.NOT_OBSERVABLE}
