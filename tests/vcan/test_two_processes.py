"""Bench and virtual station in two processes, with real SocketCAN between them."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq
import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager
    from pathlib import Path

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.filterwarnings("ignore:.*use of fork.*:DeprecationWarning"),
]

COMMAND = (sys.executable, "-m", "bench.cli.main")
BUS = ("--interface", "socketcan", "--channel", "vcan0")
BRIEF = """\
name: brief
version: "1.0"
title: A few poses
description: What a bench on clocks of its own can do in some seconds.
limits: eol_three_axis
steps:
  - {kind: check_bus, name: bus, listen: 0.3 s}
  - {kind: identify, name: identify}
  - {kind: home, name: home}
  - {kind: noise, name: noise, dwell: 1 s}
  - kind: poses
    name: poses
    rings: [{count: 2, first: 0 deg}, {count: 1, first: 30 deg, roll: 10 deg}]
  - {kind: check_bus, name: bus_at_end, listen: 0.1 s}
"""


def assert_nothing_was_lost(record: dict[str, Any]) -> None:
    """Hold the kernel's drop counters, the links' faults and the E2E counters to zero."""
    bus = record["bus"]
    assert (bus["interface"], bus["channel"]) == ("socketcan", "vcan0")
    assert (bus["dropped"], bus["faults"], bus["lost"]) == (0, {}, 0)
    assert all(frame["lost"] == frame["errors"] == 0 for frame in bus["e2e"].values())


@pytest.mark.timeout(240)
def test_the_main_procedure_passes_in_lockstep_by_the_two_commands(tmp_path: Path) -> None:
    simulator = subprocess.Popen(
        [*COMMAND, "simulate", "--serial", "SN0001", *BUS], stderr=subprocess.PIPE, text=True
    )
    try:
        assert "in lock-step" in simulator.stderr.readline()
        run = ("run", "eol_three_axis", "--serial", "SN0001", "--no-dashboard", "--no-input")
        done = subprocess.run(
            [*COMMAND, *run, *BUS, "--out", str(tmp_path)],
            capture_output=True, text=True, timeout=220, check=False,
        )  # fmt: skip
    finally:
        simulator.terminate()
        simulator.communicate(timeout=20)

    assert (done.returncode, simulator.returncode) == (0, 0), done.stderr
    record = json.loads((tmp_path / "latest" / "record.json").read_text())
    assert record["verdict"]["outcome"] == "PASS"
    assert (record["bus"]["mode"], record["coefficients"]["read_back_equal"]) == ("lockstep", True)
    assert record["run"]["ticks"] > 30_000
    assert_nothing_was_lost(record)


@pytest.mark.timeout(120)
def test_the_samples_and_frames_are_those_of_one_process(
    recorded_run: Any, bench_run: Callable[..., Any], tmp_path: Path
) -> None:
    alone = bench_run(tmp_path, channel=None)

    tables = [pq.read_table(each.folder / "samples.parquet") for each in (alone, recorded_run.done)]
    frames = [(each.folder / "bus.blf").read_bytes() for each in (alone, recorded_run.done)]

    assert recorded_run.done.code == alone.code
    assert tables[0].num_rows > 2_000
    assert tables[0].equals(tables[1])
    assert frames[0] == frames[1]
    assert_nothing_was_lost(recorded_run.done.record)


@pytest.mark.timeout(120)
def test_a_procedure_passes_on_devices_with_clocks_of_their_own(
    station: Callable[..., AbstractContextManager[int]],
    bench_run: Callable[..., Any],
    tmp_path: Path,
) -> None:
    brief = tmp_path / "brief.yaml"
    brief.write_text(BRIEF)

    with station(free_running=True):
        done = bench_run(tmp_path / "runs", brief)

    record = done.record
    assert (done.code, record["verdict"]["outcome"]) == (0, "PASS"), record["verdict"]
    assert record["bus"]["mode"] == "free"
    assert_nothing_was_lost(record)
