from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.tilt import ned_from_body
from bench.calibration.truth_model import (
    base_rotation,
    direction_from_readings,
    field_direction,
    linear_sensor,
    observed,
    rig_poses,
)
from bench.calibration.truth_solver import solved, started, stepped, whitened

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

RNG = np.random.default_rng(7)
ANGLES = np.column_stack([RNG.uniform(0, 360, 40), *RNG.uniform(-40, 40, (2, 40))])


def test_rotations_of_poses_are_the_transposed_ned_from_body() -> None:
    poses = rig_poses(*ANGLES.T)
    assert np.allclose(poses.body_from_rig, ned_from_body(*ANGLES.T).transpose(0, 2, 1))
    vector = np.array([1.0, 2.0, 3.0])
    assert np.linalg.norm(poses.turned(vector), axis=1) == pytest.approx(np.full(40, 14**0.5))


@pytest.mark.parametrize("angle", [0, 1, 2], ids=["azimuth", "pitch", "roll"])
def test_derivative_by_each_rig_angle_is_that_of_differences(angle: int) -> None:
    vector, step_deg = np.array([250.0, 30.0, 433.0]), 1e-4
    change = np.zeros(3)
    change[angle] = step_deg
    high = rig_poses(*(ANGLES + change).T).turned(vector)
    low = rig_poses(*(ANGLES - change).T).turned(vector)
    poses = rig_poses(*ANGLES.T)
    derivative = poses.angle_derivatives(poses.turned(vector))[:, :, angle]
    assert derivative == pytest.approx((high - low) / (2 * np.deg2rad(step_deg)), abs=1e-4)


def test_base_rotation_is_a_rotation_even_at_large_angles() -> None:
    turned = base_rotation(0.7, -0.4)
    assert turned @ turned.T == pytest.approx(np.eye(3))
    assert np.linalg.det(turned) == pytest.approx(1.0)
    assert base_rotation(0.0, 0.0) == pytest.approx(np.eye(3))
    assert base_rotation(np.pi / 2, 0.0) @ [0, 1, 0] == pytest.approx([0, 0, 1])


def test_field_direction_dips_down_and_turns_clockwise() -> None:
    assert field_direction(0.0, np.pi / 3) == pytest.approx([0.5, 0.0, 0.75**0.5])
    assert field_direction(np.pi / 2, 0.0) == pytest.approx([0.0, 1.0, 0.0])


def test_linear_sensor_is_exact_without_noise() -> None:
    gain, offset = RNG.normal(size=(3, 3)), RNG.normal(size=3)
    vectors = RNG.normal(size=(10, 3))
    found = linear_sensor(vectors @ gain.T + offset, vectors)
    assert found[0] == pytest.approx(gain)
    assert found[1] == pytest.approx(offset)


@pytest.mark.parametrize("azimuth_deg", [0.0, 130.0, -77.0])
def test_direction_is_found_from_readings_alone(azimuth_deg: float) -> None:
    direction = field_direction(np.deg2rad(azimuth_deg), np.deg2rad(-35.0))
    poses = rig_poses(*ANGLES.T)
    gain = np.eye(3) + RNG.normal(0, 0.1, (3, 3))
    raw = 480.0 * poses.turned(direction) @ gain.T + [50.0, -90.0, 20.0]
    assert direction_from_readings(raw, poses) == pytest.approx(direction, abs=1e-9)


@pytest.mark.parametrize(
    ("tilts", "magnetometer", "accelerometer"),
    [
        ([(0, 0)], 9, 3),
        ([(0, 0), (30, 0)], 12, 6),
        ([(0, 0), (30, 0), (-30, 0)], 12, 9),
        ([(0, 0), (0, 30), (0, -30)], 12, 9),
        ([(0, 0), (30, 0), (-30, 0), (0, 30), (0, -30)], 12, 12),
    ],
)
def test_rank_by_tilts_is_that_of_theory(
    tilts: list[tuple[float, float]], magnetometer: int, accelerometer: int
) -> None:
    angles = np.array([(h, p, r) for p, r in tilts for h in range(0, 360, 30)], dtype=float)
    poses = rig_poses(*angles.T)
    assert observed(poses.turned(np.array([250.0, 0.0, 433.0])))[0] == magnetometer
    assert observed(poses.turned(np.array([0.0, 0.0, 1.0])))[0] == accelerometer


def test_jacobian_is_that_of_differences(drawn: Callable[..., Any]) -> None:
    data = drawn(1, rig_sd_deg=0.0, azimuth_deg=1.0).data
    poses = rig_poses(data.azimuth_deg, data.pitch_deg, data.roll_deg)
    state = started(poses, replace(data, field_sd_mg=0.35, accel_sd_g=0.0005))
    residual, jacobian = whitened(state, poses, 0.0)
    assert jacobian.shape == (72 * 6, 28)
    for column in range(28):
        step = np.zeros(28)
        step[column] = 1e-6
        change = whitened(stepped(state, step), poses, 0.0)[0] - residual
        expected = -1e-6 * jacobian[:, column]
        assert change == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())


def test_solution_does_not_depend_on_the_station_s_azimuth(drawn: Callable[..., Any]) -> None:
    data = drawn(2, azimuth_deg=0.4).data
    poses = rig_poses(data.azimuth_deg, data.pitch_deg, data.roll_deg)

    def azimuth_rad(station: NDArray[np.float64]) -> float:
        sds = {"field_sd_mg": 0.35, "accel_sd_g": 0.0005}
        start = started(poses, replace(data, station_field_mg=station, **sds))
        return solved(start, poses, 0.02).azimuth_rad

    turned = ned_from_body(25.0, 0.0, 0.0) @ data.station_field_mg
    assert azimuth_rad(turned) == pytest.approx(azimuth_rad(data.station_field_mg), abs=1e-5)
