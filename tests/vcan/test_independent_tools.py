"""What other people's tools make of our frames on a real interface.

The frames are sent by a link on vcan0, recorded by candump and read by cantools with
bus.dbc, and by tshark as CANopen, as ISO 15765-2 with UDS and as J1939.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections import deque
from typing import TYPE_CHECKING

import isotp
import pytest

from protocols import canopen, compass, j1939, uds
from protocols.database import DBC_PATH
from protocols.e2e import E2eSender
from protocols.frame import EXTENDED
from protocols.pycan_link import PyCanLink
from protocols.sync import SYNC_DATA, SYNC_ID, TICK_DONE_ID, pack_tick_done

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import AbstractContextManager
    from pathlib import Path

    Payloads = Sequence[tuple[int, bytes]]
    Recorder = Callable[[int], AbstractContextManager[list[str]]]

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.skipif(shutil.which("candump") is None, reason="can-utils are not installed"),
]
needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="no tshark here")

RIG: Payloads = (
    (canopen.NMT_ID, canopen.nmt_frame(canopen.NMT_START, 0)),
    (SYNC_ID, SYNC_DATA[7]),
    (canopen.tpdo1_id(1), canopen.pack_tpdo1(0x0637, 90_000)),
    (canopen.rpdo1_id(3), canopen.pack_rpdo1(0x001F, -30_000)),
    (canopen.sdo_request_id(2), canopen.pack_sdo_upload(0x1018, 2)),
    (canopen.sdo_response_id(2), canopen.pack_sdo_uploaded(0x1018, 2, b"\x02\x04\0\0")),
    (canopen.sdo_response_id(2), canopen.pack_sdo_abort(0x5FFF, 0, 0x06020000)),
    (canopen.heartbeat_id(canopen.BENCH_NODE), bytes((canopen.STATE_OPERATIONAL,))),
    (canopen.emergency_id(3), bytes.fromhex("1186200000000000")),
)


def module(source: int) -> Payloads:
    """Return what a module at a source address sends in one cycle."""
    mag, heading = compass.mag_set_id(source), compass.heading_id(source)
    return (
        (mag, compass.pack_counts(E2eSender(compass.data_id(mag)), 5, 1024, -2048, 1)),
        (
            heading,
            compass.pack_heading(E2eSender(compass.data_id(heading)), 5, 270.0, -10.0, 5.0, 3),
        ),
        (compass.status_id(source), compass.pack_status(compass.Status(23.5, 4.998, 0, 1, 0))),
        (compass.vehicle_direction_id(source), compass.pack_vehicle_direction(90.0, 2.0)),
        (j1939.address_claimed_id(source), j1939.pack_name("SN-0001")),
        (j1939.request_id(source), j1939.pack_request(j1939.PGN_ADDRESS_CLAIMED)),
        (TICK_DONE_ID, pack_tick_done(1, 1)),
    )


def diagnostics() -> Payloads:
    """Return the frames of writing a coefficient bank, segmented by can-isotp at both ends."""
    frames: list[tuple[int, bytes]] = []
    to_module: deque[isotp.CanMessage] = deque()
    to_bench: deque[isotp.CanMessage] = deque()

    def end(
        received: deque[isotp.CanMessage], sent: deque[isotp.CanMessage], here: int, there: int
    ) -> isotp.TransportLayerLogic:
        def transmit(message: isotp.CanMessage) -> None:
            frames.append((message.arbitration_id | EXTENDED, bytes(message.data)))
            sent.append(message)

        return isotp.TransportLayerLogic(
            lambda _: received.popleft() if received else None,
            transmit,
            address=isotp.Address(
                isotp.AddressingMode.NormalFixed_29bits, source_address=here, target_address=there
            ),
            params={"tx_padding": 0xCC},
        )

    bench, unit = end(to_bench, to_module, 0xF1, 0x80), end(to_module, to_bench, 0x80, 0xF1)
    bench.send(b"\x2e\x01\x01" + uds.pack_coefficients(uds.DEFAULT_COEFFICIENTS))
    for _ in range(40):
        bench.process()
        unit.process()
    unit.send(b"\x6e\x01\x01")
    unit.process()
    return frames


def recorded(frames: Payloads, candump: Recorder) -> str:
    """Return the candump log of frames that a link sends on vcan0."""
    with candump(len(frames)) as lines, PyCanLink("socketcan", "vcan0") as link:
        for can_id, data in frames:
            link.send(can_id, data)
    assert len(lines) == len(frames)
    return "".join(lines)


def decoded(log: str, *options: str) -> list[str]:
    """Return what `cantools decode` makes of each line."""
    command = [sys.executable, "-m", "cantools", "decode", "-s", *options, str(DBC_PATH)]
    done = subprocess.run(command, input=log, capture_output=True, text=True, check=True)
    return [line.partition(" :: ")[2] for line in done.stdout.splitlines()]


def dissected(log: str, folder: Path, decoders: Sequence[str], *fields: str) -> list[list[str]]:
    """Return fields of each packet as tshark dissects a log."""
    path = folder / "bus.log"
    path.write_text(log)
    command = ["tshark", "-r", str(path), "-T", "fields", "-E", "occurrence=f"]
    command += [word for decoder in decoders for word in ("-d", decoder)]
    command += [word for field in fields for word in ("-e", field)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [line.split("\t") for line in done.stdout.splitlines()]


def test_candump_shows_what_was_sent_bit_by_bit(candump: Recorder) -> None:
    frames = (*RIG, *module(0x80))

    log = recorded(frames, candump)

    shown = [line.split()[2] for line in log.splitlines()]
    assert shown == [
        f"{can_id & 0x1FFFFFFF:0{8 if can_id & EXTENDED else 3}X}#{data.hex().upper()}"
        for can_id, data in frames
    ]


def test_cantools_decodes_every_frame_of_rig_and_module(candump: Recorder) -> None:
    lines = decoded(recorded((*RIG, *module(0x80), *diagnostics()), candump))

    assert lines[:4] == [
        "Nmt(Command: start, NodeId: all)",
        "Sync(Counter: 7)",
        "Tpdo1Azimuth(Statusword: 1591, Position: 90.0 deg)",
        "Rpdo1Roll(Controlword: 31, TargetPosition: -30.0 deg)",
    ]
    assert lines[7] == "HeartbeatBench(State: operational)"
    assert lines[8].startswith("EmergencyRoll(ErrorCode: following error, ErrorRegister: 32,")
    assert lines[9].endswith("Group: 5, X: 100.0 mG, Y: -200.0 mG, Z: 0.09765625 mG)")
    assert "Heading: 270.0 deg, Pitch: -10.0 deg, Roll: 5.0 deg, Quality: calibrated" in lines[10]
    assert lines[11].startswith("Status(Temperature: 23.5 degC, Supply: 4.998 V,")
    assert lines[12].startswith("VehicleDirectionSpeed(CompassBearing: 90.0 deg,")
    assert not any("Unknown" in line or "Wrong" in line for line in lines)


def test_cantools_decodes_modules_at_other_addresses_with_the_mask(candump: Recorder) -> None:
    lines = decoded(recorded((*module(0x80), *module(0x8C)), candump), "-m", "0x1fffff00")

    names = [line.partition("(")[0] for line in lines]
    assert names[:5] == names[7:12]
    assert names[:5] == ["MagSet", "Heading", "Status", "VehicleDirectionSpeed", "AddressClaimed"]
    assert lines[8].endswith(lines[1].partition("Group: ")[2])


@needs_tshark
def test_tshark_reads_the_rig_as_canopen(candump: Recorder, tmp_path: Path) -> None:
    rows = dissected(
        recorded(RIG, candump),
        tmp_path,
        ["can.subdissector,canopen"],
        "_ws.col.Protocol",
        "_ws.col.Info",
        "canopen.sdo.main_idx",
        "canopen.sdo.abort_code",
        "canopen.em.err_code",
    )

    assert {row[0] for row in rows} == {"CANopen"}
    assert [row[1].strip() for row in rows] == [
        "NMT: Start remote node [All]",
        "SYNC [7]",
        "PDO1 (tx)",
        "PDO1 (rx)",
        "Default-SDO (rx): Initiate upload request",
        "Default-SDO (tx): Initiate upload response",
        "Default-SDO (tx): Abort transfer",
        "NMT Error Control: Operational [0x7f]",
        "EMCY",
    ]
    assert rows[5][2] == "0x1018"
    assert rows[6][3] == "0x06020000"
    assert rows[8][4] == "0x8611"


@needs_tshark
def test_tshark_reassembles_the_coefficients_that_are_written(
    candump: Recorder, tmp_path: Path
) -> None:
    rows = dissected(
        recorded(diagnostics(), candump),
        tmp_path,
        ["can.subdissector,iso15765", "iso15765.subdissector,uds"],
        "uds.sid",
        "uds.reply",
        "uds.wdbi.data_identifier",
        "uds.wdbi.data_record",
    )

    services = [row for row in rows if row[0]]
    bank = uds.pack_coefficients(uds.DEFAULT_COEFFICIENTS)
    assert services[0] == ["0x2e", "0x00", "0x0101", bank.hex()]
    assert services[1][:3] == ["0x2e", "0x01", "0x0101"]
    assert len(services) == 2


@needs_tshark
def test_tshark_reads_the_module_as_j1939(candump: Recorder, tmp_path: Path) -> None:
    rows = dissected(
        recorded(module(0x8C), candump),
        tmp_path,
        ["can.subdissector,j1939"],
        "j1939.pgn",
        "j1939.src_addr",
        "j1939.dst_addr",
        "j1939.priority",
    )

    assert [(int(row[0]), int(row[1])) for row in rows[:6]] == [
        (compass.PGN_MAG_SET, 0x8C),
        (compass.PGN_HEADING, 0x8C),
        (compass.PGN_STATUS, 0x8C),
        (j1939.PGN_VEHICLE_DIRECTION, 0x8C),
        (j1939.PGN_ADDRESS_CLAIMED, 0x8C),
        (j1939.PGN_REQUEST, j1939.TESTER_ADDRESS),
    ]
    assert int(rows[5][2]) == 0x8C
    assert {row[3] for row in rows} == {"6"}
