"""Generalised least squares of the rig's model: Gauss-Newton with the rig angles' uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.prediction import DOWN
from bench.calibration.truth_model import (
    RigPoses,
    base_rotation,
    direction_from_readings,
    field_direction,
    linear_sensor,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData

ITERATIONS: Final = 25
EAST_NORTH: Final = np.eye(3)[:2]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensor:
    """One triad's raw readings and their model raw = gain @ v + offset."""

    raw: NDArray[np.float64]
    sd: float
    gain: NDArray[np.float64]
    offset: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """State of the iteration and, at its end, the solution.

    `magnetometer` or `accelerometer` is None where it takes no part. Parameters in order:
    magnetometer's W by rows and b, field azimuth, dip; accelerometer's W by rows and b, base
    level north, east (angles in rad).
    """

    magnetometer: Sensor | None
    accelerometer: Sensor | None
    field_mg: float
    azimuth_rad: float
    dip_rad: float
    north_rad: float
    east_rad: float
    converged: bool = False
    covariance: NDArray[np.float64] | None = None
    jacobian: NDArray[np.float64] | None = None
    chi2: float = 0.0

    @property
    def ned_from_rig(self) -> NDArray[np.float64]:
        """Base's rotation, shape (3, 3)."""
        return base_rotation(self.north_rad, self.east_rad)

    def field_rig_mg(self) -> NDArray[np.float64]:
        """Return the field in the rig's frame, shape (3,)."""
        direction = field_direction(self.azimuth_rad, self.dip_rad)
        return np.asarray(self.field_mg * (self.ned_from_rig.T @ direction), dtype=float)

    def force_rig_g(self) -> NDArray[np.float64]:
        """Return the specific force in the rig's frame, shape (3,)."""
        return np.asarray(-self.ned_from_rig.T @ DOWN, dtype=float)


def started(poses: RigPoses, data: CalibrationData, *, with_magnetometer: bool = True) -> Solution:
    """Return the start: linear fits, at the station's field or at the best direction found."""
    field_mg, accel_g = data.field_mg if with_magnetometer else None, data.accel_g
    magnetometer = accelerometer = None
    strength, azimuth_rad, dip_rad = 1.0, 0.0, 0.0
    if field_mg is not None:
        if data.station_field_mg is None:
            rig = direction_from_readings(field_mg, poses)
            gain = linear_sensor(field_mg, poses.turned(rig))[0]
            rig = rig * max(float(np.abs(np.linalg.det(gain)) ** (1.0 / 3.0)), 1e-9)
        else:
            rig = np.asarray(data.station_field_mg, dtype=float)
        strength = float(np.linalg.norm(rig))
        azimuth_rad = float(np.arctan2(rig[1], rig[0]))
        dip_rad = float(np.arctan2(rig[2], np.hypot(rig[0], rig[1])))
        gain, offset = linear_sensor(field_mg, poses.turned(rig))
        magnetometer = Sensor(raw=field_mg, sd=data.field_sd_mg, gain=gain, offset=offset)
    if accel_g is not None:
        gain, offset = linear_sensor(accel_g, poses.turned(-DOWN))
        accelerometer = Sensor(raw=accel_g, sd=data.accel_sd_g, gain=gain, offset=offset)
    return Solution(
        magnetometer=magnetometer,
        accelerometer=accelerometer,
        field_mg=strength,
        azimuth_rad=azimuth_rad,
        dip_rad=dip_rad,
        north_rad=0.0,
        east_rad=0.0,
    )


def solved(start: Solution, poses: RigPoses, rig_sd_deg: float) -> Solution:
    """Return the generalised least squares solution with its covariance.

    Each pose's residual has the covariance of its sensors' noise plus that of the three rig
    angles carried through both sensors; it is renewed at every step.
    """
    state = start
    for _ in range(ITERATIONS):
        residual, jacobian = whitened(state, poses, rig_sd_deg)
        scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
        step = np.linalg.lstsq(jacobian / scale, residual, rcond=1e-10)[0] / scale
        state = stepped(state, step)
        if float(np.abs(step * scale).max()) < 1e-4 * np.sqrt(len(residual)):
            state = replace(state, converged=True)
            break
    residual, jacobian = whitened(state, poses, rig_sd_deg)
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    inverse = np.linalg.pinv(jacobian / scale, rcond=1e-10) / scale[:, None]
    return replace(
        state,
        jacobian=jacobian,
        covariance=inverse @ inverse.T,
        chi2=float(residual @ residual),
    )


