from __future__ import annotations

import math

import numpy as np
import pytest

from bench.errors import ConfigError
from bench.recording_units import STANDARD_GRAVITY_MPS2, accel_scale_g, attitude_deg, axis_map

UP_TO_DOWN = "x,-y,-z"
HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("quaternion", "heading_pitch_roll"),
    [
        # Sensor with z up. Unturned, its x axis points east.
        ((1.0, 0.0, 0.0, 0.0), (90.0, 0.0, 0.0)),
        # A quarter turn counter-clockwise seen from above: x axis to north.
        ((HALF, 0.0, 0.0, HALF), (0.0, 0.0, 0.0)),
        # A quarter turn clockwise: x axis to south; the sign of a quaternion does not matter.
        ((-HALF, 0.0, 0.0, HALF), (180.0, 0.0, 0.0)),
        # About the sensor's y axis (to the left of x) by -30 deg: nose up.
        ((math.cos(math.radians(15)), 0.0, -math.sin(math.radians(15)), 0.0), (90.0, 30.0, 0.0)),
        # About its x axis by +20 deg: left side up, right side down.
        ((math.cos(math.radians(10)), math.sin(math.radians(10)), 0.0, 0.0), (90.0, 0.0, 20.0)),
    ],
)
def test_attitude_of_a_sensor_with_z_up(
    quaternion: tuple[float, ...], heading_pitch_roll: tuple[float, ...]
) -> None:
    angles_deg = attitude_deg(np.array([quaternion]), axis_map(UP_TO_DOWN))

    assert np.allclose(angles_deg, [heading_pitch_roll], atol=1e-9)


def test_attitude_rebuilds_the_rotation(rng: np.random.Generator) -> None:
    quaternions = rng.normal(size=(50, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    vector_sensor = np.array([0.3, -0.5, 0.8])

    heading, pitch, roll = np.radians(attitude_deg(quaternions, axis_map(UP_TO_DOWN))).T

    for i, (w, x, y, z) in enumerate(quaternions):
        axis = np.array([x, y, z])
        # Rodrigues' form, unlike the matrix of the product.
        enu = (
            vector_sensor
            + 2.0 * w * np.cross(axis, vector_sensor)
            + 2.0 * np.cross(axis, np.cross(axis, vector_sensor))
        )
        body = axis_map(UP_TO_DOWN) @ vector_sensor
        about_x = _turn(0, roll[i]) @ body
        ned = _turn(2, heading[i]) @ _turn(1, pitch[i]) @ about_x
        assert np.allclose(ned, [enu[1], enu[0], -enu[2]], atol=1e-9)


def _turn(axis: int, angle_rad: float) -> np.ndarray:
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    turn = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn[first, first] = turn[second, second] = cosine
    turn[first, second], turn[second, first] = -sine, sine
    return turn


def test_a_quaternion_that_is_no_rotation_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"must have length 1; instead received 2.0000 in row 1"):
        attitude_deg(np.array([[1.0, 0, 0, 0], [2.0, 0, 0, 0]]), axis_map("x,y,z"))


def test_mirrored_axes_have_no_attitude() -> None:
    with pytest.raises(ConfigError, match="right-handed"):
        attitude_deg(np.array([[1.0, 0, 0, 0]]), axis_map("x,y,-z"))


def test_an_axis_map_turns_vectors_from_sensor_to_body() -> None:
    assert (axis_map("-y,x,+z") @ [1.0, 2.0, 3.0]).tolist() == [-2.0, 1.0, 3.0]


@pytest.mark.parametrize("text", ["x,y", "x,x,z", "x,y,w", "", "--x,y,z", "x y z"])
def test_a_malformed_axis_map_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="must name x, y and z once"):
        axis_map(text)


def test_metres_per_second_squared_are_standard_gravities() -> None:
    assert accel_scale_g("m/s2") * STANDARD_GRAVITY_MPS2 == pytest.approx(1.0)
    assert accel_scale_g("counts", 1.0 / 4096.0) == 2.0**-12
