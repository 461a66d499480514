from __future__ import annotations

import numpy as np
import pytest

from bench.adaptive_tour import (
    LEAST_SHARE,
    adaptive_tour,
    expected_count,
    foreseen_poses,
    wound,
)
from bench.calibration.bound import heading_bound
from bench.calibration.pose_plan import bench_conditions, optimal_poses
from bench.calibration.prediction import grid_attitudes_deg
from bench.planned_tour import HOME, planned_poses
from bench.pose import Attitude
from bench.travel import RIG_PROFILE, travel_time_s

MOST = 20
CONDITIONS = bench_conditions()


@pytest.fixture(scope="module")
def tour():
    return adaptive_tour(8, 30.0, 250.0, 60.0)


@pytest.fixture(scope="module")
def poses(tour):
    return foreseen_poses(tour, MOST)


def mean_square(poses):
    angles_deg = [(one.azimuth_deg, one.pitch_deg, one.roll_deg) for one in poses]
    return float(heading_bound("truth_aided", angles_deg, CONDITIONS).rms_deg) ** 2


def test_the_first_poses_are_the_optimal_ones_on_the_shortest_tour(poses):
    assert list(poses[:8]) == planned_poses(optimal_poses(8, 30.0, CONDITIONS))


def test_every_pose_helps_nearly_as_much_as_the_best_one_and_no_nearer_one_does(tour, poses):
    present = HOME
    for pose in poses[:10]:
        present = wound(present, pose)
    visited, chosen = list(poses[:10]), poses[10]
    rng = np.random.default_rng(1)
    others = [tour.candidates[index] for index in rng.integers(0, len(tour.candidates), 40)]

    now = mean_square(visited)
    helps = {one: now - mean_square([*visited, one]) for one in [chosen, *others]}

    assert helps[chosen] >= LEAST_SHARE * max(helps.values())
    nearer = [
        one
        for one in others
        if travel_time_s(present, one, 1) < travel_time_s(present, chosen, 1) - 1e-9
    ]
    assert nearer
    assert all(helps[one] < (1.0 + 1e-6) * helps[chosen] for one in nearer)


def test_the_azimuth_turns_clockwise_to_every_pose_but_where_the_cable_unwinds(poses):
    present, unwound = HOME, 0
    for pose in poses:
        after = wound(present, pose)
        unwound += after.azimuth_deg < present.azimuth_deg
        assert after.azimuth_deg <= RIG_PROFILE["azimuth"].high_deg
        present = after

    assert unwound <= 1


def test_every_pose_lowers_what_is_claimed_and_none_comes_twice(tour, poses):
    claims = [tour.claimed_deg(poses[:count]) for count in range(8, MOST + 1, 4)]

    assert np.all(np.diff(claims) < 0.0)
    assert len(set(poses)) == MOST


def test_the_expected_count_is_the_first_whose_claim_is_small_enough(tour, poses):
    count = expected_count(tour, 0.2, MOST)

    assert 8 < count < MOST
    assert tour.claimed_deg(poses[:count]) <= 0.2 < tour.claimed_deg(poses[: count - 1])
    assert expected_count(tour, 0.05, MOST) is None


def test_a_lost_pose_changes_what_comes_next(tour, poses):
    """Without its only level pose the tour goes to a level one, or to where that is made up for."""
    present = HOME
    for pose in poses[:8]:
        present = wound(present, pose)
    left = [pose for pose in poses[:8] if pose.pitch_deg or pose.roll_deg]
    assert len(left) == 7

    following = tour.following(left, present)

    assert mean_square([*left, following]) < 0.5 * mean_square(left)


def test_no_candidate_is_a_pose_of_the_verification_grid(tour):
    grid = [
        Attitude(azimuth_deg=azimuth, pitch_deg=pitch, roll_deg=roll)
        for azimuth, pitch, roll in grid_attitudes_deg().tolist()
    ]

    assert not any(one.is_at(other) for one in tour.candidates for other in grid)
