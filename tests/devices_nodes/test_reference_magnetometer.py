"""The reference magnetometer as a node: boot, claim, field, and what comes near it."""

from __future__ import annotations

import numpy as np
import pytest

from devices.faults import parse_fault
from devices.field import EarthField
from devices.field_faults import AISLE_M, vehicle_of
from devices.reference_magnetometer import NOISE_MG, PLACE_NED_M, ReferenceMagnetometer
from devices.world import Forklift, World
from protocols import compass, j1939
from protocols.e2e import E2eReceiver, E2eState
from protocols.reference_field import (
    REFERENCE_ADDRESS,
    REFERENCE_MG_PER_COUNT,
    reference_field_id,
)

FIELD = reference_field_id(REFERENCE_ADDRESS)
CLAIM = j1939.address_claimed_id(REFERENCE_ADDRESS)


def readings_mg(frames, can_id=FIELD):
    counts = [compass.unpack_counts(f.data) for f in frames if f.can_id == can_id]
    return np.array(counts, dtype=float) * REFERENCE_MG_PER_COUNT


def parked_mg(strength):
    """Largest change on any axis where the reference stands, of what is put down in the aisle."""
    rack = vehicle_of(parse_fault(f"field_step={strength}"))
    return np.abs(rack.field_ned_mg(0.0, PLACE_NED_M)).max()


def of_node(frames):
    return [f for f in frames if f.can_id & 0x80000000 and f.can_id & 0xFF == REFERENCE_ADDRESS]


def test_it_claims_its_address_when_it_has_booted_and_again_when_asked(make_station):
    station = make_station()
    assert of_node(station.tick(19)) == []
    assert [f.can_id for f in of_node(station.tick(1))] == [CLAIM, FIELD]

    request = j1939.pack_request(j1939.PGN_ADDRESS_CLAIMED)
    station.send(j1939.request_id(REFERENCE_ADDRESS), request)
    assert [f.can_id for f in of_node(station.tick(2))] == [CLAIM, FIELD, FIELD]
    station.send(j1939.request_id(j1939.GLOBAL_ADDRESS), request)
    assert CLAIM in {f.can_id for f in station.tick(1)}


def test_it_sends_a_sound_frame_every_tick_after_those_of_the_module(booted):
    receiver = E2eReceiver(compass.data_id(FIELD))
    for _ in range(40):
        frames = booted.tick()
        (own,) = of_node(frames)

        assert frames[-1] is own
        assert receiver.check(own.data) is E2eState.OK
        assert compass.group_of(own.data) == booted.ticks % 240 & 15


def test_no_other_node_is_changed_by_it(make_station):
    with_it, without = make_station(seed=5), make_station(seed=5, reference_address=None)
    frames = [
        [(f.can_id, f.data) for f in station.tick(200) if f not in of_node([f])]
        for station in (with_it, without)
    ]

    assert frames[0] == frames[1]
    assert of_node(without.tick(50)) == []


def test_its_noise_is_that_of_a_fluxgate_and_its_axes_are_nearly_those_of_the_site(booted):
    field_mg = readings_mg(booted.tick(900))
    noise_mg = field_mg[:90].std(axis=0, ddof=1)
    quantised_mg = np.hypot(NOISE_MG, REFERENCE_MG_PER_COUNT / np.sqrt(12.0))

    assert noise_mg == pytest.approx([quantised_mg] * 3, rel=0.4)
    assert field_mg.mean(axis=0) == pytest.approx((250.0, 0.0, 433.0), abs=30.0)
    assert np.linalg.norm(field_mg.mean(axis=0)) == pytest.approx(500.0, abs=3.0)


def test_it_does_not_feel_the_rig_turn(booted):
    still_mg = readings_mg(booted.tick(50)).mean(axis=0)
    booted.host._world.rig.azimuth.angle_deg = 90.0  # the mechanics alone, no drive

    assert readings_mg(booted.tick(50)).mean(axis=0) == pytest.approx(still_mg, abs=0.05)


def test_it_feels_a_vehicle_as_the_dipole_is_at_its_own_place():
    vehicle = Forklift(start_ned_m=(0.0, -AISLE_M, 0.0), velocity_ned_mps=(0.0, 0.0, 0.0))
    world = World(EarthField(), None)
    node = ReferenceMagnetometer(world, np.random.default_rng(3))
    before_mg = np.mean([node.field_mg() for _ in range(400)], axis=0)

    world.drive_up(vehicle)

    after_mg = np.mean([node.field_mg() for _ in range(400)], axis=0)
    there_m = AISLE_M + PLACE_NED_M[1]
    assert np.linalg.norm(after_mg - before_mg) == pytest.approx(300.0 / there_m**3, abs=0.01)
    assert np.linalg.norm(np.subtract(world.field_ned_mg, EarthField().ned_mg)) == pytest.approx(
        300.0 / AISLE_M**3
    )


def test_a_forklift_comes_stands_and_leaves(make_station):
    station = make_station(faults=("forklift@100",), drift=False)
    still_mg = readings_mg(station.tick(99))[-20:].mean(axis=0)
    change_mg = np.abs(readings_mg(station.tick(5000)) - still_mg).max(axis=1)
    standing = change_mg[1333:3333]

    assert standing.mean() == pytest.approx(parked_mg(1.0), abs=0.1)
    assert np.ptp(standing) < 0.3
    assert change_mg[:200].max() < 0.3
    assert change_mg[-200:].max() < 0.3


def test_what_is_put_down_stays(make_station):
    station = make_station(faults=("field_step=0.5@100",), drift=False)
    still_mg = readings_mg(station.tick(99))[-20:].mean(axis=0)
    change_mg = np.abs(readings_mg(station.tick(2000)) - still_mg).max(axis=1)

    assert change_mg.mean() == pytest.approx(parked_mg(0.5), abs=0.1)


def test_a_silent_node_neither_sends_nor_answers(make_station):
    station = make_station(faults=("reference_silent@50",))
    assert readings_mg(station.tick(49)).size
    station.send(j1939.request_id(REFERENCE_ADDRESS), j1939.pack_request(j1939.PGN_ADDRESS_CLAIMED))

    assert of_node(station.tick(100)) == []


def test_a_negligible_silence_misses_no_frame(make_station):
    station = make_station(faults=("reference_silent=0.001@50",))
    station.tick(40)

    assert len(readings_mg(station.tick(100))) == 100


def test_module_and_reference_cannot_have_one_address(make_station):
    with pytest.raises(ValueError, match="must not be the module's address"):
        make_station(address=0x90)


def test_only_what_comes_near_is_a_vehicle():
    with pytest.raises(ValueError, match="instead received lost_write"):
        vehicle_of(parse_fault("lost_write"))
