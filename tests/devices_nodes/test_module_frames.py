"""What the module sends by itself: boot, cyclic frames, E2E, address claim, faults."""

from __future__ import annotations

import pytest

from protocols import compass, j1939
from protocols.e2e import E2eReceiver, E2eState
from protocols.link import Wire
from protocols.reference_field import REFERENCE_ADDRESS, reference_field_id

CYCLIC = [compass.mag_set_id, compass.mag_reset_id, compass.acceleration_id, compass.heading_id]
CLAIM = j1939.address_claimed_id(0x80)


def ids(frames):
    return [frame.can_id for frame in frames]


def of_module(frames, address=0x80):
    """Leave out the rig and the reference magnetometer."""
    return [f for f in frames if f.can_id & 0x80000000 and f.can_id & 0xFF == address]


def of(frames, can_id):
    return [frame.data for frame in frames if frame.can_id == can_id]


def test_is_silent_while_it_boots_then_claims_its_address_first(make_station):
    station = make_station()
    silent = of_module(station.tick(29))
    first = of_module(station.tick(1))

    assert silent == []
    assert first[0].can_id == CLAIM
    assert first[0].data == j1939.pack_name("SN0001")


def test_every_tick_carries_the_four_frames_of_one_cycle_in_order(booted):
    for _ in range(20):
        frames = booted.tick()
        cycle = [f for f in frames if f.can_id in {make(0x80) for make in CYCLIC}]

        assert ids(cycle) == [make(0x80) for make in CYCLIC]
        assert {compass.group_of(f.data) for f in cycle} == {booted.ticks % 240 & 15}


@pytest.mark.parametrize("make_id", CYCLIC)
def test_the_receiver_of_end_to_end_protection_finds_every_frame_sound(booted, make_id):
    receiver = E2eReceiver(compass.data_id(make_id(0x80)))
    states = {receiver.check(data) for data in of(booted.tick(100), make_id(0x80))}

    assert states == {E2eState.OK}


def test_status_and_bearing_come_ten_times_a_second(booted):
    frames = booted.tick(100)

    assert len(of(frames, compass.status_id(0x80))) == 10
    assert len(of(frames, compass.vehicle_direction_id(0x80))) == 10


def test_the_status_of_an_uncalibrated_module_says_so(booted):
    status = compass.unpack_status(of(booted.tick(10), compass.status_id(0x80))[0])

    assert status.flags == compass.FLAG_DEFAULT_COEFFICIENTS
    assert status.boots == 1
    assert status.dtc_count == 0
    assert 4.8 < status.supply_v < 5.2


def test_the_bearing_for_other_tools_is_the_own_heading(booted):
    frames = booted.tick(10)
    bearing = int.from_bytes(of(frames, compass.vehicle_direction_id(0x80))[0][:2], "little") / 128
    headings = [
        compass.unpack_heading(data).heading * compass.HEADING_DEG_PER_COUNT
        for data in of(frames, compass.heading_id(0x80))
    ]

    assert min(abs((bearing - h + 180) % 360 - 180) for h in headings) < 0.01


@pytest.mark.parametrize("destination", [0x80, j1939.GLOBAL_ADDRESS])
def test_answers_a_request_for_its_name(booted, destination):
    booted.send(j1939.request_id(destination), j1939.pack_request(j1939.PGN_ADDRESS_CLAIMED))

    assert of(booted.tick(), CLAIM) == [j1939.pack_name("SN0001")]


def test_a_request_to_another_address_is_not_answered(booted):
    booted.send(j1939.request_id(0x81), j1939.pack_request(j1939.PGN_ADDRESS_CLAIMED))

    assert of(booted.tick(), CLAIM) == []


def test_of_two_modules_on_one_address_the_higher_name_falls_silent(make_station):
    wire = Wire()
    one = make_station(wire, serial="SN0001")
    other = make_station(wire, serial="SN0002")
    frames = []
    for _ in range(60):
        wire.now_ns += 10_000_000
        one.port.send(0x080, b"\x01")
        while (frame := one.port.poll()) is not None:
            frames.append(frame)
    names = set(of(frames, CLAIM))
    lower = min(names, key=lambda name: int.from_bytes(name, "little"))
    higher = max(names, key=lambda name: int.from_bytes(name, "little"))

    assert names == {j1939.pack_name("SN0001"), j1939.pack_name("SN0002")}
    assert of(frames, j1939.address_claimed_id(j1939.NULL_ADDRESS)) == [higher]
    assert of(frames, CLAIM)[-1] == lower
    assert other.host.tick_count == one.host.tick_count == 60


def test_another_address_moves_every_frame(make_station):
    station = make_station(address=0x42)
    station.tick(40)

    frames = station.tick(10)
    sources = {f.can_id & 0xFF for f in frames if f.can_id & 0x80000000}

    assert sources == {0x42, REFERENCE_ADDRESS}
    assert {f.can_id for f in of_module(frames, REFERENCE_ADDRESS)} == {
        reference_field_id(REFERENCE_ADDRESS)
    }


def test_a_silent_module_neither_sends_nor_answers(make_station):
    station = make_station(faults=("module_silent@50",))
    before = station.tick(49)
    after = station.tick(20)

    assert of(before, compass.mag_set_id(0x80))
    assert of_module(after) == []
    assert station.request(b"\x3e\x00", ticks=30) == b""


def test_a_negligible_silence_misses_no_frame(make_station):
    station = make_station(faults=("module_silent=0.001@50",))
    station.tick(40)

    assert len(of(station.tick(100), compass.mag_set_id(0x80))) == 100


def test_a_short_silence_ends(make_station):
    station = make_station(faults=("module_silent=0.1@50",))
    station.tick(40)

    assert len(of(station.tick(100), compass.mag_set_id(0x80))) == 50
