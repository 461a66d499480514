"""The seat in the world: where the unit's axes point, and what the fixture's iron adds."""

from __future__ import annotations

import numpy as np
import pytest

from devices.faults import parse_fault
from devices.field import EarthField
from devices.rig import draw_rig, perfect_rig
from devices.seat import SEAT_FROM_UNIT, Seat
from devices.simulator import FIXTURE_IRON_MG, TURNED_DEG, SimulatorOptions, build_world, worse_seat
from devices.world import World

NORTH_DOWN = (250.0, 0.0, 250.0 * np.tan(np.pi / 3.0))


def seen(seat, rig=None):
    world = World(EarthField(), rig or perfect_rig(), seat=seat)
    return np.array(world.field_body_mg()), np.array(world.force_body_g())


def test_a_square_seat_changes_no_bit_of_what_the_unit_is_in():
    plain = World(EarthField(), draw_rig(4))
    square = World(EarthField(), draw_rig(4), seat=Seat())
    for tick in range(1, 50):
        for world in (plain, square):
            world.rig.azimuth.command(30.0)
            world.step(tick * 10_000_000)
        assert square.field_body_mg() == plain.field_body_mg()
        assert square.force_body_g() == plain.force_body_g()


@pytest.mark.parametrize(
    ("mounting", "field", "force"),
    [
        (0, (1.0, 1.0, 1.0), -1.0),
        (1, (-1.0, -1.0, 1.0), -1.0),
        (2, (1.0, -1.0, -1.0), 1.0),
    ],
)
def test_a_remounted_unit_sees_the_field_from_its_other_side(mounting, field, force):
    field_mg, force_g = seen(Seat(mounting=mounting))

    assert field_mg == pytest.approx(np.array(NORTH_DOWN) * field)
    assert force_g == pytest.approx([0.0, 0.0, force])


def test_a_seat_turned_clockwise_sees_north_to_its_left():
    field_mg, _ = seen(Seat(index_deg=30.0))

    assert np.rad2deg(np.arctan2(-field_mg[1], field_mg[0])) == pytest.approx(30.0)


def test_a_seat_with_its_nose_up_feels_itself_so():
    _, force_g = seen(Seat(pitch_deg=10.0))

    assert force_g == pytest.approx([np.sin(np.deg2rad(10.0)), 0.0, -np.cos(np.deg2rad(10.0))])


@pytest.mark.parametrize("mounting", range(3))
def test_iron_stays_with_the_seat_when_the_unit_is_turned(mounting):
    without, _ = seen(Seat(mounting=mounting))
    with_iron, _ = seen(Seat(mounting=mounting, iron_mg=(1.0, 2.0, 3.0)))

    turn = np.reshape(SEAT_FROM_UNIT[mounting], (3, 3))
    assert with_iron - without == pytest.approx(turn.T @ [1.0, 2.0, 3.0])


def test_a_unit_that_does_not_sit_square_turns_about_its_own_axes():
    square, _ = seen(Seat(mounting=2))
    turned, _ = seen(Seat(mounting=2, seating_deg=(0.0, 0.0, 0.1)))

    assert turned - square == pytest.approx(np.cross(square, [0.0, 0.0, np.deg2rad(0.1)]), abs=1e-3)


def test_the_faults_of_the_seat_scale_with_their_strength():
    turned = worse_seat(Seat(index_deg=0.1), parse_fault("seat_turned=0.5"))
    iron = worse_seat(Seat(iron_mg=(1.0, 0.0, 0.0)), parse_fault("fixture_iron"))

    assert turned.index_deg == pytest.approx(0.1 + 0.5 * TURNED_DEG)
    assert iron.iron_mg == pytest.approx(np.array(FIXTURE_IRON_MG) + [1.0, 0.0, 0.0])
    assert worse_seat(Seat(), parse_fault("seat_turned=0")).square


def test_the_options_seat_is_the_worlds():
    seat = Seat(index_deg=0.25, iron_mg=(0.5, 0.0, 0.0))

    assert build_world(SimulatorOptions(seat=seat)).seat == seat


@pytest.mark.parametrize("sd_deg", [-0.1, float("nan"), 2.0])
def test_a_seating_that_cannot_be_is_refused(sd_deg):
    with pytest.raises(ValueError, match="seating_sd_deg must be within 0 and 1 deg"):
        SimulatorOptions(seating_sd_deg=sd_deg)
