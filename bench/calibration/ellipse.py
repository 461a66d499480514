"""Ellipses through the readings of many units at once: conic start, Sampson optimum.

Start: the conic of smallest algebraic distance among those of trace 2, which no rotation of the
readings changes. End: Levenberg-Marquardt on the Sampson distance [1]_, the first-order maximum
likelihood, with the gradient weight differentiated too: neither unequal spacing nor noise
pulls it, as they pull the algebraic conic.

References
----------
.. [1] P. D. Sampson, Computer Graphics and Image Processing 18, 1982.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

ITERATIONS: Final = 30
SETTLED: Final = 1e-7
"""Step, as a part of the readings' extent, below which a unit has settled."""
RIDGE: Final = 1e-12
SMALLEST_EXTENT: Final = 1e-9
"""Least eigenvalue of the conic's normal matrix over the largest: a line leaves many conics."""
SMALLEST_GRADIENT: Final = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ellipses:
    """Ellipse of each unit: |root @ (reading - centre)| = 1, root symmetric and positive.

    Attributes
    ----------
    centre, root : ndarray, shape (..., 2) and (..., 2, 2)
        In the readings' unit and its inverse; unit circle where `found` is False.
    covariance : ndarray, shape (..., 5, 5)
        Of centre x, y and root xx, yy, xy, for readings of variance 1.
    distance : ndarray, shape (..., n)
        Signed distance of each reading from the ellipse, to first order.
    found, settled : ndarray of bool, shape (...)
        Whether the readings lie on an ellipse rather than on a hyperbola or a line; whether the
        iteration came to rest.
    """

    centre: NDArray[np.float64]
    root: NDArray[np.float64]
    covariance: NDArray[np.float64]
    distance: NDArray[np.float64]
    found: NDArray[np.bool_]
    settled: NDArray[np.bool_]


def fitted_ellipses(readings: NDArray[np.float64]) -> Ellipses:
    """Return the ellipse nearest to the readings of each unit.

    Parameters
    ----------
    readings : ndarray, shape (..., n, 2), n >= 5
        Finite, in any unit.
    """
    mean = readings.mean(axis=-2)
    off = readings - mean[..., None, :]
    extent = np.sqrt((off**2).sum(axis=-1).mean(axis=-1))
    extent = np.where(extent > 0.0, extent, 1.0)
    points = off / extent[..., None, None]
    start, found = _conic(points)
    even = 2.0 * np.pi * np.arange(points.shape[-2]) / points.shape[-2]
    circle = np.stack([np.cos(even), np.sin(even)], axis=-1)
    points = np.where(found[..., None, None], points, circle)
    shape = found.shape
    flat, settled = _optimum(points.reshape(-1, *points.shape[-2:]), start.reshape(-1, 5))
    distance, slopes = _sampson(points, flat.reshape(*shape, 5))
    solution = flat.reshape(*shape, 5)
    units = np.stack([extent] * 2 + [1.0 / extent] * 3, axis=-1)
    normal = np.swapaxes(slopes, -1, -2) @ slopes + RIDGE * points.shape[-2] * np.eye(5)
    by_extent = (units / extent[..., None])[..., :, None] * (units / extent[..., None])[
        ..., None, :
    ]
    covariance = np.linalg.inv(normal) * by_extent
    root = roots_of(solution)
    # A turned-over root draws the same ellipse; the positive one adds no rotation.
    positive = (np.linalg.det(root) > 0.0) & (root[..., 0, 0] > 0.0)
    return Ellipses(
        centre=mean + np.where(found[..., None], solution[..., :2] * extent[..., None], 0.0),
        root=np.where(found[..., None, None], root / extent[..., None, None], np.eye(2)),
        covariance=covariance,
        distance=distance * extent[..., None],
        found=found,
        settled=settled.reshape(shape) & positive,
    )


