"""Change of the accelerometer's zero from calibration to verification, against drawn walks."""

from __future__ import annotations

import numpy as np
import pytest

from bench.samples import READING
from bench.uncertainty.unit_data import UnitData
from bench.uncertainty.zero_change import zero_change_g

CALIBRATION_S = np.array([1.0, 3.0, 4.5, 10.0, 60.0, 110.0, 130.0])
VERIFICATION_S = np.array([140.0, 180.0, 181.0, 260.0])
WALKING = UnitData(accel_wander_g=0.0003)


def at(t_s, temperature_c=25.0):
    rows = np.zeros(len(t_s), dtype=READING)
    rows["t_s"], rows["temperature_c"] = t_s, temperature_c
    return rows


def test_the_means_of_drawn_walks_differ_by_what_is_stated():
    rng = np.random.default_rng(1)
    t_s = np.concatenate([CALIBRATION_S, VERIFICATION_S])
    steps_g = 0.0003 * np.sqrt(np.diff(t_s, prepend=0.0) / 100.0)
    walk_g = np.cumsum(steps_g * rng.standard_normal((20_000, len(t_s))), axis=1)
    change_g = walk_g[:, 7:].mean(axis=1) - walk_g[:, :7].mean(axis=1)

    stated_g = zero_change_g(at(CALIBRATION_S), at(VERIFICATION_S), WALKING)

    assert np.std(change_g) == pytest.approx(stated_g, rel=4.0 / np.sqrt(2.0 * 20_000))


def test_a_long_break_before_the_verification_counts_with_the_root_of_its_time():
    before, after = at([0.0]), at([400.0])

    assert zero_change_g(before, after, WALKING) == pytest.approx(0.0006)


def test_the_order_of_the_poses_in_a_step_does_not_matter():
    there = zero_change_g(at(CALIBRATION_S), at(VERIFICATION_S), WALKING)

    assert zero_change_g(at(CALIBRATION_S[::-1]), at(VERIFICATION_S), WALKING) == there


def test_a_unit_that_has_warmed_moves_by_its_tempco_beside_the_walk():
    before, after = at([0.0, 50.0], 25.0), at([0.0, 50.0], 25.1)
    drifting = UnitData(accel_tempco_g_per_c=0.002)

    assert zero_change_g(before, after, drifting) == pytest.approx(0.0002 / np.sqrt(3.0))


def test_without_calibration_poses_nothing_is_stated():
    assert zero_change_g(at([]), at(VERIFICATION_S), WALKING) == 0.0
