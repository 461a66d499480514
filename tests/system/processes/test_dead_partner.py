"""One side dies: the other says so, or stops, within its deadline."""

from __future__ import annotations

import json
import signal
import time

import pytest

from bench.bus import SIMULATOR_DEADLINE_S
from bench.record.document import validate_record
from protocols.canopen import (
    AXIS_NODES,
    emergency_id,
    tpdo1_id,
    unpack_tpdo1,
)
from protocols.cia402 import COUNTS_PER_DEG, DriveState, drive_state
from protocols.pycan_link import PyCanLink
from protocols.sync import SYNC_DATA, SYNC_ID

AZIMUTH = AXIS_NODES[0]
HEARTBEAT_LOST = 0x8130
LONGEST_BRAKING_DEG = 25.0
"""From 90 deg/s at 180 deg/s2 it takes 22.5 deg."""
WITHIN_S = 1.0
"""0.5 s of missing heartbeats, a tick, and the time in which this test is told."""


def test_a_simulator_killed_amid_a_run_is_an_error_in_one_sentence_with_a_record(
    forge, bus, short_procedure, tmp_path
):
    out = tmp_path / "runs"
    at_tick_800 = {"way": "in", "id": SYNC_ID, "count": 800, "signal": signal.SIGKILL}
    simulator = forge.start("simulate", *bus, trips=(at_tick_800,))
    simulator.until_it_says("in lock-step")

    run = forge.start(
        "run", short_procedure, "--serial", "SN0001", "--no-dashboard", "--out", out, *bus
    )
    assert simulator.wait(30.0) == -signal.SIGKILL
    died_s = time.monotonic()
    code = run.wait(30.0)
    took_s = time.monotonic() - died_s

    assert code == 4, run.err.read_text()
    assert SIMULATOR_DEADLINE_S - 0.5 < took_s < SIMULATOR_DEADLINE_S + 4.0
    record = json.loads((out / "latest" / "record.json").read_text())
    validate_record(record)
    assert record["verdict"]["outcome"] == "ERROR"
    assert record["first_failure"] == "bus_fault"
    assert "the simulator has not answered SYNC" in record["verdict"]["reason"]
    assert record["verdict"]["reason"].count(". ") == 0
    assert record["run"]["ticks"] >= 799
    assert "Traceback" not in run.err.read_text()


def test_a_channel_on_which_nobody_speaks_is_an_error_with_a_record(
    forge, bus, short_procedure, tmp_path
):
    out = tmp_path / "runs"

    run = forge.start(
        "run", short_procedure, "--serial", "SN0001", "--no-dashboard", "--out", out, *bus
    )

    assert run.wait(30.0) == 4
    record = json.loads((out / "latest" / "record.json").read_text())
    assert record["verdict"]["outcome"] == "ERROR"
    assert "nothing was heard on the bus" in record["verdict"]["reason"]


def heard(link, can_id, timeout_s):
    """Return the next frame of an identifier, asking for positions meanwhile."""
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        frame = link.wait(0.01)
        if frame is not None and frame.can_id == can_id:
            return frame
    return None


def azimuth(link):
    """Return state and angle of the azimuth drive, by a SYNC of our own."""
    link.send(SYNC_ID, SYNC_DATA[1])
    frame = heard(link, tpdo1_id(AZIMUTH), 2.0)
    assert frame is not None, "the azimuth drive does not answer SYNC"
    status, counts = unpack_tpdo1(frame.data)
    return drive_state(status), counts / COUNTS_PER_DEG


def turning(link, timeout_s=20.0):
    """Wait until the azimuth turns."""
    before = None
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        frame = heard(link, tpdo1_id(AZIMUTH), 1.0)
        if frame is None:
            continue
        _, counts = unpack_tpdo1(frame.data)
        if before is not None and abs(counts - before) > 0.3 * COUNTS_PER_DEG:
            return
        before = counts
    pytest.fail("the azimuth never turned")


def test_a_killed_bench_lets_the_drives_stop_the_rig(forge, bus, short_procedure, tmp_path):
    forge.start("simulate", *bus, "--free-running").until_it_says("on their own clocks")
    run = forge.start(
        "run", short_procedure, "--serial", "SN0001", "--no-dashboard", "--out", tmp_path, *bus
    )
    with PyCanLink(bus[1], bus[3]) as witness:
        turning(witness)
        run.send(signal.SIGKILL)
        killed_s = time.monotonic()
        emergency = heard(witness, emergency_id(AZIMUTH), 5.0)
        took_s = time.monotonic() - killed_s
        state, braking_deg = azimuth(witness)
        time.sleep(1.0)
        _, stopped_deg = azimuth(witness)
        time.sleep(0.3)
        later, later_deg = azimuth(witness)

    assert run.wait(5.0) == -signal.SIGKILL
    assert emergency is not None
    assert int.from_bytes(emergency.data[:2], "little") == HEARTBEAT_LOST
    assert took_s < WITHIN_S
    assert DriveState.OPERATION_ENABLED not in (state, later)
    assert abs(stopped_deg - braking_deg) < LONGEST_BRAKING_DEG
    assert abs(later_deg - stopped_deg) < 0.05
    assert list(tmp_path.rglob("*.part")), "what the killed bench has recorded is there"
