"""True heading of the seat as a function of what is not perfect about rig and seat.

ned_from_seat = base level - azimuth - wobble and squareness - pitch - squareness - roll - index -
seat level. The derivative of its heading by each imperfection says what that imperfection costs:
the pitch and the roll encoder cost nothing where the seat points along the roll axis, because
neither angle turns the forward axis about the vertical, and the module measures its true tilt.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

IMPERFECTIONS: Final = (
    "base_north",
    "base_east",
    "azimuth",
    "azimuth_pitch_squareness",
    "pitch",
    "pitch_roll_squareness",
    "roll",
    "index",
    "level_pitch",
    "level_roll",
)
"""Small angles of a rig and its seat in the order of their rotations."""
_STEP_DEG: Final = 0.01
_X: Final = (1.0, 0.0, 0.0)
_Y: Final = (0.0, 1.0, 0.0)
_Z: Final = (0.0, 0.0, 1.0)


def ned_from_seat(
    angles_deg: NDArray[np.float64], index_deg: float = 0.0, **imperfections_deg: float
) -> NDArray[np.float64]:
    """Return rotation matrices, shape (n, 3, 3).

    Parameters
    ----------
    angles_deg : ndarray, shape (n, 3)
        Azimuth, pitch and roll that the encoders show.
    index_deg : float
        Turn of the seat about its down axis, clockwise, as the station's record has it.
    imperfections_deg : float
        Any of `IMPERFECTIONS`.
    """
    small = {name: imperfections_deg.get(name, 0.0) for name in IMPERFECTIONS}
    azimuth_deg, pitch_deg, roll_deg = np.asarray(angles_deg, dtype=float).T
    skewed = _about(_X, small["azimuth_pitch_squareness"])
    turned = _about(_Z, small["pitch_roll_squareness"])
    rotations = (
        _about(_X, small["base_north"]),
        _about(_Y, small["base_east"]),
        _about(_Z, azimuth_deg + small["azimuth"]),
        skewed @ _about(_Y, pitch_deg + small["pitch"]) @ _inverse(skewed),
        turned @ _about(_X, roll_deg + small["roll"]) @ _inverse(turned),
        _about(_Z, index_deg + small["index"]),
        _about(_Y, small["level_pitch"]),
        _about(_X, small["level_roll"]),
    )
    matrix = rotations[0]
    for rotation in rotations[1:]:
        matrix = matrix @ rotation
    return matrix


def heading_derivative(
    angles_deg: NDArray[np.float64], imperfection: str, index_deg: float = 0.0
) -> NDArray[np.float64]:
    """Return the derivative, shape (n,), of the seat's true heading by one of `IMPERFECTIONS`.

    Central differences over 0.02 deg.

    >>> pose = np.array([[40.0, 30.0, 0.0]])
    >>> [round(float(heading_derivative(pose, name)[0]), 6) for name in ("azimuth", "pitch")]
    [1.0, 0.0]
    >>> round(float(heading_derivative(pose, "azimuth_pitch_squareness")[0]), 6)  # tan(pitch)
    0.57735
    """
    high, low = (
        ned_from_seat(angles_deg, index_deg, **{imperfection: step_deg})
        for step_deg in (_STEP_DEG, -_STEP_DEG)
    )
    return wrap_180_deg(_heading_deg(high) - _heading_deg(low)) / (2.0 * _STEP_DEG)


def _heading_deg(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.rad2deg(np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0])))


def _about(axis: tuple[float, float, float], angle_deg: ArrayLike) -> NDArray[np.float64]:
    """Return the rotation about a unit vector, right-handed, shape (..., 3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle_rad = np.deg2rad(np.asarray(angle_deg, dtype=float))[..., None, None]
    return np.asarray(
        np.eye(3) + np.sin(angle_rad) * cross + (1.0 - np.cos(angle_rad)) * (cross @ cross)
    )


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.swapaxes(matrix, -1, -2)
