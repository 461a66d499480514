from __future__ import annotations

import numpy as np
import pytest

from bench.errors import ConfigError, RigFault
from bench.pose import Attitude
from protocols import cia402
from protocols.canopen import emergency_id, sdo_request_id
from protocols.cia402 import DriveState


@pytest.fixture
def rig(station):
    station.rig.connect()
    return station.rig


@pytest.fixture
def homed(rig):
    rig.home()
    return rig


def test_when_connected_then_every_drive_is_identified_enabled_and_watched(rig):
    assert set(rig.identity) == {"azimuth", "pitch", "roll"}
    assert all(drive.state is DriveState.OPERATION_ENABLED for drive in rig.drives)
    assert len({identity["serial"] for identity in rig.identity.values()}) == 3


def test_when_connected_then_the_drives_hold_what_was_written(rig, station):
    for drive in rig.drives:
        for index, subindex, value in drive.setup_objects():
            drive.sdo.start_read(index, subindex)
            station.bus.run_until(drive.sdo.advance, 0.1, "no answer")
            assert drive.sdo.value == value


def test_when_homed_then_all_axes_stand_at_zero(homed):
    attitude = homed.attitude

    angles = [attitude.azimuth_deg, attitude.pitch_deg, attitude.roll_deg]
    np.testing.assert_allclose(angles, 0.0, atol=0.05)


def test_move_to_arrives_on_all_axes_at_once_in_about_the_time_that_is_planned(homed, station):
    target = Attitude(azimuth_deg=90.0, pitch_deg=-20.0, roll_deg=30.0)
    planned_s = homed.travel_time_s(homed.attitude, target)
    start_s = station.bus.now_s
    homed.move_to(target)

    assert station.bus.now_s - start_s == pytest.approx(planned_s, abs=0.15)
    assert homed.attitude.azimuth_deg == pytest.approx(90.0, abs=0.05)
    assert homed.attitude.pitch_deg == pytest.approx(-20.0, abs=0.05)
    assert homed.attitude.roll_deg == pytest.approx(30.0, abs=0.05)
    assert not homed.moving


def test_when_settled_then_the_encoders_stand_still(homed, station):
    homed.move_to(Attitude(azimuth_deg=45.0, pitch_deg=10.0))
    counts = []
    for _ in range(50):
        station.bus.tick()
        counts.append(homed.counts)

    assert np.ptp(np.array(counts), axis=0).max() <= 5


def test_given_a_direction_then_the_azimuth_arrives_from_that_side_and_winds(homed, station):
    homed.move_to(Attitude(azimuth_deg=0.0, pitch_deg=5.0), direction=1)
    passed = []
    station.bus.add_hook(lambda: passed.append(homed.attitude.azimuth_deg))
    homed.move_to(Attitude(azimuth_deg=350.0), direction=1)

    assert homed.attitude.azimuth_deg == pytest.approx(350.0, abs=0.05)
    assert max(passed) == pytest.approx(350.0, abs=0.2)
    homed.move_to(Attitude(azimuth_deg=10.0), direction=-1)
    assert homed.attitude.azimuth_deg == pytest.approx(10.0, abs=0.05)


def test_when_parked_then_unwound_to_zero_and_switched_off(homed, station):
    homed.move_to(Attitude(azimuth_deg=300.0, pitch_deg=20.0), direction=1)
    homed.park()
    station.bus.run_for(0.05)

    assert homed.attitude.azimuth_deg == pytest.approx(0.0, abs=0.05)
    assert all(drive.state is DriveState.SWITCH_ON_DISABLED for drive in homed.drives)


def test_given_a_quick_stop_under_way_then_the_axes_stop_and_can_be_enabled_again(homed, station):
    azimuth = homed.drives[0]
    azimuth.start_move(180.0)
    station.bus.run_for(0.5)
    homed.quick_stop()
    station.bus.run_for(1.0)
    before = homed.attitude.azimuth_deg
    station.bus.run_for(0.2)

    assert 1.0 < before < 170.0
    assert homed.attitude.azimuth_deg == before
    homed.park()
    assert homed.attitude.azimuth_deg == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("axis", ["azimuth", "pitch", "roll"])
def test_given_a_stalled_axis_then_rig_fault_names_it_and_parking_does_not_hang(make_station, axis):
    station = make_station(faults=(f"axis_stalled_{axis}@300",))
    station.rig.connect()
    station.rig.home()
    station.bus.run_until(lambda: station.bus.tick_count >= 300, 10.0, "")

    with pytest.raises(RigFault, match=f"{axis} axis") as error:
        station.rig.move_to(Attitude(azimuth_deg=90.0, pitch_deg=25.0, roll_deg=25.0))
    assert error.value.axis == axis
    start_s = station.bus.now_s
    with pytest.raises(RigFault, match=axis):
        station.rig.park()
    assert station.bus.now_s - start_s < 30.0


def test_given_a_tilt_past_the_limits_then_nothing_moves(homed):
    before = homed.counts
    with pytest.raises(ConfigError, match="pitch"):
        homed.move_to(Attitude(azimuth_deg=0.0, pitch_deg=120.0))

    assert homed.counts == before


def test_given_a_drive_that_refuses_an_object_then_rig_fault_says_which(rig, station):
    with pytest.raises(RigFault, match="6098h.00h: invalid value"):
        rig._write(cia402.HOMING_METHOD, 0, 17)
    with pytest.raises(RigFault, match="does not know object 5FFFh"):
        rig.drives[0].sdo.start_read(0x5FFF)
    station.bus.tick()


def test_given_no_drives_on_the_bus_then_the_error_names_the_node(bus, echo):
    from bench.rig import Rig

    with pytest.raises(RigFault, match=r"azimuth drive \(node 1\) does not answer"):
        Rig(bus).connect()
    requests = [f for f in echo.heard if f.can_id == sdo_request_id(1)]
    assert len(requests) == 3


def test_given_an_emergency_during_a_dwell_then_the_tick_raises_once(homed, station):
    port = station.wire.attach()
    port.send(emergency_id(2), (0x3210).to_bytes(2, "little") + bytes(6))

    with pytest.raises(RigFault, match="pitch drive reports 3210h"):
        station.bus.tick()
    station.bus.run_for(0.1)


def test_given_a_silent_bench_then_the_drives_stop_by_themselves(homed, station):
    homed.drives[0].start_move(300.0)
    station.bus.run_for(0.3)
    host = station.host
    for _ in range(200):  # the bench is dead: no SYNC, no heartbeat; the devices go on
        host._advance()
        for tick, _sync, send in host._turns:
            tick(host.now_ns, 0, send)
    stopped = host._nodes[0].profile

    assert stopped.state is not DriveState.OPERATION_ENABLED
