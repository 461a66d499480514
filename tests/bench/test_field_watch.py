"""Baseline, spoiled dwells and what the record says of them, on readings made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from bench.errors import FieldChanged
from bench.field_watch import FieldWatch, block_means
from bench.record.document import FieldWatchSection
from bench.record.spoiled_poses import unused_positions, used_in_order
from bench.steps.sentinel import Sentinel

FIELD_MG = np.array([240.0, -2.0, 440.0])
POSE = (0.0, 0.0, 0.0)


def dwell(*, shift_mg=0.0, slope_mg=0.0, count=50, seed=0, axis=1):
    """Readings of half a second: a shift, and a change within the dwell, on one axis."""
    readings = FIELD_MG + np.random.default_rng(seed).normal(0.0, 0.02, (count, 3))
    readings[:, axis] += shift_mg + slope_mg * np.linspace(-0.5, 0.5, count)
    return readings


@pytest.fixture
def watch():
    begun = FieldWatch(0.6, poses=40)
    assert begun.dwell_change_mg(dwell()) is None
    return begun


def test_the_first_quiet_dwell_is_the_baseline():
    watch = FieldWatch(0.6, poses=40)

    assert watch.dwell_change_mg(dwell(slope_mg=3.0)) == pytest.approx(2.4, abs=0.1)
    assert watch.baseline_mg is None
    assert watch.dwell_change_mg(dwell(shift_mg=0.2)) is None
    assert watch.baseline_mg == pytest.approx(FIELD_MG + [0.0, 0.2, 0.0], abs=0.02)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_shift_on_any_axis_spoils(watch, axis, sign):
    change_mg = watch.dwell_change_mg(dwell(shift_mg=0.7 * sign, axis=axis))

    assert change_mg == pytest.approx(0.7, abs=0.03)
    assert watch.largest_change_mg == change_mg


def test_what_changes_within_the_dwell_spoils_though_its_mean_does_not(watch):
    readings = dwell(slope_mg=2.0)
    assert readings.mean(axis=0) == pytest.approx(FIELD_MG, abs=0.02)

    assert watch.dwell_change_mg(readings) == pytest.approx(0.8, abs=0.05)


def test_slow_drift_and_noise_do_not_spoil(watch):
    for seed in range(1, 200):
        assert watch.dwell_change_mg(dwell(shift_mg=0.1 * seed / 200, seed=seed)) is None
    assert watch.drift_mg == pytest.approx(0.1, abs=0.015)
    assert watch.largest_change_mg < 0.2


def test_without_a_reference_nothing_is_spoiled():
    watch = FieldWatch(None, poses=40)

    assert watch.dwell_change_mg(dwell(shift_mg=50.0)) is None
    assert watch.dwell_change_mg(np.full((50, 3), np.nan)) is None
    assert watch.entry()["source"] == "none"


def test_missing_readings_are_left_out(watch):
    readings = dwell(shift_mg=0.7)
    readings[::2] = np.nan

    assert watch.dwell_change_mg(readings) == pytest.approx(0.7, abs=0.03)


def test_quiet_is_at_the_baseline_and_before_it_still(watch):
    assert watch.is_quiet(dwell(count=200))
    assert not watch.is_quiet(dwell(count=200, shift_mg=0.7))
    assert not watch.is_quiet(np.zeros((0, 3)))

    begun = FieldWatch(0.6, poses=40)
    assert begun.is_quiet(dwell(count=200, shift_mg=5.0))
    assert not begun.is_quiet(dwell(count=200, slope_mg=1.0))


@pytest.mark.parametrize(("poses", "allowed"), [(4, 4), (40, 10), (137, 34)])
def test_more_than_a_quarter_of_the_poses_spoiled_ends_the_run(poses, allowed):
    watch = FieldWatch(0.6, poses=poses)
    for position in range(allowed):
        watch.spoil(position, "sweep", 3.0, "reference")

    with pytest.raises(FieldChanged, match=rf"at most {allowed} of {poses} poses"):
        watch.spoil(allowed, "sweep", 3.0, "reference")
    assert len(watch.spoiled) == allowed + 1


def test_a_sentinel_is_compared_with_its_first_visit_in_the_run():
    watch = FieldWatch(None, poses=40)
    other = (90.0, 0.0, 0.0)

    assert watch.visit_sentinel(POSE, FIELD_MG, position=0, step="a") == 0.0
    assert watch.visit_sentinel(other, -FIELD_MG, position=1, step="a") == 0.0
    change_mg = watch.visit_sentinel(POSE, FIELD_MG + [0.0, -3.0, 1.0], position=2, step="b")

    assert change_mg == 3.0
    assert watch.entry()["source"] == "sentinel"
    assert (watch.largest_change_mg, watch.drift_mg) == (3.0, 3.0)


def test_the_record_takes_the_entry_of_each_source(watch):
    watch.spoil(3, "sweep", 0.9, "reference").repeated_as = 4
    watch.visit_sentinel(POSE, FIELD_MG, position=9, step="sweep")

    section = FieldWatchSection.model_validate(watch.entry())

    assert section.source == "reference"
    assert section.spoiled[0].repeated_as == 4
    assert section.drift_mg == pytest.approx(0.0, abs=0.02)
    assert FieldWatchSection.model_validate(FieldWatch().entry()).source == "none"


def test_a_repetition_stands_where_the_spoiled_pose_stood():
    record = {
        "field_watch": {
            "spoiled": [
                {"position": 5, "repeated_as": 8},
                {"position": 6, "repeated_as": 9},
                {"position": 8, "repeated_as": 10},
            ],
            "sentinels": [{"position": 4}, {"position": 7}],
        }
    }

    assert used_in_order(range(4, 13), record) == [10, 9, 11, 12]
    assert unused_positions(record) == {4, 5, 6, 7, 8}
    assert used_in_order([2, 1], {}) == [1, 2]


def test_blocks_are_tenths_of_a_second():
    means = block_means(np.repeat(np.arange(5.0), 10)[:, None] * np.ones(3))

    assert means[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert len(block_means(np.zeros((55, 3)))) == 5
    assert len(block_means(np.zeros((3, 3)))) == 1


@pytest.mark.parametrize("change", ["0 mG", "-2 mG"])
def test_a_sentinel_that_no_field_could_satisfy_is_refused(change):
    with pytest.raises(ValidationError, match="change must be above zero"):
        Sentinel(change=change)
