"""bus.dbc and rig_axis.eds: up to date, complete, and read by other people's tools."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import canopen as canopen_library
import cantools
import pytest

from protocols import canopen, cia402, compass, j1939, reference_field, remounting, uds
from protocols.axis_eds import axis_eds
from protocols.axis_objects import AXIS_OBJECTS, DataType
from protocols.database import DBC_PATH, EDS_PATH, bus_frames, dbc_text
from protocols.e2e import E2eSender
from protocols.frame import EXTENDED
from protocols.module_frames import module_frames
from protocols.rig_frames import rig_frames
from protocols.sync import SYNC_DATA, SYNC_ID, TICK_DONE_ID, pack_tick_done

if TYPE_CHECKING:
    from pathlib import Path

    from protocols.frame_layout import FrameLayout

DATABASE = cantools.database.load_file(DBC_PATH)
AXIS = canopen_library.import_od(str(EDS_PATH), node_id=canopen.PITCH_NODE)
FRAMES = {frame.name: frame for frame in bus_frames()}


def test_the_files_are_what_the_tables_say() -> None:
    sentence = "is out of date: run python -m protocols.database"
    assert DBC_PATH.read_text() == dbc_text(), f"bus.dbc {sentence}"
    assert EDS_PATH.read_text() == axis_eds(), f"rig_axis.eds {sentence}"


def test_the_module_writes_both_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from protocols import database

    monkeypatch.setattr(database, "DBC_PATH", tmp_path / "a.dbc")
    monkeypatch.setattr(database, "EDS_PATH", tmp_path / "a.eds")

    database.write_files()

    assert (tmp_path / "a.dbc").read_text() == DBC_PATH.read_text()
    assert (tmp_path / "a.eds").read_text() == EDS_PATH.read_text()


AXIS_IDENTIFIERS = (
    canopen.emergency_id, canopen.tpdo1_id, canopen.rpdo1_id, canopen.sdo_request_id,
    canopen.sdo_response_id, canopen.heartbeat_id,
)  # fmt: skip
MODULE_IDENTIFIERS = (
    compass.mag_set_id, compass.mag_reset_id, compass.acceleration_id, compass.heading_id,
    compass.status_id, compass.vehicle_direction_id, j1939.address_claimed_id, j1939.request_id,
    uds.physical_request_id, uds.physical_response_id,
)  # fmt: skip


def test_every_identifier_of_the_product_is_described_once() -> None:
    used = {canopen.NMT_ID, SYNC_ID, TICK_DONE_ID, canopen.heartbeat_id(canopen.BENCH_NODE)}
    used |= {remounting.REMOUNT_ID, remounting.REMOUNT_DONE_ID}
    for node in canopen.AXIS_NODES:
        used |= {function(node) for function in AXIS_IDENTIFIERS}
    used |= {function(j1939.MODULE_ADDRESS) for function in MODULE_IDENTIFIERS}
    used |= {
        function(reference_field.REFERENCE_ADDRESS)
        for function in (
            reference_field.reference_field_id,
            j1939.address_claimed_id,
            j1939.request_id,
        )
    }

    described = [
        message.frame_id | (EXTENDED if message.is_extended_frame else 0)
        for message in DATABASE.messages
    ]

    assert sorted(described) == sorted(used)


@pytest.mark.parametrize("frame", bus_frames(), ids=lambda frame: frame.name)
def test_cantools_reads_each_frame_as_the_table_says(frame: FrameLayout) -> None:
    message = DATABASE.get_message_by_name(frame.name)

    assert message.length == frame.length
    assert message.senders == [frame.sender]
    assert (message.cycle_time or 0) == frame.cycle_ms
    assert message.protocol == ("j1939" if frame.extended else None)
    for signal in frame.signals:
        read = message.get_signal_by_name(signal.name)
        assert (read.start, read.length, read.is_signed) == (
            signal.start,
            signal.length,
            signal.signed,
        )
        assert (read.scale, read.offset, read.unit or "") == (
            pytest.approx(signal.scale, rel=1e-15),
            signal.offset,
            signal.unit,
        )
        assert read.minimum == pytest.approx(signal.minimum)
        assert read.maximum == pytest.approx(signal.maximum)
        assert (read.spn or None) == signal.spn


@pytest.mark.parametrize("frame", bus_frames(), ids=lambda frame: frame.name)
def test_no_bit_has_two_meanings_and_all_fit_the_frame(frame: FrameLayout) -> None:
    bits = [
        bit for signal in frame.signals for bit in range(signal.start, signal.start + signal.length)
    ]

    assert len(bits) == len(set(bits))
    assert max(bits) < 8 * frame.length


def test_process_data_decode_in_degrees() -> None:
    message = DATABASE.get_message_by_name("Tpdo1Pitch")

    values = message.decode(canopen.pack_tpdo1(0x0637, -30_000))

    assert values == {"Statusword": 0x0637, "Position": -30.0}


def test_service_data_decode_into_their_parts() -> None:
    message = DATABASE.get_message_by_name("SdoRequestRoll")

    values = message.decode(canopen.pack_sdo_download(0x607D, 2, (45_000).to_bytes(4, "little")))

    assert values == {"Command": 0x23, "Index": 0x607D, "Subindex": 2, "Data": 45_000}


def test_tick_done_and_request_decode_as_packed() -> None:
    tick = DATABASE.get_message_by_name("TickDone").decode(pack_tick_done(70_000, 100))
    request = DATABASE.get_message_by_name("Request").decode(j1939.pack_request(60928))

    assert tick == {"Tick": 70_000, "SyncCounter": 100}
    assert request == {"ParameterGroup": 60928}


def test_address_claim_decodes_into_the_name() -> None:
    values = DATABASE.get_message_by_name("AddressClaimed").decode(j1939.pack_name("SN-0001"))

    assert values["IdentityNumber"] == j1939.identity_number("SN-0001")
    assert (values["ManufacturerCode"], values["Function"]) == (2047, 0x82)
    assert values["ArbitraryAddressCapable"] == 0


def test_frames_of_a_module_at_another_address_keep_their_layout() -> None:
    here = {frame.name: frame.signals for frame in module_frames()}
    there = {frame.name: frame.signals for frame in module_frames(0x8A)}

    assert here == there
    assert {frame.name for frame in rig_frames()}.isdisjoint(here)


# ---- candump -L | cantools decode ------------------------------------------------------------


def cantools_decode(log: str, *options: str) -> tuple[list[str], str]:
    """Return what `cantools decode` makes of each line of a candump log, and its complaints."""
    command = [sys.executable, "-m", "cantools", "decode", "-s", *options, str(DBC_PATH)]
    done = subprocess.run(command, input=log, capture_output=True, text=True, check=True)
    return [line.partition(" :: ")[2] for line in done.stdout.splitlines()], done.stderr


def candump_line(can_id: int, data: bytes) -> str:
    digits = f"{can_id & 0x1FFFFFFF:08X}" if can_id & EXTENDED else f"{can_id:03X}"
    return f"(1700000000.000000) vcan0 {digits}#{data.hex().upper()}\n"


def mag_set_line(source: int) -> str:
    can_id = compass.mag_set_id(source)
    return candump_line(
        can_id, compass.pack_counts(E2eSender(compass.data_id(can_id)), 5, 1024, 0, -1)
    )


def test_the_command_line_decodes_a_log_without_a_mask() -> None:
    log = (
        candump_line(SYNC_ID, SYNC_DATA[7])
        + candump_line(canopen.tpdo1_id(1), canopen.pack_tpdo1(0x27, 90_000))
        + candump_line(canopen.heartbeat_id(2), b"\x05")
        + mag_set_line(0x80)
    )

    lines, complaints = cantools_decode(log)

    assert complaints == ""
    assert lines[0] == "Sync(Counter: 7)"
    assert lines[1] == "Tpdo1Azimuth(Statusword: 39, Position: 90.0 deg)"
    assert lines[2] == "HeartbeatPitch(State: operational)"
    assert lines[3].startswith("MagSet(E2eCrc: ")
    assert lines[3].endswith("E2eCounter: 0, Group: 5, X: 100.0 mG, Y: 0.0 mG, Z: -0.09765625 mG)")


def test_the_command_line_decodes_modules_at_any_address_with_the_mask() -> None:
    log = (
        mag_set_line(0x80)
        + mag_set_line(0x8F)
        + candump_line(uds.physical_response_id(0x8F), bytes.fromhex("03 7F 22 31 CC CC CC CC"))
    )

    lines, _ = cantools_decode(log, "-m", "0x1fffff00")

    assert all(line.startswith("MagSet(") and "X: 100.0 mG" in line for line in lines[:2])
    assert lines[2].startswith("UdsResponse(Byte0: 3, Byte1: 127,")


def test_with_the_mask_sync_is_still_sync_and_the_drives_keep_their_signals() -> None:
    # documented in protocols.database: the mask hides which drive an 11-bit frame is of
    log = (
        candump_line(SYNC_ID, SYNC_DATA[7])
        + candump_line(canopen.tpdo1_id(1), canopen.pack_tpdo1(0x27, 90_000))
        + candump_line(canopen.heartbeat_id(2), b"\x05")
    )

    lines, complaints = cantools_decode(log, "-m", "0x1fffff00")

    assert lines[0] == "Sync(Counter: 7)"
    assert lines[1] == "Tpdo1Roll(Statusword: 39, Position: 90.0 deg)"
    assert lines[2] == "HeartbeatBench(State: operational)"
    assert "Overwriting message" in complaints


# ---- the data sheet of an axis ---------------------------------------------------------------


def test_the_data_sheet_has_every_object_that_the_product_names() -> None:
    named = {
        value
        for name, value in vars(cia402).items()
        if isinstance(value, int) and 0x1000 <= value <= 0x6FFF and not name.startswith("EMCY")
    } - {cia402.SW_SET_POINT_ACKNOWLEDGE, cia402.SW_FOLLOWING_ERROR}

    assert named <= set(AXIS)
    assert {0x1000, 0x1001, 0x1016, 0x1017, 0x1018, 0x1019, 0x1400, 0x1600, 0x1800, 0x1A00} <= set(
        AXIS
    )


@pytest.mark.parametrize("item", AXIS_OBJECTS, ids=lambda item: f"{item.index:04X}h")
def test_the_library_reads_each_entry_as_the_table_says(item) -> None:  # type: ignore[no-untyped-def]
    for subindex, entry in enumerate(item.entries, start=0 if len(item.entries) == 1 else 1):
        read = AXIS.get_variable(item.index, subindex)
        if item.object_type != 0x07:
            read = AXIS[item.index][subindex or 1]
        assert read.data_type == entry.kind.value
        assert read.access_type == entry.access
        assert read.pdo_mappable == entry.mappable
        assert len(read) == 8 * entry.kind.size
        assert (read.unit, read.factor) == (entry.unit, pytest.approx(entry.factor))
        if isinstance(entry.default, int):
            assert read.default == entry.default


def test_identifiers_follow_the_node() -> None:
    assert AXIS[0x1400][1].default == canopen.rpdo1_id(canopen.PITCH_NODE)
    assert AXIS[0x1800][1].default & 0x7FF == canopen.tpdo1_id(canopen.PITCH_NODE)
    assert AXIS[0x1014].default == canopen.emergency_id(canopen.PITCH_NODE)


@pytest.mark.parametrize(
    ("mapping", "objects"),
    [
        (0x1600, [(cia402.CONTROLWORD, 16), (cia402.TARGET_POSITION, 32)]),
        (0x1A00, [(cia402.STATUSWORD, 16), (cia402.POSITION_ACTUAL, 32)]),
    ],
)
def test_the_mapping_is_what_the_process_data_carry(
    mapping: int, objects: list[tuple[int, int]]
) -> None:
    mapped = [AXIS[mapping][place].default for place in (1, 2)]

    assert [(entry >> 16, entry & 0xFF) for entry in mapped] == objects
    assert all(AXIS[index].pdo_mappable for index, _ in objects)
    assert sum(bits for _, bits in objects) == 8 * len(canopen.pack_tpdo1(0, 0))


def test_positions_are_shown_in_degrees() -> None:
    position = AXIS[cia402.POSITION_ACTUAL]

    assert position.decode_phys(90_000) == pytest.approx(90.0)
    assert position.unit == "deg"


def test_data_types_know_their_size_and_sign() -> None:
    assert [(kind.size, kind.signed) for kind in DataType] == [
        (1, True),
        (2, True),
        (4, True),
        (1, False),
        (2, False),
        (4, False),
    ]
