from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.tilt import (
    attitude_deg,
    heading_deg,
    ned_from_body,
    tilt_compensated_heading_deg,
)

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
