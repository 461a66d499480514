"""How much of the sphere the readings saw."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

COVERED_WITHIN_DEG: Final = 20.0
_POINTS: Final = 400


def sphere_points(count: int) -> NDArray[np.float64]:
    """Return directions, shape (count, 3), evenly spread along a spiral of equal areas.

    >>> bool(np.allclose(np.linalg.norm(sphere_points(50), axis=1), 1.0))
    True
    """
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    radius = np.sqrt(1.0 - height**2)
    turn_rad = index * np.pi * (3.0 - np.sqrt(5.0))
    return np.column_stack([radius * np.cos(turn_rad), radius * np.sin(turn_rad), height])


def sphere_coverage(vectors: NDArray[np.float64]) -> float:
    """Return the part 0..1 of all directions that lie within 20 deg of a reading.

    Parameters
    ----------
    vectors : ndarray, shape (n, 3)
        Corrected or centred readings; only their directions count.

    Examples
    --------
    >>> sphere_coverage(sphere_points(200))
    1.0
    >>> round(sphere_coverage(np.array([[0.0, 0.0, 1.0]])), 2)  # (1 - cos 20 deg)/2
    0.03
    """
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    directions = vectors / np.where(lengths > 0.0, lengths, 1.0)
    points = sphere_points(_POINTS)
    closest = np.full(_POINTS, -1.0)
    for start in range(0, len(directions), 2000):
        block = points @ directions[start : start + 2000].T
        closest = np.maximum(closest, block.max(axis=1))
    return float((closest >= np.cos(np.deg2rad(COVERED_WITHIN_DEG))).mean())
