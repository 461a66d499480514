"""Vehicles of the faults of kind `field`."""

from __future__ import annotations

import pytest

from devices.faults import parse_fault
from devices.field_faults import AISLE_M, MOMENT_NED_AM2, UNLOADING_S, vehicle_of


def test_a_forklift_of_half_the_strength_has_half_the_moment_and_comes_when_it_is_said():
    forklift = vehicle_of(parse_fault("forklift=0.5@1200"))

    assert forklift.moment_ned_am2 == pytest.approx([0.5 * one for one in MOMENT_NED_AM2])
    assert (forklift.starts_s, forklift.stands_s) == (12.0, UNLOADING_S)


def test_what_is_put_down_for_good_stands_in_the_aisle_and_does_not_move():
    rack = vehicle_of(parse_fault("field_step@100"))

    assert rack.moment_ned_am2 == MOMENT_NED_AM2
    assert rack.start_ned_m == (0.0, -AISLE_M, 0.0)
    assert rack.velocity_ned_mps == (0.0, 0.0, 0.0)


def test_a_fault_of_the_unit_puts_nothing_near_the_rig():
    with pytest.raises(ValueError, match="must be of something near the rig"):
        vehicle_of(parse_fault("excess_noise"))
