"""The rig: drawn within its specification, its three axes and its faults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from devices.faults import parse_fault
from devices.rig import RigGeometry, RigMechanics, draw_rig, perfect_rig
from devices.rotation import apply, ned_from_body, product, transpose

DT_S = 0.01


def settle(rig: RigMechanics) -> float:
    for step in range(3000):
        if not any(axis.moving for axis in rig.axes):
            return step * DT_S
        rig.step(DT_S)
    pytest.fail("the rig did not come to rest")


def angle_between_deg(rig: RigMechanics, *angles_deg: float) -> float:
    """Return the angle of the rotation between the rig's seat and an attitude."""
    matrix = product(transpose(ned_from_body(*angles_deg)), rig.ned_from_body())
    return math.degrees(math.acos(min(1.0, (matrix[0] + matrix[4] + matrix[8] - 1.0) / 2.0)))


def test_perfect_rig_is_the_product_of_its_axes() -> None:
    rig = perfect_rig()
    for axis, angle_deg in zip(rig.axes, (200.0, -30.0, 30.0), strict=True):
        axis.command(angle_deg)
    settle(rig)

    assert rig.attitude_deg == pytest.approx((200.0, -30.0, 30.0))
    assert rig.ned_from_body() == pytest.approx(ned_from_body(200.0, -30.0, 30.0))


def test_axes_move_at_the_same_time() -> None:
    rig = perfect_rig()
    rig.azimuth.command(90.0)
    alone_s = settle(rig)
    rig.azimuth.command(180.0)
    rig.pitch.command(15.0)
    rig.roll.command(-15.0)

    assert settle(rig) == pytest.approx(alone_s, abs=0.3)


def test_drawn_rig_is_reproducible_and_differs_by_seed() -> None:
    assert draw_rig(3).geometry == draw_rig(3).geometry
    assert draw_rig(3).geometry != draw_rig(4).geometry
    assert draw_rig(3).attitude_deg == draw_rig(3).attitude_deg


def test_drawn_rig_wakes_up_off_its_index() -> None:
    starts_deg = np.array(
        [[axis.encoder_deg for axis in draw_rig(seed).axes] for seed in range(30)]
    )

    assert np.abs(starts_deg).max() <= 2.0
    assert np.median(np.abs(starts_deg)) > 0.3


def test_drawn_rig_holds_its_attitude_to_a_tenth_of_a_degree() -> None:
    errors_deg = []
    for seed in range(20):
        rig = draw_rig(seed)
        for axis, angle_deg in zip(rig.axes, (105.0, 30.0, 0.0), strict=True):
            axis.command(angle_deg)
        settle(rig)
        errors_deg.append(angle_between_deg(rig, 105.0, 30.0, 0.0))

    assert 0.02 < np.median(errors_deg) < 0.06
    assert max(errors_deg) < 0.15


@pytest.mark.parametrize(
    ("geometry", "angles_deg", "size_deg"),
    [
        (RigGeometry(base_level_north_deg=0.5), (40.0, 0.0, 0.0), 0.5),
        (RigGeometry(base_level_east_deg=0.5), (40.0, 20.0, 0.0), 0.5),
        (RigGeometry(azimuth_pitch_squareness_deg=0.5), (0.0, 0.0, 0.0), 0.0),
        (RigGeometry(pitch_roll_squareness_deg=0.5), (10.0, 20.0, 0.0), 0.0),
        (RigGeometry(pitch_roll_squareness_deg=0.5), (0.0, 0.0, 60.0), 0.5),
        (RigGeometry(wobble_deg=0.5), (77.0, 0.0, 0.0), 0.5),
    ],
)
def test_imperfections_have_their_size(
    geometry: RigGeometry, angles_deg: tuple[float, float, float], size_deg: float
) -> None:
    rig = RigMechanics(perfect_rig().axes, geometry)
    for axis, angle_deg in zip(rig.axes, angles_deg, strict=True):
        axis.command(angle_deg)
    settle(rig)

    assert angle_between_deg(rig, *angles_deg) == pytest.approx(size_deg, abs=0.02)


def test_base_tilt_stays_in_the_room_and_wobble_turns_with_the_table() -> None:
    base = RigMechanics(perfect_rig().axes, RigGeometry(base_level_east_deg=1.0))
    wobble = RigMechanics(perfect_rig().axes, RigGeometry(wobble_deg=1.0))
    normals = []
    for rig in (base, wobble):
        for angle_deg in (0.0, 180.0):
            rig.azimuth.command(angle_deg)
            settle(rig)
            normals.append(apply(rig.ned_from_body(), (0.0, 0.0, 1.0)))

    assert normals[0] == pytest.approx(normals[1], abs=1e-9)
    assert normals[2][1] == pytest.approx(-normals[3][1], abs=1e-9)


def test_matrix_is_kept_while_nothing_moves() -> None:
    rig = draw_rig(1)
    before = rig.ned_from_body()
    rig.step(DT_S)

    assert rig.ned_from_body() is before


@pytest.mark.parametrize("name", ["azimuth", "pitch", "roll"])
def test_stalled_axis_is_that_of_the_fault(name: str) -> None:
    rig = perfect_rig()

    assert rig.apply(parse_fault(f"axis_stalled_{name}=0.5"))
    assert [axis.stall for axis in rig.axes] == [0.5 * (axis.name == name) for axis in rig.axes]


def test_faults_of_others_are_left_to_them() -> None:
    assert not perfect_rig().apply(parse_fault("stuck_axis_x"))
