"""Taubin's algebraic ellipsoid of many units at once, nearly unbiased in noise.

The fit minimises mean(q^2)/mean(|grad q|^2) over quadrics q, M u = d N u of their moments M and
weights N. Where one quadric is clearly nearest, two steps of inverse iteration reach it; the
trace of M^-1 N tells how clearly. The other units get the eigenvectors.

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
CLEAR: Final = 18.0
"""The same ratio from which two steps of inverse iteration are as good as the eigenvector."""
RIDGE: Final = 1e-15 * np.eye(9)
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
    if np.abs(field_mg).max() > LARGEST_MG:
        beyond = np.abs(field_mg).max(axis=(1, 2)) > LARGEST_MG
        field_mg = np.where(beyond[:, None, None], 0.0, field_mg)
    points = np.array(field_mg.transpose(2, 0, 1), order="C")
    centre_mg = points.sum(axis=2) / count
    points -= centre_mg[:, :, None]
    by_unit = points.transpose(1, 0, 2)
    moments = by_unit @ by_unit.transpose(0, 2, 1)
    scale_mg = np.sqrt(moments.trace(axis1=1, axis2=2) / count)
    still = scale_mg <= SMALLEST_EXTENT * (1.0 + np.abs(centre_mg).max(axis=0))
    spread = np.linalg.eigvalsh(moments)
    ratio = np.sqrt(np.maximum(spread[:, 0], 0.0) / np.maximum(spread[:, 2], 1e-300))
    usable = (ratio > SMALLEST_EXTENT) & ~still
    if not usable.all():
        scale_mg, ratio = np.where(still, 1.0, scale_mg), np.where(still, 0.0, ratio)
        points[:, ~usable] = scale_mg[~usable, None] * sphere_points(count).T[:, None]
    points /= scale_mg[:, None]
    return Normalised(
        points=by_unit.transpose(0, 2, 1),
        centre_mg=centre_mg.T,
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
    mean, moments, weights = _moments(points)
    quadric, told_apart = _nearest(moments, weights)
    if not told_apart.all():
        unsure = np.flatnonzero(~told_apart)
        quadric[unsure], told_apart[unsure] = _by_eigenvectors(moments[unsure], weights[unsure])
    matrix, centre, found = _ellipsoids(quadric, -np.einsum("bi,bi->b", mean, quadric[:, :6]))
    if not found.all():
        matrix = np.where(found[:, None, None], matrix, np.eye(3))
        centre = np.where(found[:, None], centre, 0.0)
    return TaubinStarts(matrix=matrix, centre=centre, found=found, told_apart=told_apart)


def _moments(
    points: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the means of the six squares, (b, 6), moments of all terms and weights, (b, 9, 9)."""
    rows, count = points.transpose(2, 0, 1), points.shape[1]
    terms = np.empty((9, *points.shape[:2]))
    np.multiply(rows, rows, out=terms[:3])
    np.multiply(2.0 * rows[0], rows[1:], out=terms[3:5])
    np.multiply(2.0 * rows[1], rows[2], out=terms[5])
    terms[6:] = rows
    spread = np.matmul(points.transpose(0, 2, 1), points).reshape(-1, 9) / count
    mean = spread @ MEANS
    terms[:6] -= mean.T[:, :, None]
    by_unit = terms.transpose(1, 0, 2)
    moments = by_unit @ by_unit.transpose(0, 2, 1) / count
    return mean, moments, (spread @ WEIGHTS + CONSTANT_WEIGHTS).reshape(-1, 9, 9)


def _nearest(
    moments: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the nearest quadric, shape (b, 9), and where it surely is clearly the nearest.

    The trace of M^-1 N is the sum of all 1/d. What it leaves beside the Rayleigh quotient, which
    is at most the largest of them, is at least the second largest.
    """
    inverse = np.linalg.inv(moments + RIDGE)
    first = inverse @ (weights @ SPHERE)
    turned = weights @ first
    second = inverse @ turned
    powers = np.swapaxes(turned, 1, 2) @ np.concatenate([first, second], axis=2)
    largest = powers[:, 0, 1] / powers[:, 0, 0]
    others = np.einsum("bij,bij->b", inverse, weights) - largest
    clear = (CLEAR * others < largest) & (2.0 * SMALLEST_SECOND * others < 1.0)
    return second[..., 0], clear


def _by_eigenvectors(
    moments: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the nearest quadric, 0 for points in a plane, and where the second is farther."""
    values, vectors = np.linalg.eigh(weights)
    least = np.maximum(1e-9 * values[:, -1:], 1e-300)
    flat = values[:, 0] < least[:, 0]
    half = vectors / np.sqrt(np.maximum(values, least))[:, None, :]
    distances, quadrics = np.linalg.eigh(np.swapaxes(half, 1, 2) @ moments @ half)
    quadric = (half @ quadrics[..., :1])[..., 0]
    quadric *= np.copysign(1.0, (weights @ quadric[..., None])[:, :3, 0].sum(axis=1))[:, None]
    second = np.maximum(SECOND_QUADRIC * distances[:, 0], SMALLEST_SECOND)
    return np.where(flat[:, None], 0.0, quadric), ~flat & (distances[:, 1] > second)


def _weights() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what makes the mean of grad(t_i).grad(t_j) of the points' moments S and of one.

    grad(x.A x) = 2 A x, so that an entry is 4 tr(A_i S A_j) of the terms' matrices A.
    """
    terms = symmetric(np.eye(6))
    weights, constant = np.zeros((3, 3, 9, 9)), np.zeros((9, 9))
    weights[..., :6, :6] = 4.0 * np.einsum("iac,jda->cdij", terms, terms)
    constant[6:, 6:] = np.eye(3)
    return weights.reshape(9, 81), constant.ravel()


WEIGHTS, CONSTANT_WEIGHTS = _weights()
MEANS: Final = symmetric(np.eye(6)).reshape(6, 9).T
"""Makes the means of the squares of the points' moments."""
SPHERE: Final = np.array([[1.0]] * 3 + [[0.0]] * 6)
"""Terms of a sphere, from which the inverse iteration starts."""


def _ellipsoids(
    quadric: NDArray[np.float64], constant: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return M, c and where x.A x + l.x + constant = 0 is an ellipsoid |M (x - c)| = 1.

    The quadric's sign must be that of its mean over the points.
    """
    values, vectors = np.linalg.eigh(symmetric(quadric[:, :6]))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slope = quadric[:, None, 6:] @ vectors
        shift = -0.5 * slope / values[:, None]
        level = -0.5 * np.einsum("bki,bki->b", shift, slope) - constant
        found = (values[:, 0] > 0.0) & (level > 0.0)
        found &= values[:, 2] <= LARGEST_AXIS_RATIO**2 * values[:, 0]
        roots = np.sqrt(values / level[:, None])
        back = vectors.transpose(0, 2, 1)
        return (vectors * roots[:, None]) @ back, (shift @ back)[:, 0], found
