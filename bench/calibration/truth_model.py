"""Model of a module on the rig: raw = W v + b for magnetometer and accelerometer at known angles.

v = body_from_rig @ (vector in the rig's frame). The rig's base may be out of level by two
small angles, so that ned = T @ rig with T the rotation vector (north, east, 0).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bench.calibration.fit import CalibrationData

SMALLEST: Final = 6
"""Poses below which nothing is left that could contradict."""
LARGEST_AXIS_RATIO: Final = 10.0
LARGEST_RESIDUAL: Final = 0.08
"""Residual RMS an axis, as a part of the field, beyond which the model does not hold."""
LARGEST_PREDICTED_DEG: Final = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigPoses:
    """Attitudes of the seat in the rig's frame.

    Attributes
    ----------
    body_from_rig : ndarray, shape (n, 3, 3)
    axes_body : ndarray, shape (n, 3, 3)
        Row k is the axis, in the body, about which rig angle k (azimuth, pitch, roll) turns.
    """

    body_from_rig: NDArray[np.float64]
    axes_body: NDArray[np.float64]

    def turned(self, vector_rig: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rig's vector, shape (3,), in the body at every pose, shape (n, 3)."""
        return np.asarray(self.body_from_rig @ vector_rig)

    def angle_derivatives(self, vectors_body: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return d(vector)/d(rig angle in rad), shape (n, 3 components, 3 angles)."""
        return np.cross(vectors_body[:, None, :], self.axes_body).transpose(0, 2, 1)


def rig_poses(
    azimuth_deg: NDArray[np.float64],
    pitch_deg: NDArray[np.float64],
    roll_deg: NDArray[np.float64],
) -> RigPoses:
    """Return the poses of rig angles, each shape (n,), in degrees."""
    rig_from_body = ned_from_body(azimuth_deg, pitch_deg, roll_deg)
    roll_rad = np.deg2rad(np.asarray(roll_deg, dtype=float))
    axes_body = np.zeros_like(rig_from_body)
    axes_body[:, 0] = rig_from_body[:, 2]
    axes_body[:, 1, 1] = np.cos(roll_rad)
    axes_body[:, 1, 2] = -np.sin(roll_rad)
    axes_body[:, 2, 0] = 1.0
    return RigPoses(body_from_rig=rig_from_body.transpose(0, 2, 1), axes_body=axes_body)


def poses_of(data: CalibrationData) -> RigPoses | None:
    """Return the poses of readings, None where an angle of the rig is not known."""
    if data.azimuth_deg is None or data.pitch_deg is None or data.roll_deg is None:
        return None
    return rig_poses(data.azimuth_deg, data.pitch_deg, data.roll_deg)


def common_poses(attitudes_deg: ArrayLike, readings: NDArray[np.float64]) -> RigPoses:
    """Return the poses, attitudes (n, 3), on which all units' readings (..., n, 3) were taken.

    Raises
    ------
    ValueError
        If there is not one attitude for each reading of a unit.
    """
    angles_deg = np.asarray(attitudes_deg, dtype=float)
    if angles_deg.shape != readings.shape[-2:]:
        message = (
            f"attitudes_deg must have the shape {readings.shape[-2:]}; instead received "
            f"{angles_deg.shape}"
        )
        raise ValueError(message)
    return rig_poses(*angles_deg.T)


def base_rotation(north_rad: float, east_rad: float) -> NDArray[np.float64]:
    """Return ned_from_rig, shape (3, 3), of a base out of level, by Rodrigues' formula.

    >>> down_in_rig = base_rotation(0.001, 0.0).T @ [0.0, 0.0, 1.0]
    >>> down_in_rig.round(6).tolist()
    [0.0, 0.001, 1.0]
    """
    angle = float(np.hypot(north_rad, east_rad))
    cross = np.array([[0.0, 0.0, east_rad], [0.0, 0.0, -north_rad], [-east_rad, north_rad, 0.0]])
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def field_direction(azimuth_rad: float, dip_rad: float) -> NDArray[np.float64]:
    """Return the unit field, shape (3,), NED, of azimuth against the rig's zero and dip."""
    return np.array(
        [
            np.cos(dip_rad) * np.cos(azimuth_rad),
            np.cos(dip_rad) * np.sin(azimuth_rad),
            np.sin(dip_rad),
        ]
    )


def linear_sensor(
    raw: NDArray[np.float64], vectors: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (W, b), shapes (3, 3) and (3,), by unweighted least squares of raw = W v + b."""
    regressors = np.column_stack([vectors, np.ones(len(vectors))])
    solution = np.linalg.lstsq(regressors, raw, rcond=None)[0]
    return np.array(solution[:3].T, dtype=float), np.array(solution[3], dtype=float)


def direction_from_readings(raw: NDArray[np.float64], poses: RigPoses) -> NDArray[np.float64]:
    """Return the rig-frame unit vector, shape (3,), that readings at known poses were of.

    A (raw - b) = body_from_rig @ m is linear and homogeneous in A, A b and m: its solution is
    the smallest singular vector; the sign is that of a sensor with positive determinant.
    """
    centre = raw.mean(axis=0)
    scale = float(np.sqrt(((raw - centre) ** 2).sum(axis=1).mean()))
    unit = (raw - centre) / scale
    count = len(raw)
    design = np.zeros((count, 3, 15))
    for axis in range(3):
        design[:, axis, 3 * axis : 3 * axis + 3] = unit
        design[:, axis, 9 + axis] = -1.0
    design[:, :, 12:] = -poses.body_from_rig
    smallest = np.linalg.svd(design.reshape(3 * count, 15), full_matrices=False)[2][-1]
    direction = smallest[12:] / np.linalg.norm(smallest[12:])
    sensor = linear_sensor(unit, poses.turned(direction))[0]
    return np.asarray(direction if np.linalg.det(sensor) > 0.0 else -direction)


def observed(vectors_body: NDArray[np.float64]) -> tuple[int, float]:
    """Return (rank of 12, condition) of the coefficients of raw = W v + b from directions.

    A direction counts from an RMS of 0.01 (about 0.6 deg of tilt): less is the rig's wobble.

    >>> observed(np.eye(3))[0], observed(np.vstack([np.eye(3), -np.eye(3)]))[0]
    (9, 12)
    """
    lengths = np.linalg.norm(vectors_body, axis=1, keepdims=True)
    regressors = np.column_stack([vectors_body / lengths, np.ones(len(vectors_body))])
    if len(regressors) < 4:
        regressors = np.vstack([regressors, np.zeros((4 - len(regressors), 4))])
    values = np.linalg.svd(regressors, compute_uv=False) / np.sqrt(len(vectors_body))
    condition = float(values[0] / values[-1]) if values[-1] > 1e-12 else float("inf")
    return 3 * int((values > 0.01).sum()), condition
