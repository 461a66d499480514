"""Samples and angles of devices that run free: how far they are apart in time."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bench.module import Cycle
from bench.pairing import PAIRED_WITHIN_NS, LatencyEstimate
from bench.sample_log import SampleLog
from bench.samples import COMPLETE, MOVING, SAMPLE

RATE_DPS = 60.0


def turn(direction, *, late_s, rng, iron_mg=(120.0, -70.0), tilt_deg=0.0):
    """Return samples of one turn whose module is `late_s` behind the rig's angle."""
    t_s = np.arange(0.0, 6.0, 0.01)
    samples = np.zeros(len(t_s), dtype=SAMPLE)
    samples["t_s"] = t_s
    samples["position"] = MOVING
    samples["complete"] = COMPLETE
    samples["rig_azimuth_deg"] = direction * RATE_DPS * t_s
    samples["rig_pitch_deg"] = tilt_deg
    seen_rad = np.radians(direction * RATE_DPS * (t_s - late_s))
    field_mg = np.column_stack(
        [iron_mg[0] + 260.0 * np.cos(seen_rad), iron_mg[1] - 240.0 * np.sin(seen_rad + 0.1)]
    )
    samples["set_mg"][:, :2] = field_mg + 0.1 * rng.standard_normal(field_mg.shape)
    samples["reset_mg"][:, :2] = -field_mg
    return samples


@pytest.mark.parametrize("late_s", [0.0, 0.004, 0.020, -0.003])
def test_given_turns_in_both_directions_then_the_latency_is_found(late_s, rng):
    estimate = LatencyEstimate()

    for direction in (+1, -1):
        estimate(turn(direction, late_s=late_s, rng=rng))

    found_s, sd_s = estimate.latency_s
    assert sd_s < 1e-4
    assert found_s == pytest.approx(late_s, abs=5.0 * sd_s + 0.01 * abs(late_s))
    assert estimate.entry()["latency_s"] == found_s


def test_given_one_direction_only_then_there_is_no_estimate(rng):
    estimate = LatencyEstimate()

    estimate(turn(+1, late_s=0.01, rng=rng))

    assert estimate.latency_s is None
    assert estimate.entry()["latency_s"] is None


def test_rows_at_rest_incomplete_or_tilted_are_not_used(rng):
    estimate = LatencyEstimate()
    resting, broken = (turn(+1, late_s=0.01, rng=rng) for _ in range(2))
    resting["position"] = 3
    broken["complete"] = 0

    for samples in (resting, broken, turn(-1, late_s=0.01, rng=rng, tilt_deg=30.0)):
        estimate(samples)

    assert (estimate.clockwise, estimate.counter_clockwise) == (0, 0)


@pytest.mark.parametrize(("mode", "kept", "unpaired"), [("free", 1, 1), ("lockstep", 2, 0)])
def test_a_sample_without_an_angle_of_its_time_is_no_part_of_a_dwell(mode, kept, unpaired):
    listeners = []
    module = SimpleNamespace(
        bus=SimpleNamespace(mode=mode, tick_count=1, start_ns=0),
        status=(20.0, 5.0, 0, 0, 0),
        mag_mg_per_count=0.1,
        accel_g_per_count=0.001,
        add_listener=listeners.append,
    )
    rig = SimpleNamespace(counts=(0, 0, 0), counts_per_deg=100.0, received_ns=0)
    log = SampleLog(None, module, rig)

    log.begin_dwell(4)
    for t_ns in (PAIRED_WITHIN_NS, PAIRED_WITHIN_NS + 1):
        listeners[0](Cycle(t_ns, 1, COMPLETE, *[bytes(8)] * 4))

    assert len(log.end_dwell()) == kept
    assert log.unpaired == unpaired
