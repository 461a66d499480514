"""Another unit than the scanned one, another firmware than the released one, or no unit at all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def group():
    """A multicast group of this test process."""
    return f"239.74.251.{os.getpid() % 250 + 1}"


@pytest.fixture
def station(group):
    """Return what starts the virtual devices as a process of their own."""
    processes = []

    def start(*argv):
        channel = ["--interface", "udp_multicast", "--channel", group]
        command = [sys.executable, "-m", "bench.cli.main", "simulate", *channel, *argv]
        process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
        processes.append(process)
        assert "in lock-step" in process.stderr.readline()

    yield start
    for process in processes:
        process.terminate()
        assert process.wait(10) == 0
        process.stderr.close()


def test_another_unit_in_the_seat_than_the_scanned_one_is_an_error(bench_run, station, group):
    station("--serial", "SN0009")

    ended = bench_run("eol_three_axis", "--interface", "udp_multicast", "--channel", group)

    assert ended.code == 4
    assert (ended.record["first_failure"], ended.record["poses"]) == ("serial_match", [])
    (entry,) = (m for m in ended.record["measurements"] if m["name"] == "serial_match")
    assert "scanned SN0001, module says SN0009" in entry["note"]
    assert ended.record["verdict"]["next_action"].startswith("Scan the label")


def test_a_module_that_never_speaks_is_an_error_with_a_record(bench_run, station, group):
    station("--fault", "module_silent@1")

    ended = bench_run("eol_three_axis", "--interface", "udp_multicast", "--channel", group)

    assert ended.code == 4
    assert ended.record["first_failure"] == "module_silent"
    assert "0x80" in ended.record["verdict"]["reason"]


def test_a_channel_on_which_nobody_is_is_an_error_with_a_record(bench_run, group):
    ended = bench_run("eol_three_axis", "--interface", "udp_multicast", "--channel", group)

    assert ended.code == 4
    assert ended.record["verdict"]["outcome"] == "ERROR"
    assert ended.record["first_failure"] in ("module_silent", "bus_fault")
    assert ended.record["run"]["status"] == "error"


@pytest.mark.parametrize(
    ("old", "new"), [("part: CB-AMR3", "firmware: ['9.9.9']"), ("part: CB-AMR3", "part: CB-AMR9")]
)
def test_another_part_or_firmware_than_the_released_fails_with_what_to_do(
    bench_run, edited, old, new
):
    ended = bench_run(edited("procedure", old, new))

    assert ended.code == 1
    assert ended.record["first_failure"] == "firmware_version"
    assert ended.record["verdict"]["next_action"] == "Put the unit into the reprogramming bin."
    assert ended.record["poses"] == []
    assert "firmware 1.0.0" in ended.record["verdict"]["reason"]


def test_the_reason_is_shown_with_what_to_do_and_where_the_record_is(bench_run, edited):
    ended = bench_run(edited("procedure", "part: CB-AMR3", "firmware: ['9.9.9']"))

    shown = " ".join(ended.out.split())
    assert "FAIL" in shown
    assert "reprogramming" in shown
    assert "record.json" in shown
