from __future__ import annotations

import inspect
from dataclasses import replace

import numpy as np
import pytest

from bench.acceptance.site import calibration_data
from bench.calibration.bound import heading_bound
from bench.calibration.pose_plan import (
    bench_conditions,
    candidate_attitudes_deg,
    optimal_poses,
    poses_for,
)

CONDITIONS = bench_conditions()
PNI_LIKE = [(0, 0, 4), (10, 0, 2), (-10, 0, 2), (0, 10, 2), (0, -10, 2)]
RINGS = {
    8: [(0, 0, 4), (30, 0, 1), (-30, 0, 1), (0, 30, 1), (0, -30, 1)],
    12: [(0, 0, 4), (30, 0, 2), (-30, 0, 2), (0, 30, 2), (0, -30, 2)],
}


def ring_rms_deg(rings: list[tuple[int, int, int]], shift_deg: float = 90.0) -> float:
    poses = [
        (360.0 * index / count + shift_deg * number, pitch, roll)
        for number, (pitch, roll, count) in enumerate(rings)
        for index in range(count)
    ]
    return float(heading_bound("truth_aided", poses, CONDITIONS).rms_deg)


@pytest.fixture(scope="module")
def nine():
    return optimal_poses(9, 30.0, CONDITIONS)


@pytest.mark.parametrize("count", RINGS)
def test_optimal_poses_leave_less_error_than_rings_of_the_same_count(count):
    plan = optimal_poses(count, 30.0, CONDITIONS)

    assert len(plan.attitudes_deg) == count
    assert plan.predicted_rms_deg < 0.95 * ring_rms_deg(RINGS[count])


def test_nine_optimal_poses_leave_half_the_error_of_twelve_at_ten_degrees(nine):
    assert nine.predicted_rms_deg < 0.5 * ring_rms_deg(PNI_LIKE)


def test_the_prediction_is_the_bound_of_the_chosen_poses(nine):
    bound = heading_bound("truth_aided", nine.attitudes_deg, CONDITIONS)

    assert nine.predicted_rms_deg == pytest.approx(float(bound.rms_deg), rel=1e-6)
    assert nine.predicted_max_deg == pytest.approx(2.0 * float(bound.worst_deg), rel=1e-6)
    assert nine.dof == 6 * 9 - bound.unknowns == 26


def test_no_exchange_of_a_single_pose_helps(nine):
    rng = np.random.default_rng(3)
    candidates_deg = candidate_attitudes_deg(30.0)
    sets = np.tile(nine.attitudes_deg, (200, 1, 1))
    places = rng.integers(0, 9, 200)
    sets[np.arange(200), places] = candidates_deg[rng.integers(0, len(candidates_deg), 200)]

    bounds = heading_bound("truth_aided", sets, CONDITIONS)

    assert bounds.rms_deg.min() >= nine.predicted_rms_deg * (1.0 - 1e-5)


def test_the_poses_are_different_and_the_same_every_time(nine):
    again = optimal_poses(9, 30.0, CONDITIONS)

    assert again.attitudes_deg.tolist() == nine.attitudes_deg.tolist()
    assert len({tuple(pose) for pose in nine.attitudes_deg.tolist()}) == 9


@pytest.mark.parametrize("limit_deg", [20.0, 30.0, 45.0])
def test_no_pose_is_tilted_past_the_limit_nor_of_the_verification_grid(limit_deg):
    candidates_deg = candidate_attitudes_deg(limit_deg)
    upright = np.cos(np.deg2rad(candidates_deg[:, 1:])).prod(axis=1)

    assert np.rad2deg(np.arccos(upright)).max() <= limit_deg + 1e-6
    assert set(np.mod(candidates_deg[:, 0], 15.0)) == {7.5}


def test_more_tilt_leaves_less_error_and_a_steeper_field_more(nine):
    north_mg, _, _ = CONDITIONS.station_field_mg
    steep = replace(CONDITIONS, station_field_mg=np.array([0.5 * north_mg, 0.0, 470.0]))

    assert optimal_poses(9, 15.0, CONDITIONS).predicted_rms_deg > 1.3 * nine.predicted_rms_deg
    assert optimal_poses(9, 30.0, steep).predicted_rms_deg > 1.3 * nine.predicted_rms_deg


def test_the_fewest_poses_for_a_wanted_accuracy_are_found(nine):
    plan = poses_for(nine.predicted_max_deg + 0.001, 30.0, CONDITIONS)

    assert plan.attitudes_deg.tolist() == nine.attitudes_deg.tolist()
    assert optimal_poses(8, 30.0, CONDITIONS).predicted_max_deg > nine.predicted_max_deg + 0.001


def test_the_conditions_are_the_weights_of_the_runs_fit():
    weights = {
        name: parameter.default
        for name, parameter in inspect.signature(calibration_data).parameters.items()
    }

    for name in ("field_sd_mg", "accel_sd_g", "rig_sd_deg"):
        assert getattr(CONDITIONS, name) == weights[name]


@pytest.mark.parametrize(
    ("count", "tilt_deg", "conditions", "sentence"),
    [
        (7, 30.0, CONDITIONS, "count must be 8 to 36 poses; instead received 7"),
        (9, 5.0, CONDITIONS, "tilt_limit_deg must be within 15 and 60 deg; instead received 5"),
        (9, 30.0, replace(CONDITIONS, accel_sd_g=None), "must have the accelerometer's noise"),
    ],
)
def test_what_cannot_be_planned_is_refused(count, tilt_deg, conditions, sentence):
    with pytest.raises(ValueError, match=sentence):
        optimal_poses(count, tilt_deg, conditions)


def test_an_accuracy_out_of_reach_is_refused_with_what_can_be_reached():
    with pytest.raises(ValueError, match=r"at least the 0\.\d+ deg that 36 poses reach"):
        poses_for(0.01, 20.0, CONDITIONS)
