"""States, set-point hand-shake, homing, velocity, limits and faults of a drive (CiA 402)."""

from __future__ import annotations

import pytest

from protocols import canopen, cia402
from protocols.cia402 import DriveState, Mode, drive_state
from protocols.errors import SdoAbort

NEW = cia402.CW_ENABLE | cia402.CW_NEW_SET_POINT
NEW_NOW = NEW | cia402.CW_CHANGE_IMMEDIATELY


def _state(station):
    return drive_state(station.statusword)


def _until(station, bit, ticks=1000):
    for _ in range(ticks):
        station.tick()
        if station.statusword & bit:
            return
    pytest.fail(f"bit {bit:04X}h did not come within {ticks} ticks")


def test_walks_the_power_states_up_and_down(drive_station):
    drive_station.nmt(canopen.NMT_START)
    drive_station.tick()
    seen = [_state(drive_station)]
    for word in (0x06, 0x07, 0x0F, 0x07, 0x06, 0x00):
        drive_station.command(word)
        seen.append(_state(drive_station))

    assert seen == [
        DriveState.SWITCH_ON_DISABLED,
        DriveState.READY_TO_SWITCH_ON,
        DriveState.SWITCHED_ON,
        DriveState.OPERATION_ENABLED,
        DriveState.SWITCHED_ON,
        DriveState.READY_TO_SWITCH_ON,
        DriveState.SWITCH_ON_DISABLED,
    ]


def test_switch_on_without_shutdown_is_ignored(drive_station):
    drive_station.nmt(canopen.NMT_START)
    drive_station.command(0x0F)

    assert _state(drive_station) is DriveState.SWITCH_ON_DISABLED


def test_rpdos_are_ignored_until_the_node_is_operational(drive_station):
    drive_station.command(0x06)
    drive_station.nmt(canopen.NMT_START)
    drive_station.tick()

    assert _state(drive_station) is DriveState.SWITCH_ON_DISABLED


def test_a_set_point_is_acknowledged_and_reached_only_when_the_axis_has_settled(drive_station):
    drive_station.enable()
    drive_station.command(NEW, 30_000)
    assert drive_station.statusword & cia402.SW_SET_POINT_ACKNOWLEDGE
    assert not drive_station.statusword & cia402.SW_TARGET_REACHED

    drive_station.command(cia402.CW_ENABLE, 30_000)
    assert not drive_station.statusword & cia402.SW_SET_POINT_ACKNOWLEDGE
    _until(drive_station, cia402.SW_TARGET_REACHED)

    assert drive_station.position == pytest.approx(30_000, abs=50)
    assert not drive_station.axis.moving
    assert drive_station.axis.angle_deg == pytest.approx(30.0, abs=0.01)


def test_a_target_without_the_rising_edge_moves_nothing(drive_station):
    drive_station.enable()
    drive_station.command(cia402.CW_ENABLE, 30_000)
    drive_station.tick(50)

    assert drive_station.position == 0


def test_a_second_set_point_waits_until_the_first_is_reached(drive_station):
    drive_station.enable()
    drive_station.command(NEW, 5_000)
    drive_station.command(cia402.CW_ENABLE, 5_000)
    drive_station.command(NEW, -5_000)
    drive_station.command(cia402.CW_ENABLE, -5_000)
    assert drive_station.statusword & cia402.SW_SET_POINT_ACKNOWLEDGE, "buffer is full"

    positions = []
    for _ in range(300):
        drive_station.tick()
        positions.append(drive_station.position)

    assert max(positions) == pytest.approx(5_000, abs=50)
    assert positions[-1] == pytest.approx(-5_000, abs=50)
    assert not drive_station.statusword & cia402.SW_SET_POINT_ACKNOWLEDGE


def test_change_immediately_turns_round_at_once(drive_station):
    drive_station.enable()
    drive_station.command(NEW_NOW, 60_000)
    drive_station.command(cia402.CW_ENABLE, 60_000)
    drive_station.tick(20)
    drive_station.command(NEW_NOW, 0)

    drive_station.tick(300)

    assert drive_station.position == pytest.approx(0, abs=50)


def test_halt_stops_and_a_new_set_point_goes_on(drive_station):
    drive_station.enable()
    drive_station.command(NEW_NOW, 60_000)
    drive_station.tick(20)
    drive_station.command(cia402.CW_ENABLE | cia402.CW_HALT, 60_000)
    drive_station.tick(60)
    halted = drive_station.position
    drive_station.tick(20)

    assert 0 < halted < 60_000
    assert drive_station.position == halted


def test_a_target_beyond_the_software_limit_is_held_at_it_and_reported(drive_station):
    drive_station.write(cia402.SOFTWARE_LIMIT, 2, 10_000, 4)
    drive_station.enable()
    drive_station.command(NEW, 30_000)
    drive_station.command(cia402.CW_ENABLE, 30_000)
    drive_station.tick(200)

    assert drive_station.position == pytest.approx(10_000, abs=50)
    assert drive_station.statusword & cia402.SW_INTERNAL_LIMIT
    assert drive_station.emergencies == [cia402.EMCY_SOFTWARE_LIMIT]


def test_profile_velocity_written_by_sdo_is_kept_to(drive_station):
    drive_station.write(cia402.PROFILE_VELOCITY, 0, 5_000, 4)
    drive_station.enable()
    drive_station.command(NEW, 30_000)
    before = drive_station.position
    drive_station.tick(100)

    assert drive_station.position - before == pytest.approx(5_000, rel=0.1)


