from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.bound import (
    Conditions,
    Estimator,
    grid_rows,
    heading_bound,
    information_bound,
    pose_information,
)
from bench.calibration.ellipsoid_batch import ellipsoid_batch
from bench.calibration.grid_error import grid_axes, grid_field, grid_force
from bench.calibration.prediction import heading_grid
from bench.calibration.tilt import ned_from_body
from bench.calibration.truth_aided_batch import truth_aided_batch

if TYPE_CHECKING:
    from numpy.typing import NDArray

FIELD = 500.0 * np.array([np.cos(np.deg2rad(65.0)), 0.0, np.sin(np.deg2rad(65.0))])
GAIN = np.eye(3) + np.array([[0.1, 0.04, -0.06], [-0.02, -0.08, 0.05], [0.07, -0.03, 0.02]])
SYMMETRIC = np.array([[1.10, 0.05, -0.03], [0.05, 0.92, 0.04], [-0.03, 0.04, 1.04]])
"""The unit of the table that the bound is held against."""
Poses = list[tuple[float, float, float]]


def ring(pitch: float, roll: float, count: int) -> Poses:
    return [(360.0 * index / count, pitch, roll) for index in range(count)]


LEVEL = ring(0, 0, 36)
NO_ROLL = ring(0, 0, 8) + ring(30, 0, 8) + ring(-30, 0, 8)
RINGS = ring(0, 0, 12) + ring(30, 0, 6) + ring(-30, 0, 6) + ring(0, 30, 6) + ring(0, -30, 6)


def conditions(gain: NDArray[np.float64] = SYMMETRIC, **options: float) -> Conditions:
    return Conditions(
        station_field_mg=FIELD,
        field_sd_mg=options.get("field_sd_mg", 0.5),
        accel_sd_g=float(np.deg2rad(0.1)),
        gain=gain,
    )


def known_field() -> Conditions:
    return Conditions(
        station_field_mg=FIELD,
        field_sd_mg=0.5,
        accel_sd_g=None,
        rig_sd_deg=0.03,
        direction_known=True,
        gain=SYMMETRIC,
    )


@pytest.mark.parametrize(
    ("estimator", "poses", "rms_deg"),
    [
        ("ellipsoid", NO_ROLL, 0.938),
        ("ellipsoid", RINGS, 0.449),
        ("tilt_aided", NO_ROLL, 0.170),
        ("tilt_aided", RINGS, 0.122),
        ("truth_aided", NO_ROLL, 0.066),
        ("truth_aided", RINGS, 0.052),
    ],
)
def test_ring_poses_give_the_bounds_of_an_independent_calculation(
    estimator: Estimator, poses: Poses, rms_deg: float
) -> None:
    """Field 50 uT, dip 65 deg, 0.05 uT a pose, accelerometer 0.1 deg, rig 0.03 deg."""
    held = known_field() if estimator == "truth_aided" else conditions()
    bound = heading_bound(estimator, poses, held)
    assert bound.rank == bound.unknowns
    assert float(bound.rms_deg) == pytest.approx(rms_deg, rel=0.05)
    assert bound.worst_deg > bound.rms_deg


@pytest.mark.parametrize(
    ("estimator", "rank", "unknowns"),
    [("ellipsoid", 5, 9), ("tilt_aided", 8, 13), ("truth_aided", 9, 12)],
)
def test_level_poses_leave_parameters_open_and_no_bound(
    estimator: Estimator, rank: int, unknowns: int
) -> None:
    held = known_field() if estimator == "truth_aided" else conditions()
    bound = heading_bound(estimator, LEVEL, held)
    assert (int(bound.rank), bound.unknowns) == (rank, unknowns)
    assert np.isinf(bound.rms_deg)
    assert np.isinf(bound.worst_deg)