def whitened(
    state: Solution, poses: RigPoses, rig_sd_deg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return whitened residuals, shape (n k,), and Jacobian, shape (n k, p)."""
    back = state.ned_from_rig.T
    blocks = []
    if state.magnetometer is not None:
        rig = state.field_rig_mg()
        azimuth, dip = state.azimuth_rad, state.dip_rad
        by_azimuth = np.cos(dip) * np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        by_dip = field_direction(azimuth, dip + np.pi / 2.0)
        by_direction = [state.field_mg * back @ by_azimuth, state.field_mg * back @ by_dip]
        blocks.append((state.magnetometer, rig, by_direction))
    if state.accelerometer is not None:
        blocks.append((state.accelerometer, state.force_rig_g(), []))
    residuals, jacobians, rig_parts, variances = [], [], [], []
    for index, (sensor, rig, by_direction) in enumerate(blocks):
        vectors = poses.turned(rig)
        residuals.append(sensor.raw - vectors @ sensor.gain.T - sensor.offset)
        tilted = [np.cross(rig, axis) for axis in EAST_NORTH]
        columns = _columns(sensor, poses, vectors, by_direction)
        levels = _turned_columns(sensor, poses, tilted)
        jacobians.append((index, columns, levels))
        rig_parts.append(sensor.gain @ poses.angle_derivatives(vectors))
        variances += [sensor.sd**2] * 3
    residual = np.concatenate(residuals, axis=1)
    jacobian = _assembled(jacobians, has_levels=state.accelerometer is not None)
    rig_part = np.concatenate(rig_parts, axis=1) * np.deg2rad(rig_sd_deg)
    covariance = rig_part @ rig_part.transpose(0, 2, 1) + np.diag(variances)
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    flat = (whitening @ jacobian).reshape(residual.size, -1)
    return (whitening @ residual[:, :, None]).reshape(-1), flat


def _columns(
    sensor: Sensor,
    poses: RigPoses,
    vectors: NDArray[np.float64],
    by_direction: list[NDArray[np.float64]],
) -> NDArray[np.float64]:
    count = len(vectors)
    columns = np.zeros((count, 3, 12))
    for axis in range(3):
        columns[:, axis, 3 * axis : 3 * axis + 3] = vectors
        columns[:, axis, 9 + axis] = 1.0
    return np.concatenate([columns, _turned_columns(sensor, poses, by_direction)], axis=2)


def _turned_columns(
    sensor: Sensor, poses: RigPoses, changes: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    if not changes:
        return np.zeros((len(poses.body_from_rig), 3, 0))
    return np.stack([poses.turned(change) @ sensor.gain.T for change in changes], axis=2)


def _assembled(
    blocks: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]], *, has_levels: bool
) -> NDArray[np.float64]:
    count = len(blocks[0][1])
    widths = [columns.shape[2] for _, columns, _ in blocks]
    total = sum(widths) + (2 if has_levels else 0)
    jacobian = np.zeros((count, 3 * len(blocks), total))
    for index, columns, levels in blocks:
        left = sum(widths[:index])
        rows = slice(3 * index, 3 * index + 3)
        jacobian[:, rows, left : left + widths[index]] = columns
        if has_levels:
            jacobian[:, rows, -2:] = levels
    return jacobian


def stepped(state: Solution, step: NDArray[np.float64]) -> Solution:
    """Return the state after one Gauss-Newton step in the order of the parameters."""
    magnetometer, accelerometer = state.magnetometer, state.accelerometer
    azimuth_rad, dip_rad = state.azimuth_rad, state.dip_rad
    north_rad, east_rad = state.north_rad, state.east_rad
    left = 0
    if magnetometer is not None:
        magnetometer = _moved(magnetometer, step[:12])
        azimuth_rad, dip_rad = azimuth_rad + float(step[12]), dip_rad + float(step[13])
        left = 14
    if accelerometer is not None:
        accelerometer = _moved(accelerometer, step[left : left + 12])
        north_rad, east_rad = north_rad + float(step[-2]), east_rad + float(step[-1])
    return replace(
        state,
        magnetometer=magnetometer,
        accelerometer=accelerometer,
        azimuth_rad=azimuth_rad,
        dip_rad=dip_rad,
        north_rad=north_rad,
        east_rad=east_rad,
    )


def _moved(sensor: Sensor, step: NDArray[np.float64]) -> Sensor:
    return replace(
        sensor, gain=sensor.gain + step[:9].reshape(3, 3), offset=sensor.offset + step[9:12]
    )
