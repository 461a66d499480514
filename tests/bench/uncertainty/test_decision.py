"""Expanded uncertainty and conformity of the largest and the RMS error."""

from __future__ import annotations

import numpy as np
import pytest

from bench.station import Seat, Surroundings
from bench.uncertainty.decision import LargestError, heading_decision

POSES = [(15.0 * k, 0.0, 0.0) for k in range(24)] + [(20.0, 0.0, 30.0)]
LEVEL = np.arange(25) < 24


def test_the_guard_band_follows_the_pose_that_is_nearest_to_the_limit_with_its_uncertainty():
    # the second pose is 0.1 deg farther from the limit, but three times as uncertain
    spread = LargestError(
        error_deg=np.array([0.40, -0.30, 0.0]), columns_deg=np.diag([0.05, 0.15, 0.2])
    )

    assert spread.expanded == pytest.approx(0.3)


def test_a_value_that_passes_with_its_guard_band_passes_at_every_pose():
    rng = np.random.default_rng(1)
    for _ in range(200):
        errors, columns = rng.normal(0.0, 0.2, 8), rng.normal(0.0, 0.05, (8, 3))
        spread = LargestError(error_deg=errors, columns_deg=columns)
        every = np.abs(errors) + 2.0 * np.linalg.norm(columns, axis=1)
        assert np.abs(errors).max() + spread.expanded >= every.max() - 1e-12


def test_level_and_tilted_poses_decide_apart(budget):
    found = budget(POSES, seat=Seat(u_level_deg=0.4), surroundings=Surroundings())
    errors = np.zeros(25)

    assert heading_decision(errors, found, LEVEL).maximum.expanded == pytest.approx(0.0, abs=1e-6)
    tilted = heading_decision(errors, found, ~LEVEL)
    assert tilted.maximum.expanded == pytest.approx(0.4 * 0.5, rel=1e-5)


def test_a_shared_index_error_moves_the_rms_by_the_mean_error_over_it(budget):
    found = budget(POSES, seat=Seat(u_index_deg=0.02))
    errors = 0.2 + 0.1 * np.cos(np.deg2rad(15.0 * np.arange(25)))
    rms = np.sqrt(np.mean(errors[LEVEL] ** 2))

    spread = heading_decision(errors, found, LEVEL).rms

    assert spread.expanded == pytest.approx(0.02 * errors[LEVEL].mean() / rms, rel=0.01)
    assert spread.conformity(None, float(rms)) == pytest.approx(0.5, abs=0.01)
    assert spread.conformity(None, float(rms) + spread.expanded) == pytest.approx(0.977, abs=0.01)


def test_a_probability_needs_an_upper_limit_alone(budget):
    spread = heading_decision(np.zeros(25), budget(POSES), LEVEL)

    assert spread.maximum.conformity(0.1, 0.5) is None
    assert spread.rms.conformity(None, None) is None


def test_false_accepts_and_rejects_near_the_limit_are_those_of_the_probability(budget):
    """Units whose true errors are drawn flat about the limit: the predicted share conforms."""
    found = budget(
        POSES,
        u_field_azimuth_deg=0.05,
        seat=Seat(u_index_deg=0.04),
        surroundings=Surroundings(u_one_cycle_deg=0.023, u_fine_deg=0.023),
    )
    columns = found.test_columns_deg[LEVEL]
    rng = np.random.default_rng(9)
    shape = 0.3 * np.cos(np.deg2rad(15.0 * np.arange(24)))
    conforms, predicted = [], []
    for offset in rng.uniform(0.0, 0.4, 300):
        true = shape + offset
        measured = true + columns @ rng.standard_normal(columns.shape[1])
        spread = LargestError(error_deg=measured, columns_deg=columns)
        conforms.append(np.abs(true).max() <= 0.5)
        predicted.append(spread.conformity(None, 0.5))

    gap = np.mean(conforms) - np.mean(predicted)
    sd = np.sqrt(np.mean(np.array(predicted) * (1.0 - np.array(predicted))) / 300)
    assert abs(gap) < 4.0 * sd
