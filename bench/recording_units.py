"""Units and axes of foreign recordings, and the product's: mG, g, forward-right-down."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.errors import ConfigError
from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

COUNTS: Final = "counts"
MG_PER_UNIT: Final[Mapping[str, float]] = {"mG": 1.0, "G": 1e3, "uT": 10.0, "nT": 1e-2}
STANDARD_GRAVITY_MPS2: Final = 9.80665
"""ISO 80000-3: standard acceleration of free fall."""
G_PER_UNIT: Final[Mapping[str, float]] = {
    "g": 1.0,
    "mg": 1e-3,
    "m/s2": 1.0 / STANDARD_GRAVITY_MPS2,
}
NED_FROM_ENU: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def field_scale_mg(unit: str, mg_per_count: float | None = None) -> float:
    """Return mG per unit; counts of unknown size are taken as 1 mG each.

    Raises
    ------
    ConfigError
        If the unit is unknown, or a size of counts is given for another unit.
    """
    return _scale("unit of the field", unit, MG_PER_UNIT, mg_per_count)


def accel_scale_g(unit: str, g_per_count: float | None = None) -> float:
    """Return g per unit; counts of unknown size are taken as 1 g each.

    Raises
    ------
    ConfigError
        If the unit is unknown, or a size of counts is given for another unit.
    """
    return _scale("unit of the acceleration", unit, G_PER_UNIT, g_per_count)


def _scale(what: str, unit: str, known: Mapping[str, float], per_count: float | None) -> float:
    if unit == COUNTS:
        if per_count is not None and not (np.isfinite(per_count) and per_count > 0.0):
            message = f"size of a count must be positive; instead received {per_count}"
            raise ConfigError(message)
        return 1.0 if per_count is None else per_count
    if unit not in known:
        message = f"{what} must be one of {', '.join((*known, COUNTS))}; instead received {unit!r}"
        raise ConfigError(message)
    if per_count is not None:
        message = f"size of a count applies to the unit counts; instead received the unit {unit!r}"
        raise ConfigError(message)
    return known[unit]


def axis_map(text: str) -> NDArray[np.float64]:
    """Return body_from_sensor, shape (3, 3), of a text such as "x,-y,-z".

    The text names, for body x (forward), y (right) and z (down), the sensor axis that lies
    along it and its sign.

    >>> axis_map("y,x,-z").tolist()
    [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]

    Raises
    ------
    ConfigError
        If the text does not name each of x, y and z once.
    """
    matrix = np.zeros((3, 3))
    parts = [part.strip() for part in text.split(",")]
    letters = [part.lstrip("+-") for part in parts]
    if sorted(letters) != ["x", "y", "z"] or any(len(part) > 2 for part in parts):
        message = f"axes must name x, y and z once, as in x,-y,-z; instead received {text!r}"
        raise ConfigError(message)
    for row, (part, letter) in enumerate(zip(parts, letters, strict=True)):
        matrix[row, "xyz".index(letter)] = -1.0 if part.startswith("-") else 1.0
    return matrix


def attitude_deg(
    enu_from_sensor: NDArray[np.float64], body_from_sensor: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return heading, pitch and roll, shape (n, 3), of quaternions (w, x, y, z), shape (n, 4).

    The quaternions rotate from the sensor's axes to east-north-up. The angles are those of
    ned_from_body = Rz(heading) Ry(pitch) Rx(roll).

    Raises
    ------
    ConfigError
        If a quaternion is far from unit length, or the axes are a mirror image.
    """
    length = np.linalg.norm(enu_from_sensor, axis=1)
    if np.any(np.abs(length - 1.0) > 1e-2):
        row = int(np.argmax(np.abs(length - 1.0)))
        message = f"quaternion must have length 1; instead received {length[row]:.4f} in row {row}"
        raise ConfigError(message)
    if np.linalg.det(body_from_sensor) < 0.0:
        message = "axes of a recording with quaternions must be right-handed"
        raise ConfigError(message)
    rotation = NED_FROM_ENU @ _matrices(enu_from_sensor / length[:, None]) @ body_from_sensor.T
    heading_rad = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    pitch_rad = -np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0))
    roll_rad = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    angles_deg: NDArray[np.float64] = np.degrees(
        np.column_stack([heading_rad, pitch_rad, roll_rad])
    )
    angles_deg[:, 0] = wrap_360_deg(angles_deg[:, 0])
    return angles_deg


def _matrices(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotation matrices, shape (n, 3, 3), of unit quaternions (w, x, y, z)."""
    w, x, y, z = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrices: NDArray[np.float64] = np.array(rows).transpose(2, 0, 1)
    return matrices