def roots_of(solution: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return symmetric matrices, shape (..., 2, 2), of elements xx, yy, xy at the end of (..., 5).

    >>> roots_of(np.array([0.0, 0.0, 1.0, 2.0, 3.0])).tolist()
    [[1.0, 3.0], [3.0, 2.0]]
    """
    xx, yy, xy = solution[..., 2], solution[..., 3], solution[..., 4]
    return np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2)


def _conic(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return centre and root as parameters (..., 5), and which units (...) have an ellipse.

    Solves x^2 + y^2 + a (x^2 - y^2) + 2 b x y + c x + d y + e = 0 by least squares.
    """
    x, y = points[..., 0], points[..., 1]
    design = np.stack([x**2 - y**2, 2.0 * x * y, x, y, np.ones_like(x)], axis=-1)
    transposed = np.swapaxes(design, -1, -2)
    normal = transposed @ design + RIDGE * points.shape[-2] * np.eye(5)
    right = transposed @ (x**2 + y**2)[..., None]
    extents = np.linalg.eigvalsh(normal)
    spread = extents[..., 0] > SMALLEST_EXTENT * extents[..., -1]
    a, b, c, d, e = np.moveaxis(-np.linalg.solve(normal, right)[..., 0], -1, 0)
    determinant = 1.0 - a**2 - b**2
    safe = np.where(determinant > 0.0, determinant, 1.0)
    centre_x = -((1.0 - a) * c - b * d) / (2.0 * safe)
    centre_y = -((1.0 + a) * d - b * c) / (2.0 * safe)
    level = -(c * centre_x + d * centre_y) / 2.0 - e
    found = spread & (determinant > 1e-6) & (level > 1e-9)
    level = np.where(found, level, 1.0)
    # Symmetric square root of the conic's matrix over its level: (Q + sqrt(|Q|)) / trace's root.
    root_determinant = np.sqrt(safe)
    divisor = np.sqrt((2.0 + 2.0 * root_determinant) * level)
    root_xx, root_yy = 1.0 + a + root_determinant, 1.0 - a + root_determinant
    start = np.stack(
        [centre_x, centre_y, root_xx / divisor, root_yy / divisor, b / divisor], axis=-1
    )
    return np.where(found[..., None], start, np.array([0.0, 0.0, 1.0, 1.0, 0.0])), found


def _sampson(
    points: NDArray[np.float64], solution: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return Sampson distances (..., n) and their derivatives by the parameters (..., n, 5).

    With u = S (p - c), q = (|u|^2 - 1)/2 and g = S u its gradient, the distance is q/|g|.
    """
    cx, cy, xx, yy, xy = np.moveaxis(solution[..., None], -2, 0)
    dx, dy = points[..., 0] - cx, points[..., 1] - cy
    ux, uy = xx * dx + xy * dy, xy * dx + yy * dy
    gx, gy = xx * ux + xy * uy, xy * ux + yy * uy
    norm = np.maximum(np.hypot(gx, gy), SMALLEST_GRADIENT)
    distance = (ux**2 + uy**2 - 1.0) / (2.0 * norm)
    nx, ny = gx / norm, gy / norm
    hx, hy = xx * nx + xy * ny, xy * nx + yy * ny
    # dq - distance n.dg, with dg = dS u + S du and h = S n.
    by_centre_x = -gx + distance * (hx * xx + hy * xy)
    by_centre_y = -gy + distance * (hx * xy + hy * yy)
    by_xx = ux * dx - distance * (nx * ux + hx * dx)
    by_yy = uy * dy - distance * (ny * uy + hy * dy)
    by_xy = ux * dy + uy * dx - distance * (nx * uy + ny * ux + hx * dy + hy * dx)
    slopes = np.stack([by_centre_x, by_centre_y, by_xx, by_yy, by_xy], axis=-1)
    return distance, slopes / norm[..., None]


def _optimum(
    points: NDArray[np.float64], start: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return parameters (m, 5) of least Sampson distance, and which of m units settled."""
    solution = start.copy()
    damping = np.full(len(start), 1e-6)
    settled = np.zeros(len(start), dtype=bool)
    active = np.arange(len(start))
    distance, slopes = _sampson(points, solution)
    for _ in range(ITERATIONS):
        transposed = np.swapaxes(slopes, -1, -2)
        damped = transposed @ slopes + damping[:, None, None] * points.shape[-2] * np.eye(5)
        step = -np.linalg.solve(damped, transposed @ distance[..., None])[..., 0]
        tried, tried_slopes = _sampson(points[active], solution[active] + step)
        better = (tried**2).sum(axis=-1) <= (distance**2).sum(axis=-1)
        solution[active[better]] += step[better]
        damping = damping * np.where(better, 0.1, 100.0)
        moving = np.abs(step).max(axis=-1) >= SETTLED
        settled[active[~moving]] = True
        active, damping, better = active[moving], damping[moving], better[moving]
        if not len(active):
            break
        distance = np.where(better[:, None], tried[moving], distance[moving])
        slopes = np.where(better[:, None, None], tried_slopes[moving], slopes[moving])
    return solution, settled
