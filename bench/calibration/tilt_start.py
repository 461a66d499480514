"""Starts of the tilt-aided fit: an ellipsoid or a sphere, turned to the accelerometer's axes.

The magnetometer alone leaves its rotation open. Of the 24 ways to mount one board square on
another the one is taken whose vertical field is most constant; the likelihood turns the rest.
"""

from __future__ import annotations

from itertools import permutations, product
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.taubin import TaubinStarts

PREFERRED: Final = 0.25
"""Another mounting than straight must make the vertical field this much more constant."""


def _mountings() -> NDArray[np.float64]:
    """Return the 24 rotations of a cube, shape (24, 3, 3), the identity first."""
    found = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) > 0.0:
                found.append(turn)
    return np.array(sorted(found, key=lambda turn: -np.trace(turn)))


MOUNTINGS: Final = _mountings()


def ellipsoid_start(
    starts: TaubinStarts, points: NDArray[np.float64], down: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return M row by row, b and sin(dip), shape (b, 13), from Taubin's ellipsoids.

    Parameters
    ----------
    starts : TaubinStarts
    points, down : ndarray, shape (b, n, 3)
        Normalised readings and unit vectors down.
    """
    return mounted(starts.matrix, starts.centre, points, down)


def sphere_start(points: NDArray[np.float64], down: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return M row by row, b and sin(dip), shape (b, 13), from the sphere nearest to the points.

    |x|^2 = 2 x.c + k is linear: it has a solution wherever the readings do not lie in a plane.
    """
    design = np.concatenate([2.0 * points, np.ones((*points.shape[:2], 1))], axis=-1)
    turned = np.swapaxes(design, 1, 2)
    squares = np.einsum("bni,bni->bn", points, points)
    normal = turned @ design + 1e-9 * points.shape[1] * np.eye(4)
    solution = np.linalg.solve(normal, turned @ squares[..., None])[..., 0]
    centre = solution[:, :3]
    radius = np.sqrt(np.maximum(solution[:, 3] + (centre**2).sum(axis=1), 1e-6))
    matrix = np.eye(3) / radius[:, None, None]
    return mounted(matrix, centre, points, down)


def mounted(
    matrix: NDArray[np.float64],
    centre: NDArray[np.float64],
    points: NDArray[np.float64],
    down: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return M row by row, b and sin(dip), (b, 13), of corrections turned to the force's axes.

    Parameters
    ----------
    matrix, centre : ndarray, shape (b, 3, 3) and (b, 3)
    points, down : ndarray, shape (b, n, 3)
    """
    count = points.shape[1]
    inside = (points - centre[:, None, :]) @ np.swapaxes(matrix, 1, 2)
    products = (down[..., :, None] * inside[..., None, :]).reshape(-1, count, 9)
    vertical = products @ MOUNTINGS.reshape(24, 9).T
    variance = vertical.var(axis=1)
    variance[:, 1:] /= PREFERRED
    best = variance.argmin(axis=1)
    turned = MOUNTINGS[best] @ matrix
    sine = np.take_along_axis(vertical.mean(axis=1), best[:, None], axis=1)
    return np.concatenate([turned.reshape(-1, 9), centre, np.clip(sine, -0.99, 0.99)], axis=1)
