"""The virtual operator: remounts on a level rig, refuses on a tilted one, never speaks unasked."""

from __future__ import annotations

import pytest

from devices.operator import REMOUNT_NS
from devices.seat import Seat
from protocols.remounting import (
    REMOUNT_DONE_ID,
    REMOUNT_ID,
    MountCode,
    RemountResult,
    pack_remount,
    unpack_remount_done,
)
from protocols.sync import TICK_NS

TICKS = REMOUNT_NS // TICK_NS


def world_of(station):
    return station.host._world  # noqa: SLF001  (the truth of the simulator)


def answers(frames):
    return [unpack_remount_done(f.data) for f in frames if f.can_id == REMOUNT_DONE_ID]


@pytest.mark.parametrize("code", MountCode)
def test_the_unit_sits_as_asked_when_the_operator_says_so(make_station, code):
    station = make_station(seed=5)
    station.send(REMOUNT_ID, pack_remount(code))

    early = station.tick(TICKS - 1)
    assert answers(early) == []
    assert world_of(station).seat == Seat()

    assert answers(station.tick(2)) == [(code, RemountResult.DONE)]
    seat = world_of(station).seat
    assert seat.mounting == code
    assert 0.0 < max(abs(turn_deg) for turn_deg in seat.seating_deg) < 0.06


def test_one_seed_seats_the_unit_alike_and_another_does_not(make_station):
    turns = []
    for seed in (5, 5, 6):
        station = make_station(seed=seed)
        station.send(REMOUNT_ID, pack_remount(MountCode.TURNED))
        station.tick(TICKS + 1)
        turns.append(world_of(station).seat.seating_deg)

    assert turns[0] == turns[1] != turns[2]


def test_a_tilted_rig_is_not_touched(make_station):
    station = make_station(seed=5)
    world_of(station).rig.pitch.command(30.0)
    station.tick(300)
    station.send(REMOUNT_ID, pack_remount(MountCode.TURNED))

    assert answers(station.tick(2)) == [(MountCode.TURNED, RemountResult.RIG_NOT_LEVEL)]
    station.tick(TICKS)
    assert world_of(station).seat == Seat()


@pytest.mark.parametrize("data", [b"", b"\x01", b"\x07" + bytes(7), bytes(7)])
def test_a_wish_that_cannot_be_read_is_not_obeyed(make_station, data):
    station = make_station(seed=5)
    station.send(REMOUNT_ID, data)

    assert answers(station.tick(TICKS + 2)) == []
    assert world_of(station).seat == Seat()