@pytest.mark.parametrize("estimator", ["ellipsoid", "tilt_aided", "truth_aided"])
def test_sets_of_poses_are_bounded_together_and_information_adds_up(
    estimator: Estimator,
) -> None:
    sets = np.array([RINGS, ring(10, 20, 18) + ring(-40, 5, 18)])
    held = conditions(GAIN)
    together = heading_bound(estimator, sets, held)
    assert together.rms_deg.shape == (2,)
    for index in range(2):
        alone = heading_bound(estimator, sets[index], held)
        assert together.rms_deg[index] == pytest.approx(float(alone.rms_deg), rel=1e-9)
    told = pose_information(estimator, sets[0], held)
    twice = information_bound(estimator, 2.0 * told.sum(axis=0), held)
    assert twice.rms_deg == pytest.approx(together.rms_deg[0] / np.sqrt(2.0))


def test_more_noise_raises_the_bound_in_proportion_where_nothing_else_is_noisy() -> None:
    one = heading_bound("ellipsoid", RINGS, conditions(field_sd_mg=0.5))
    ten = heading_bound("ellipsoid", RINGS, conditions(field_sd_mg=5.0))
    assert ten.rms_deg == pytest.approx(10.0 * float(one.rms_deg))


def test_the_bound_is_the_spread_of_an_estimator_that_attains_it() -> None:
    rng = np.random.default_rng(1)
    clean = np.einsum("nji,j->ni", ned_from_body(*np.array(RINGS).T), FIELD) @ SYMMETRIC.T
    readings = clean + rng.normal(0.0, 0.1, (2000, 36, 3))
    fits = ellipsoid_batch(readings, 0.1, station_field_mg=FIELD)
    bound = heading_bound("ellipsoid", RINGS, conditions(field_sd_mg=0.1))
    spread = np.cov(fits.offset_mg.T)
    assert np.sqrt(np.diag(spread)) == pytest.approx(
        np.sqrt(np.diag(bound.covariance)[6:]), rel=0.06
    )


def test_a_rotation_of_the_sensor_does_not_change_the_bound_without_rotation() -> None:
    turned = ned_from_body(20.0, -10.0, 15.0) @ SYMMETRIC
    bound = heading_bound("ellipsoid", RINGS, conditions(turned))
    plain = heading_bound("ellipsoid", RINGS, conditions())
    assert bound.rms_deg == pytest.approx(float(plain.rms_deg), rel=1e-9)


def test_bound_of_truth_aided_is_the_prediction_of_its_fit() -> None:
    held = conditions(GAIN)
    axes = ned_from_body(*np.array(RINGS).T)
    fits = truth_aided_batch(
        RINGS,
        np.einsum("nji,j->ni", axes, FIELD) @ GAIN.T,
        -axes[:, 2],
        field_sd_mg=held.field_sd_mg,
        accel_sd_g=float(np.deg2rad(0.1)),
        rig_sd_deg=held.rig_sd_deg,
        station_field_mg=FIELD,
    )
    bound = heading_bound("truth_aided", RINGS, held)
    assert float(fits.predicted_rms_deg) == pytest.approx(float(bound.rms_deg), rel=1e-6)


def test_derivatives_of_the_heading_are_those_of_finite_differences() -> None:
    grid = heading_grid(FIELD)
    sine = np.asarray(FIELD[2] / 500.0)
    field, by_field = grid_field(grid_axes(), np.asarray(500.0), sine)
    force, by_force = grid_force(grid_axes(), sine)
    assert field == pytest.approx(grid.field_mg)
    assert force == pytest.approx(grid.force_g)
    assert by_field == pytest.approx(grid.field_gradient_deg, abs=1e-6)
    assert by_force == pytest.approx(grid.force_gradient_deg, abs=1e-5)


def test_tilt_aided_without_accelerometer_noise_is_an_error() -> None:
    with pytest.raises(ValueError, match="must have the accelerometer's noise"):
        heading_bound("tilt_aided", RINGS, known_field())


def test_rows_have_one_column_a_parameter() -> None:
    assert grid_rows("ellipsoid", conditions()).shape == (120, 9)
    assert grid_rows("tilt_aided", conditions()).shape == (120, 13)
    assert grid_rows("truth_aided", conditions()).shape == (120, 28)
    assert grid_rows("truth_aided", known_field()).shape == (120, 12)
