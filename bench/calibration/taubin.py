"""Taubin's algebraic ellipsoid of many units at once, nearly unbiased in noise.

The fit minimises mean(q^2)/mean(|grad q|^2) over quadrics q: one eigenvalue problem a unit.

References
----------
.. [1] G. Taubin, IEEE Trans. Pattern Analysis 13(11), 1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import sphere_points
from bench.calibration.sphere_model import symmetric

if TYPE_CHECKING:
    from numpy.typing import NDArray

LARGEST_AXIS_RATIO: Final = 5.0
SECOND_QUADRIC: Final = 9.0
"""Mean square distance of the second best quadric over that of the best, below which the noise
picks between them: two rings of one axis lie on a whole family of ellipsoids. Poses that tilt in
pitch and in roll have thousands."""
SMALLEST_SECOND: Final = 1e-8
"""The same in squares of the readings' extent, for readings without noise."""
LARGEST_MG: Final = 1e7
"""No magnetometer reads more; beyond it squares of readings would overflow."""
SMALLEST_DETERMINANT: Final = 1e-12
SMALLEST_EXTENT: Final = 1e-6
"""Extent, over the largest or over the readings themselves, that is rounding alone."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Normalised:
    """Readings (b, n, 3) centred and divided by their RMS length, with both.

    `extent_ratio` is the smallest over the largest extent, `still` where all readings are one.
    """

    points: NDArray[np.float64]
    centre_mg: NDArray[np.float64]
    scale_mg: NDArray[np.float64]
    extent_ratio: NDArray[np.float64]
    still: NDArray[np.bool_]
    usable: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TaubinStarts:
    """Taubin's ellipsoids |M (x - c)| = 1 of normalised readings; 1 and 0 where there is none.

    `told_apart`: one quadric fits clearly better than all others. Where it does not, the
    linearised covariance of any fit is worth nothing.
    """

    matrix: NDArray[np.float64]
    centre: NDArray[np.float64]
    found: NDArray[np.bool_]
    told_apart: NDArray[np.bool_]


def normalised(field_mg: NDArray[np.float64]) -> Normalised:
    """Return readings, shape (b, n, 3), centred and of RMS length 1.

    Units whose readings do not span three axes, or are beyond any magnetometer's range, get
    points of a sphere instead, and are not `usable`: what follows then needs no exceptions.
    """
    count = field_mg.shape[1]
    beyond = np.abs(field_mg).max(axis=(1, 2)) > LARGEST_MG
    readings = np.where(beyond[:, None, None], 0.0, field_mg)
    centre_mg = readings.mean(axis=1)
    points = readings - centre_mg[:, None, :]
    scale_mg = np.sqrt(np.einsum("bni,bni->b", points, points) / count)
    still = scale_mg <= SMALLEST_EXTENT * (1.0 + np.abs(centre_mg).max(axis=1))
    scale_mg = np.where(still, 1.0, scale_mg)
    points = points / scale_mg[:, None, None]
    spread = np.linalg.eigvalsh(np.swapaxes(points, 1, 2) @ points)
    ratio = np.sqrt(np.maximum(spread[:, 0], 0.0) / np.maximum(spread[:, 2], 1e-300))
    ratio = np.where(still, 0.0, ratio)
    usable = ~still & (ratio > SMALLEST_EXTENT)
    return Normalised(
        points=np.where(usable[:, None, None], points, sphere_points(count)),
        centre_mg=centre_mg,
        scale_mg=scale_mg,
        extent_ratio=ratio,
        still=still,
        usable=usable,
    )


def taubin_batch(points: NDArray[np.float64]) -> TaubinStarts:
    """Return Taubin's ellipsoids [1]_ of normalised points, shape (b, n, 3).

    The points must be centred: terms of first order in the gradients' moments are then zero.

    Examples
    --------
    >>> corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, 1.0]])
    >>> points = np.vstack([np.eye(3), -np.eye(3), corners / 3**0.5, -corners / 3**0.5])
    >>> starts = taubin_batch(points[None])
    >>> bool(np.allclose(starts.matrix, np.eye(3))), bool(np.allclose(starts.centre, 0.0))
    (True, True)
    """
    x, y, z = np.moveaxis(points, -1, 0)
    squares = [x * x, y * y, z * z, 2.0 * x * y, 2.0 * x * z, 2.0 * y * z]
    terms = np.stack([*squares, x, y, z], axis=-1)
    mean = terms.mean(axis=1)
    centred = terms - mean[:, None, :]
    moments = np.swapaxes(centred, 1, 2) @ centred / points.shape[1]
    weights = _gradient_moments(np.swapaxes(points, 1, 2) @ points / points.shape[1])
    values, vectors = np.linalg.eigh(weights)
    least = np.maximum(1e-9 * values[:, -1:], 1e-300)
    flat = values[:, 0] < least[:, 0]
    half = vectors / np.sqrt(np.maximum(values, least))[:, None, :]
    whitened = np.concatenate([np.swapaxes(half, 1, 2) @ moments[:, :6], moments[:, 6:]], axis=1)
    whitened = np.concatenate([whitened[:, :, :6] @ half, whitened[:, :, 6:]], axis=2)
    distances, quadrics = np.linalg.eigh(whitened)
    quadric = np.concatenate([(half @ quadrics[:, :6, :1])[..., 0], quadrics[:, 6:, 0]], axis=1)
    second = np.maximum(SECOND_QUADRIC * distances[:, 0], SMALLEST_SECOND)
    matrix, centre, found = _ellipsoids(quadric, -(mean * quadric).sum(axis=1))
    found &= ~flat
    return TaubinStarts(
        matrix=np.where(found[:, None, None], matrix, np.eye(3)),
        centre=np.where(found[:, None], centre, 0.0),
        found=found,
        told_apart=~flat & (distances[:, 1] > second),
    )


def _gradient_moments(moments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of grad(t_i).grad(t_j), shape (b, 6, 6), over the terms of second order.

    grad(x.A x) = 2 A x, so that an entry is 4 tr(A_i S A_j) of the terms' matrices A, moments S.
    """
    terms = symmetric(np.eye(6))
    turned = terms.reshape(18, 3) @ moments[:, None, :, :].reshape(-1, 3, 3)
    return np.asarray(4.0 * turned.reshape(-1, 6, 9) @ terms.reshape(6, 9).T)


def _ellipsoids(
    quadric: NDArray[np.float64], constant: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return M, c and where x.A x + l.x + constant = 0 is an ellipsoid |M (x - c)| = 1."""
    shape = symmetric(quadric[:, :6])
    singular = np.abs(np.linalg.det(shape)) < SMALLEST_DETERMINANT
    shape = np.where(singular[:, None, None], np.eye(3), shape)
    centre = -0.5 * np.linalg.solve(shape, quadric[:, 6:9, None])[..., 0]
    level = np.einsum("bi,bij,bj->b", centre, shape, centre) - constant
    safe = np.where(level == 0.0, 1.0, level)
    values, vectors = np.linalg.eigh(shape / safe[:, None, None])
    found = ~singular & (level != 0.0) & (values[:, 0] > 0.0)
    found &= values[:, 2] <= LARGEST_AXIS_RATIO**2 * values[:, 0]
    roots = np.sqrt(np.where(found[:, None], values, 1.0))
    matrix = vectors * roots[:, None, :] @ np.swapaxes(vectors, 1, 2)
    return np.asarray(matrix), np.asarray(centre), np.asarray(found)
