from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.tilt import (
    attitude_deg,
    caruso_heading_deg,
    cho_park_azimuth_deg,
    heading_deg,
    ned_from_body,
    tilt_compensated_heading_deg,
    two_axis_attitude_deg,
)
from bench.calibration.two_axis import estimated_z_mg
from protocols.angles import wrap_180_deg

LEVEL_FORCE = np.array([0.0, 0.0, -1.0])


def test_rotation_turns_body_axes_to_the_hand_computed_directions() -> None:
    assert ned_from_body(0, 30, 0) @ [1, 0, 0] == pytest.approx([0.75**0.5, 0, -0.5])
    assert ned_from_body(0, 0, 30) @ [0, 1, 0] == pytest.approx([0, 0.75**0.5, 0.5])
    assert ned_from_body(90, 0, 90) @ [0, 1, 0] == pytest.approx([0, 0, 1])


def test_given_many_attitudes_when_rotated_then_matrices_are_proper_rotations() -> None:
    angles = np.random.default_rng(1).uniform(-180, 180, (3, 200))
    rotations = ned_from_body(*angles)
    assert np.allclose(rotations @ rotations.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(np.linalg.det(rotations), 1.0)


@pytest.mark.parametrize("roll_deg", [-170.0, -100.0, -30.0, 0.0, 100.0, 180.0])
@pytest.mark.parametrize("pitch_deg", [-80.0, -30.0, 0.0, 45.0])
def test_attitude_and_heading_are_recovered_at_any_roll(pitch_deg: float, roll_deg: float) -> None:
    azimuth_deg = np.arange(0.0, 360.0, 7.5)
    body_from_ned = ned_from_body(azimuth_deg, pitch_deg, roll_deg).transpose(0, 2, 1)
    force = body_from_ned @ LEVEL_FORCE
    field = body_from_ned @ [250.0, 0.0, 433.0]
    pitch, roll = attitude_deg(force)
    assert pitch == pytest.approx(np.full(48, pitch_deg))
    assert np.mod(roll - roll_deg + 1.0, 360.0) == pytest.approx(np.ones(48))
    turned = np.mod(tilt_compensated_heading_deg(field, force) - azimuth_deg + 180.0, 360.0)
    assert turned == pytest.approx(np.full(48, 180.0))


def test_headings_of_the_four_quarters_wrap_into_0_to_360() -> None:
    fields = np.array([[1, 0, 2], [0, -1, 2], [-1, 0, 2], [0, 1, 2]], dtype=float)
    assert heading_deg(fields, 0.0, 0.0) == pytest.approx([0, 90, 180, 270])
    assert heading_deg([250.0, 1e-14, 433.0], 0.0, 0.0) < 360.0


def test_one_vector_and_a_batch_of_any_shape_agree() -> None:
    rng = np.random.default_rng(2)
    field, force = rng.normal(size=(2, 3, 4, 3))
    batch = tilt_compensated_heading_deg(field, force)
    assert batch.shape == (3, 4)
    assert batch[1, 2] == tilt_compensated_heading_deg(field[1, 2], force[1, 2])


def test_length_of_force_and_field_does_not_matter() -> None:
    field, force = np.array([100.0, -50.0, 400.0]), np.array([0.2, -0.3, -0.9])
    one = tilt_compensated_heading_deg(field, force)
    assert tilt_compensated_heading_deg(3.0 * field, 0.5 * force) == pytest.approx(one)


def drawn_attitudes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    azimuth_deg, roll_deg = rng.uniform(-180.0, 180.0, (2, 400))
    return azimuth_deg, rng.uniform(-85.0, 85.0, 400), roll_deg


def test_caruso_s_left_handed_frame_gives_the_product_s_heading() -> None:
    """His theta is roll, his phi pitch, his z up."""
    azimuth_deg, pitch_deg, roll_deg = drawn_attitudes()
    rotations = ned_from_body(azimuth_deg, pitch_deg, roll_deg)
    X, Y, Z = (rotations.transpose(0, 2, 1) @ [250.0, 0.0, 433.0]).T
    ours = heading_deg(np.column_stack([X, Y, Z]), pitch_deg, roll_deg)
    theirs = caruso_heading_deg(X, Y, -Z, theta_deg=roll_deg, phi_deg=pitch_deg)
    assert wrap_180_deg(theirs - ours) == pytest.approx(np.zeros(400), abs=1e-9)
    tilts_negated = caruso_heading_deg(X, Y, Z, theta_deg=-roll_deg, phi_deg=-pitch_deg)
    assert wrap_180_deg(tilts_negated - ours) == pytest.approx(np.zeros(400), abs=1e-9)


def test_negating_caruso_s_z_and_both_tilts_turns_the_heading_round() -> None:
    headings = np.arange(0.0, 360.0, 0.25)
    field = ned_from_body(headings, 30.0, -25.0).transpose(0, 2, 1) @ [250.0, 0.0, 433.0]
    X, Y, Z = field.T
    both = caruso_heading_deg(X, Y, -Z, theta_deg=25.0, phi_deg=-30.0)
    neither = caruso_heading_deg(X, Y, Z, theta_deg=-25.0, phi_deg=30.0)
    assert np.abs(wrap_180_deg(both - headings)).max() == pytest.approx(179.8, abs=0.2)
    assert np.abs(wrap_180_deg(neither - headings)).max() == pytest.approx(179.8, abs=0.2)


@pytest.mark.parametrize("east_deg", [0.0, -9.0, 4.0])
def test_cho_and_park_s_true_azimuth_counts_declination_west(east_deg: float) -> None:
    azimuth_deg, pitch_deg, _ = drawn_attitudes()
    roll_deg = np.random.default_rng(5).uniform(-80.0, 80.0, 400)
    rotations = ned_from_body(azimuth_deg, pitch_deg, roll_deg)
    dip = np.deg2rad(48.72)
    X, Y, Z = (rotations.transpose(0, 2, 1) @ [np.cos(dip), 0.0, np.sin(dip)]).T
    force = rotations.transpose(0, 2, 1) @ LEVEL_FORCE
    theta_deg, phi_deg = two_axis_attitude_deg(force[:, :2])
    estimated = estimated_z_mg(
        np.column_stack([X, Y]), theta_deg, phi_deg, horizontal_mg=np.cos(dip), dip_deg=48.72
    )
    assert estimated == pytest.approx(Z, abs=1e-9)
    true_deg = cho_park_azimuth_deg(X, Y, estimated, theta_deg, phi_deg, gamma_deg=-east_deg)
    ours = heading_deg(np.column_stack([X, Y, Z]), pitch_deg, roll_deg) + east_deg
    assert wrap_180_deg(true_deg - ours) == pytest.approx(np.zeros(400), abs=1e-7)


def test_two_axes_of_force_see_the_attitude_below_90_degrees() -> None:
    force = ned_from_body(0.0, 35.0, -50.0).T @ LEVEL_FORCE
    assert two_axis_attitude_deg(force[:2]) == pytest.approx((35.0, -50.0))
    folded = ned_from_body(0.0, 0.0, 100.0).T @ LEVEL_FORCE
    assert two_axis_attitude_deg(folded)[1] == pytest.approx(80.0)
    assert two_axis_attitude_deg([1.3, 0.4]) == pytest.approx((90.0, -90.0))