def test_homing_drives_to_the_index_and_clears_the_offset(make_drive_station):
    station = make_drive_station(start_deg=1.5)
    station.enable()
    assert station.position == 0, "unreferenced: counts from where it woke up"
    station.write(cia402.MODE_OF_OPERATION, 0, Mode.HOMING, 1)
    station.command(NEW)
    assert not station.statusword & cia402.SW_HOMING_ATTAINED
    _until(station, cia402.SW_HOMING_ATTAINED)

    assert station.position == pytest.approx(0, abs=1)
    assert station.axis.angle_deg == pytest.approx(0.0, abs=0.01)
    assert station.statusword & cia402.SW_TARGET_REACHED


def test_homing_at_the_current_position_moves_nothing(make_drive_station):
    station = make_drive_station(start_deg=1.5)
    station.write(cia402.HOMING_METHOD, 0, cia402.HOMING_AT_CURRENT_POSITION, 1)
    station.write(cia402.MODE_OF_OPERATION, 0, Mode.HOMING, 1)
    station.enable()
    station.command(NEW)
    _until(station, cia402.SW_HOMING_ATTAINED, 20)

    assert station.axis.angle_deg == pytest.approx(1.5, abs=0.01)
    assert station.position == 0


def test_bit_12_does_not_survive_a_change_of_mode(drive_station):
    drive_station.enable()
    drive_station.command(NEW, 0)
    _until(drive_station, cia402.SW_TARGET_REACHED)
    assert drive_station.statusword & cia402.SW_SET_POINT_ACKNOWLEDGE

    drive_station.write(cia402.MODE_OF_OPERATION, 0, Mode.HOMING, 1)
    drive_station.tick()

    assert not drive_station.statusword & cia402.SW_HOMING_ATTAINED


def test_the_mode_cannot_change_while_the_axis_moves(drive_station):
    drive_station.enable()
    drive_station.command(NEW, 30_000)

    with pytest.raises(SdoAbort) as refusal:
        drive_station.write(cia402.MODE_OF_OPERATION, 0, Mode.HOMING, 1)

    assert refusal.value.code == 0x08000022


def test_profile_velocity_mode_turns_until_it_is_told_zero(drive_station):
    drive_station.write(cia402.MODE_OF_OPERATION, 0, Mode.PROFILE_VELOCITY, 1)
    drive_station.enable()
    drive_station.write(cia402.TARGET_VELOCITY, 0, -10_000, 4)
    _until(drive_station, cia402.SW_TARGET_REACHED)
    start = drive_station.position
    drive_station.tick(100)
    assert drive_station.position - start == pytest.approx(-10_000, rel=0.02)

    drive_station.write(cia402.TARGET_VELOCITY, 0, 0, 4)
    drive_station.tick(60)
    stood = drive_station.position
    drive_station.tick(20)

    assert drive_station.position == stood


def test_a_stalled_axis_ends_in_fault_with_a_following_error(drive_station):
    drive_station.enable()
    drive_station.axis.stall = 1.0
    drive_station.command(NEW, 30_000)
    _until(drive_station, cia402.SW_FAULT)

    assert drive_station.emergencies == [cia402.EMCY_FOLLOWING_ERROR]
    assert drive_station.statusword & cia402.SW_FOLLOWING_ERROR
    assert drive_station.read(cia402.ERROR_REGISTER) & 0x20
    assert drive_station.read(cia402.ERROR_CODE) & 0xFFFF == cia402.EMCY_FOLLOWING_ERROR


def test_a_fault_is_left_by_the_rising_edge_of_fault_reset_only(drive_station):
    drive_station.enable()
    drive_station.axis.stall = 1.0
    drive_station.command(NEW, 30_000)
    _until(drive_station, cia402.SW_FAULT)
    drive_station.axis.stall = 0.0
    drive_station.command(cia402.CW_ENABLE)
    assert _state(drive_station) is DriveState.FAULT

    drive_station.command(cia402.CW_FAULT_RESET)
    drive_station.tick()

    assert _state(drive_station) is DriveState.SWITCH_ON_DISABLED
    assert drive_station.emergencies[-1] == 0
    assert drive_station.read(cia402.ERROR_REGISTER) == 0


def test_the_axis_moves_again_after_a_fault(drive_station):
    drive_station.enable()
    drive_station.axis.stall = 1.0
    drive_station.command(NEW, 30_000)
    _until(drive_station, cia402.SW_FAULT)
    drive_station.axis.stall = 0.0
    drive_station.command(cia402.CW_FAULT_RESET)
    drive_station.tick(50)
    drive_station.enable()
    drive_station.command(NEW, 10_000)
    _until(drive_station, cia402.SW_TARGET_REACHED)

    assert drive_station.position == pytest.approx(10_000, abs=50)


def test_quick_stop_brakes_and_then_disables(drive_station):
    drive_station.enable()
    drive_station.command(NEW, 60_000)
    drive_station.tick(30)
    drive_station.command(cia402.CW_QUICK_STOP)
    assert _state(drive_station) is DriveState.QUICK_STOP_ACTIVE

    drive_station.tick(100)

    assert _state(drive_station) is DriveState.SWITCH_ON_DISABLED
    assert drive_station.position < 40_000
