"""NMT, boot-up, heartbeats, SDO and EMCY of a drive; its objects against its EDS."""

from __future__ import annotations

from pathlib import Path

import canopen as canopen_library
import pytest

import protocols
from protocols import canopen, cia402
from protocols.errors import SdoAbort

EDS = Path(protocols.__file__).with_name("rig_axis.eds")


def _states(frames):
    return [data[0] for can_id, data in frames if can_id == 0x702]


def test_boots_up_once_and_waits_in_pre_operational_without_pdos(drive_station):
    frames = drive_station.tick(5)

    assert frames == [(0x702, b"\0")]


def test_sends_one_tpdo_a_sync_once_it_is_operational(drive_station):
    drive_station.nmt(canopen.NMT_START)

    frames = drive_station.tick(4)

    assert [can_id for can_id, _ in frames] == [0x702] + [0x182] * 4


def test_obeys_nmt_for_its_own_number_and_no_other(drive_station):
    drive_station.nmt(canopen.NMT_START, 3)
    drive_station.tick()
    assert drive_station.statusword == 0

    drive_station.nmt(canopen.NMT_START, 2)
    drive_station.tick()

    assert drive_station.statusword == 0x0250


def test_a_stopped_node_answers_no_sdo(drive_station):
    drive_station.nmt(canopen.NMT_STOP)
    drive_station.tick()

    drive_station.send(0x602, canopen.pack_sdo_upload(0x1000, 0))

    assert drive_station.tick() == []


def test_a_reset_boots_up_again_with_default_objects(drive_station):
    drive_station.write(cia402.PROFILE_VELOCITY, 0, 5, 4)
    drive_station.tick()

    drive_station.nmt(canopen.NMT_RESET_NODE)

    assert _states(drive_station.tick()) == [0]
    assert drive_station.read(cia402.PROFILE_VELOCITY) == 45_000


def test_produces_heartbeats_in_the_period_written_to_1017h(drive_station):
    drive_station.write(cia402.PRODUCER_HEARTBEAT, 0, 100, 2)

    frames = drive_station.tick(100)

    assert _states(frames) == [0] + [canopen.STATE_PRE_OPERATIONAL] * 10


def test_the_answer_of_an_sdo_leaves_with_the_next_tick(drive_station):
    drive_station.tick()
    drive_station.send(0x602, canopen.pack_sdo_upload(0x1018, 4))

    frames = drive_station.tick()

    assert frames == [(0x582, canopen.pack_sdo_uploaded(0x1018, 4, (77).to_bytes(4, "little")))]


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (canopen.pack_sdo_upload(0x5FFF, 0), 0x06020000),
        (canopen.pack_sdo_upload(0x1018, 9), 0x06090011),
        (canopen.pack_sdo_download(0x1000, 0, b"\0\0\0\0"), 0x06010002),
        (canopen.pack_sdo_download(0x6040, 0, b"\0"), 0x06070010),
        (canopen.pack_sdo_download(0x6060, 0, b"\x63"), 0x06090030),
        (canopen.pack_sdo_download(0x6098, 0, b"\x01"), 0x06090030),
        (canopen.pack_sdo_download(0x6081, 0, b"\0\0\0\0"), 0x06090030),
        (b"\xa0\x00\x10\x00\0\0\0\0", 0x05040001),
        (b"\x40\x00\x10", 0x05040001),
    ],
)
def test_refuses_with_the_abort_code_of_cia_301(drive_station, data, code):
    answer = drive_station.drive.objects.answer(data)

    with pytest.raises(SdoAbort) as refusal:
        canopen.unpack_sdo_response(2, answer)

    assert refusal.value.code == code


def test_every_object_agrees_with_the_shipped_eds(drive_station):
    described = {}
    for entry in canopen_library.import_od(str(EDS), node_id=2).values():
        if entry.index < 0x1000:
            continue
        variables = entry.values() if hasattr(entry, "subindices") else [entry]
        for variable in variables:
            described[variable.index, variable.subindex] = variable
    objects = drive_station.drive.objects

    assert tuple(sorted(described)) == objects.keys()
    for (index, subindex), variable in described.items():
        answer = objects.answer(canopen.pack_sdo_upload(index, subindex))
        _, _, value = canopen.unpack_sdo_response(2, answer)
        assert len(value) * 8 == len(variable), f"{index:04X}h.{subindex}"
        if "w" not in variable.access_type:
            written = objects.answer(canopen.pack_sdo_download(index, subindex, value))
            assert written[0] == 0x80, f"{index:04X}h.{subindex} must be read-only"
        elif variable.default is not None:
            assert variable.decode_raw(value) == variable.default, f"{index:04X}h.{subindex}"


def _watched(station):
    station.enable()
    station.write(cia402.CONSUMER_HEARTBEAT, 1, 0x7F << 16 | 200, 4)
    station.send(0x77F, b"\x05")


def test_without_a_first_heartbeat_nothing_is_lost(drive_station):
    drive_station.enable()
    drive_station.write(cia402.CONSUMER_HEARTBEAT, 1, 0x7F << 16 | 200, 4)

    drive_station.tick(100)

    assert drive_station.emergencies == []


def test_heartbeats_in_time_keep_the_drive_enabled(drive_station):
    _watched(drive_station)

    for _ in range(10):
        drive_station.tick(15)
        drive_station.send(0x77F, b"\x05")

    assert drive_station.emergencies == []
    assert cia402.drive_state(drive_station.statusword) is cia402.DriveState.OPERATION_ENABLED


def test_a_lost_heartbeat_stops_a_moving_axis_on_the_quick_stop_ramp(drive_station):
    _watched(drive_station)
    drive_station.command(0x3F, 80_000)
    drive_station.tick(15)
    assert drive_station.axis.velocity_dps > 10.0

    drive_station.tick(100)

    assert drive_station.emergencies == [cia402.EMCY_HEARTBEAT]
    assert drive_station.axis.velocity_dps == 0.0
    assert drive_station.position < 20_000
    assert cia402.drive_state(drive_station.statusword) is cia402.DriveState.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("option", "state"),
    [
        (0, cia402.DriveState.OPERATION_ENABLED),
        (1, cia402.DriveState.FAULT),
        (2, cia402.DriveState.SWITCH_ON_DISABLED),
    ],
)
def test_6007h_says_what_a_lost_heartbeat_does(drive_station, option, state):
    drive_station.write(cia402.ABORT_CONNECTION_OPTION, 0, option, 2)
    _watched(drive_station)

    drive_station.tick(40)

    assert cia402.drive_state(drive_station.statusword) is state
