"""Ctrl-C and SIGTERM at any moment: rig parked, record closed, coefficients old or new.

The run has its devices in its own process, and the signal comes at a frame of the bus: the
moments are exact.
"""

from __future__ import annotations

import itertools
import json
import signal
import time
from pathlib import Path

import can
import pytest

from bench.record.document import validate_record
from bench.sample_log import read_samples
from devices.coefficient_store import CoefficientStore
from protocols.canopen import AXIS_NODES, rpdo1_id, tpdo1_id, unpack_rpdo1, unpack_tpdo1
from protocols.cia402 import CW_QUICK_STOP, DriveState, drive_state
from protocols.pycan_link import PyCanLink
from protocols.sync import SYNC_ID
from protocols.uds import (
    DEFAULT_COEFFICIENTS,
    pack_coefficients,
    physical_request_id,
    physical_response_id,
)

OLD = pack_coefficients(DEFAULT_COEFFICIENTS)
SDO_AZIMUTH = 0x601
MODULE, BENCH = physical_request_id(0x80), physical_response_id(0x80)


def frame(way, can_id, begins="", count=1):
    return {"way": way, "id": can_id, "begins": begins, "count": count}


def tick(number):
    return frame("in", SYNC_ID, count=number + 1)  # one more makes the mode known


MOMENTS = {
    "while the drives are set up": frame("in", SDO_AZIMUTH, count=5),
    "while homing": frame("in", SDO_AZIMUTH, "2f60600006"),
    "while turning": tick(230),
    "at a settled pose": tick(1500),
    "while the coefficients are sent": frame("in", MODULE, "22"),
    "between write and commit": frame("out", BENCH, "036e0101"),
    "at the commit": frame("in", MODULE, "0431010202"),
    "while the module restarts": frame("out", BENCH, "025101"),
    "while verifying": tick(4800),
    "while parking": tick(5400),
}
NEW_IS_VERIFIED = {"while parking"}
NO_ZERO_YET = {"while the drives are set up", "while homing"}


def run(forge, procedure, out, trips):
    process = forge.start(
        "run", procedure, "--serial", "SN0001", "--no-dashboard", "--no-input",
        "--out", out, "--nvm", out.with_suffix(".nvm"), trips=trips,
    )  # fmt: skip
    process.wait(30.0)
    return process


def record_of(out):
    assert not list(out.rglob("*.part")), "the record was not closed"
    record = json.loads((out / "latest" / "record.json").read_text())
    validate_record(record)
    return record


def bank_of(out):
    store = CoefficientStore(Path(out.with_suffix(".nvm")))
    store.boot()
    return pack_coefficients(store.active)


def last_frames(out):
    """Return the drives' last states and the bench's last control words, by node."""
    states, controls = {}, {}
    nodes = {tpdo1_id(node): node for node in AXIS_NODES}
    orders = {rpdo1_id(node): node for node in AXIS_NODES}
    with can.BLFReader(out / "latest" / "bus.blf") as frames:
        for message in frames:
            if message.arbitration_id in nodes:
                status, _ = unpack_tpdo1(bytes(message.data))
                states[nodes[message.arbitration_id]] = drive_state(status)
            elif message.arbitration_id in orders:
                control, _ = unpack_rpdo1(bytes(message.data))
                controls[orders[message.arbitration_id]] = control
    return states, controls


def assert_parked(out, *, at_zero=True):
    states, controls = last_frames(out)
    assert DriveState.OPERATION_ENABLED not in states.values(), states
    assert set(controls.values()) <= {0, CW_QUICK_STOP}, controls
    if at_zero:
        last = read_samples(out / "latest" / "samples.parquet")[-1]
        for axis in ("azimuth", "pitch", "roll"):
            assert abs(last[f"rig_{axis}_deg"]) < 0.1


@pytest.mark.parametrize(
    ("moment", "number"),
    [
        *zip(MOMENTS, itertools.cycle([signal.SIGINT, signal.SIGTERM]), strict=False),
        ("while turning", signal.SIGTERM),
        ("between write and commit", signal.SIGINT),
        ("while verifying", signal.SIGTERM),
    ],
)
def test_a_signal_ends_the_run_in_its_safe_state(forge, short_procedure, tmp_path, moment, number):
    out = tmp_path / "runs"

    process = run(forge, short_procedure, out, ({**MOMENTS[moment], "signal": number},))

    assert process.code == 128 + number, process.err.read_text()
    record = record_of(out)
    assert record["verdict"]["outcome"] == "ABORTED"
    assert record["run"]["status"] == "aborted"
    assert f"signal {int(number)}" in record["verdict"]["reason"]
    assert (bank_of(out) == OLD) == (moment not in NEW_IS_VERIFIED)
    assert_parked(out, at_zero=moment not in NO_ZERO_YET)


def test_a_run_without_a_signal_passes_and_leaves_the_new_coefficients(
    forge, short_procedure, tmp_path
):
    out = tmp_path / "runs"

    process = run(forge, short_procedure, out, ())

    assert process.code == 0, process.err.read_text()
    assert record_of(out)["verdict"]["outcome"] == "PASS"
    assert bank_of(out) != OLD
    assert_parked(out)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (tick(1500), tick(1502)),
        (tick(5400), tick(5403)),
        (frame("out", BENCH, "036e0101"), frame("in", SYNC_ID, count=4330)),
        (tick(4800), tick(4815)),
    ],
    ids=["while unwinding", "while parking", "while rolling back", "while restoring"],
)
def test_a_second_signal_still_leaves_a_record_and_drives_that_stand(
    forge, short_procedure, tmp_path, first, second
):
    out = tmp_path / "runs"
    trips = ({**first, "signal": signal.SIGTERM}, {**second, "signal": signal.SIGINT})

    process = run(forge, short_procedure, out, trips)

    assert process.code == 128 + signal.SIGTERM, process.err.read_text()
    assert record_of(out)["verdict"]["outcome"] in ("ABORTED", "ERROR")
    assert_parked(out, at_zero=False)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_bench_looks_who_is_on_the_bus_ends_it_without_a_record(
    forge, bus, short_procedure, tmp_path, number
):
    out = tmp_path / "runs"
    process = forge.start("run", short_procedure, "--serial", "SN0001", "--out", out, *bus)
    with PyCanLink(bus[1], bus[3]) as witness:
        while (frame := witness.wait(10.0)) is not None and frame.can_id != SYNC_ID:
            pass
        process.send(number)

    assert process.wait(5.0) == 128 + number
    assert process.err.read_text().strip() == f"compass-bench: run aborted by signal {int(number)}"
    assert not list(out.rglob("record.json"))


def test_a_signal_while_the_report_is_written_spoils_no_file(forge, short_procedure, tmp_path):
    out = tmp_path / "runs"
    process = forge.start("run", short_procedure, "--serial", "SN0001", "--out", out)
    end_s = time.monotonic() + 20.0
    while not list(out.rglob("run.rrd*")):
        assert time.monotonic() < end_s
        assert process.ended() is None
        time.sleep(0.002)
    process.send(signal.SIGINT)

    assert process.wait(20.0) == 128 + signal.SIGINT
    assert record_of(out)["verdict"]["outcome"] == "PASS", "it had been reached before the signal"
    assert {"record.json", "run.rrd", "report.html", "junit.xml"} <= {
        file.name for file in (out / "latest").iterdir()
    }
