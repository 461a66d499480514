"""Devices on clocks of their own, as hardware is: paired by the time of reception."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bench.sample_log import read_samples
from bench.samples import COMPLETE, MOVING

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def level_turn(tmp_path_factory):
    """Return the procedure's file."""
    path = tmp_path_factory.mktemp("procedures") / "level_turn.yaml"
    path.write_text((HERE / "level_turn.yaml").read_text())
    return path


def test_a_run_on_the_devices_own_clock_passes(forge, bus, level_turn, tmp_path):
    out = tmp_path / "runs"
    forge.start("simulate", *bus, "--free-running").until_it_says("on their own clocks")

    run = forge.start("run", level_turn, "--serial", "SN0001", "--no-dashboard", "--out", out, *bus)

    assert run.wait(55.0) == 0, run.out.read_text() + run.err.read_text()
    record = json.loads((out / "latest" / "record.json").read_text())
    assert record["bus"]["mode"] == "free"
    assert record["verdict"]["outcome"] == "PASS"
    assert record["bus"]["lost"] == 0
    samples = read_samples(out / "latest" / "samples.parquet")
    assert np.mean(samples["complete"] == COMPLETE) > 0.999
    assert record["run"]["simulated_s"] == pytest.approx(record["run"]["wall_s"], abs=1.0)
    assert_every_dwell_is_at_rest(samples)
    pairing = record["bus"]["pairing"]
    assert min(pairing["clockwise_rows"], pairing["counter_clockwise_rows"]) > 200
    assert abs(pairing["latency_s"]) < 0.02
    assert 0.0 < pairing["latency_sd_s"] < 0.002


def assert_every_dwell_is_at_rest(samples):
    positions = np.unique(samples["position"][samples["position"] != MOVING])
    assert len(positions) == 13
    for position in positions:
        dwell = samples[samples["position"] == position]
        assert 15 <= len(dwell) <= 25, "0.2 s at 100 Hz"
        assert np.ptp(dwell["rig_azimuth_deg"]) < 0.02
