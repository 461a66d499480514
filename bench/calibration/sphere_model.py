"""Whitened residuals of corrected readings on a sphere, alone or with the direction of gravity.

A reading y of the true field v (in units of its strength) is y = W v + b + n. With the
corrected w = M (y - b), M = W^-1, and g the unit vector down from the accelerometer:

    r1 = (w.w - 1)/2           r2 = g.w - sin(dip)

Their noise to first order has the covariance a = s^2 |M^T w|^2, c = s^2 (M^T w).(M^T g) and
d = s^2 |M^T g|^2 + s_g^2 (w.w - (g.w)^2). r1/sqrt(a) is the Sampson distance; with
e = d - c^2/a the second whitened residual is (r2 - c/a r1)/sqrt(e). Both are differentiated in
full, weights too: to hold the weights leaves a bias in weak directions.

Every derivative by M is a sum of outer products with z = y - b, p = M^T w and h = M^T g.

References
----------
.. [1] P. D. Sampson, Computer Graphics and Image Processing 18, 1982.
.. [2] M. Kok and T. B. Schon, "Magnetometer Calibration Using Inertial Sensors", IEEE Sensors
   Journal 16(14), 2016, whose model of the dip this is without the gyroscope.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

TINY: Final = 1e-24
SYMMETRIC_ROWS: Final = np.array([0, 1, 2, 0, 0, 1])
SYMMETRIC_COLUMNS: Final = np.array([0, 1, 2, 1, 2, 2])
SYMMETRIC_ELEMENTS: Final = np.array([0, 3, 4, 3, 1, 5, 4, 5, 2])
"""Which of the six elements stands in each place of the matrix, row by row."""
FOLD: Final = (np.arange(6)[:, None] == SYMMETRIC_ELEMENTS).astype(float)
"""Adds derivatives by all nine elements, in the order of rows, to those by the six."""


def symmetric(elements: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrices, shape (..., 3, 3), of elements xx, yy, zz, xy, xz, yz.

    >>> symmetric(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])).tolist()
    [[1.0, 4.0, 5.0], [4.0, 2.0, 6.0], [5.0, 6.0, 3.0]]
    """
    return elements[..., SYMMETRIC_ELEMENTS].reshape(*elements.shape[:-1], 3, 3)


def folded(by_matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return derivatives by the six elements of a symmetric matrix from those by all nine.

    Parameters
    ----------
    by_matrix : ndarray, shape (..., 9)
        By the elements row by row.
    """
    one = by_matrix[..., 3 * SYMMETRIC_ROWS + SYMMETRIC_COLUMNS]
    one[..., 3:] += by_matrix[..., 3 * SYMMETRIC_COLUMNS[3:] + SYMMETRIC_ROWS[3:]]
    return np.asarray(one)


def sphere_rows(
    matrix: NDArray[np.float64],
    centre: NDArray[np.float64],
    points: NDArray[np.float64],
    sd: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return r1/sqrt(a), shape (b, n), and its derivative by M row by row and b, (b, n, 12).

    Parameters
    ----------
    matrix, centre : ndarray, shape (b, 3, 3) and (b, 3)
    points : ndarray, shape (b, n, 3)
    sd : ndarray, shape (b,)
        Standard deviation of a point in each axis.
    """
    residual, by_matrix, against_centre = _sphere_parts(matrix, centre, points, sd)
    columns = np.concatenate([by_matrix, -against_centre])
    return residual, np.moveaxis(columns, 0, -1)


def symmetric_sphere_rows(
    matrix: NDArray[np.float64],
    centre: NDArray[np.float64],
    points: NDArray[np.float64],
    sd: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the derivatives of `sphere_rows` by the elements of a symmetric M and by b, and it.

    Parameters
    ----------
    matrix, centre, points, sd : ndarray
        As for `sphere_rows`.

    Returns
    -------
    ndarray, shape (10, b, n)
        Six elements, three coordinates, and at last the residual itself, each in one piece.
    """
    residual, by_matrix, against_centre = _sphere_parts(matrix, centre, points, sd)
    rows = np.empty((10, *residual.shape))
    np.matmul(FOLD, by_matrix.reshape(9, -1), out=rows[:6].reshape(6, -1))
    np.negative(against_centre, out=rows[6:9])
    rows[9] = residual
    return rows


def _sphere_parts(
    matrix: NDArray[np.float64],
    centre: NDArray[np.float64],
    points: NDArray[np.float64],
    sd: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return r1/sqrt(a), (b, n), its derivatives by M row by row, (9, b, n), and by -b, (3, b, n).

    Coordinates come first, so that each is one piece of memory for all units and readings.
    """
    z = np.subtract(points.transpose(2, 0, 1), centre.T[:, :, None], order="C")
    both = np.concatenate([matrix, matrix.transpose(0, 2, 1) @ matrix], axis=1)
    left, right = np.empty((2, 6, *z.shape[1:]))
    # w = M z and p = M^T w of all readings, three coordinates each; then M p and M^T M p.
    np.matmul(both, z.transpose(1, 0, 2), out=left.transpose(1, 0, 2))
    w, p = left[:3], left[3:]
    np.matmul(both, p.transpose(1, 0, 2), out=right.transpose(1, 0, 2))
    halves = left.reshape(2, 3, *z.shape[1:])
    length2, weight = np.einsum("hibn,hibn->hbn", halves, halves)
    weight = np.maximum(weight, TINY)
    whiten = 1.0 / (sd[:, None] * np.sqrt(weight))
    residual = (length2 - 1.0) * (0.5 * whiten)
    bend = residual / weight
    bent = (bend * w)[:, None] * p
    left *= whiten
    right *= bend
    left -= right
    by_matrix = left[:3, None] * z
    by_matrix -= bent
    return residual, by_matrix.reshape(9, *residual.shape), left[3:]


def tilt_rows(
    matrix: NDArray[np.float64],
    centre: NDArray[np.float64],
    sine: NDArray[np.float64],
    points: NDArray[np.float64],
    down: NDArray[np.float64],
    sd: NDArray[np.float64],
    down_sd: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both whitened residuals, (b, 2, n), and derivatives by M, b, sin(dip): (b, 2, n, 13).

    Parameters
    ----------
    matrix, centre, points, sd : ndarray
        As for `sphere_rows`.
    sine : ndarray, shape (b,)
        Sine of the dip.
    down : ndarray, shape (b, n, 3)
        Unit vectors down, g.
    down_sd : float
        Standard deviation of g in radians, in each direction across it.
    """
    back = np.swapaxes(matrix, -1, -2)
    z = points - centre[:, None, :]
    w = z @ back
    p, h = w @ matrix, down @ matrix
    s2, g2 = (sd**2)[:, None], down_sd**2
    along = np.einsum("bni,bni->bn", down, w)
    square = np.einsum("bni,bni->bn", w, w)
    a = np.maximum(s2 * np.einsum("bni,bni->bn", p, p), TINY)
    c = s2 * np.einsum("bni,bni->bn", p, h)
    d = s2 * np.einsum("bni,bni->bn", h, h) + g2 * (square - along**2)
    k = c / a
    e = np.maximum(d - k * c, TINY)
    r1 = 0.5 * (square - 1.0)
    q = along - sine[:, None] - k * r1
    first, second = 1.0 / np.sqrt(a), 1.0 / np.sqrt(e)
    half = -0.5 * q * second / e
    # Factors of dr1, da, dc and dd in the derivative of the second residual; dr2's is `second`.
    f1, fd, fg = -k * second, 2.0 * s2 * half, 2.0 * g2 * half
    fa = 2.0 * s2 * (r1 * k * second / a + half * k**2)
    fc = s2 * (-r1 * second / a - 2.0 * half * k)
    mp, mh = p @ back, h @ back
    bend = (-r1 * first / a * s2)[..., None]
    by_z = (second - fg * along)[..., None] * down + (f1 + fg)[..., None] * w
    by_z += fc[..., None] * mh + fa[..., None] * mp
    by_p = fc[..., None] * down + fa[..., None] * w
    by_h = fc[..., None] * w + fd[..., None] * down
    jacobian = np.zeros((len(a), 2, a.shape[1], 13))
    sphere = [(first[..., None] * w + bend * mp, z), (bend * w, p)]
    jacobian[:, 0, :, :12] = _columns(matrix, sphere)
    jacobian[:, 1, :, :12] = _columns(matrix, [(by_z, z), (by_p, p), (by_h, h)])
    jacobian[:, 1, :, 12] = -second
    return np.stack([r1 * first, q * second], axis=1), jacobian


def _columns(
    matrix: NDArray[np.float64],
    products: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> NDArray[np.float64]:
    """Return derivatives (b, n, 12) by M and b of the sum of left x right; the first right is z."""
    left, right = products[0]
    columns = np.empty((*left.shape[:-1], 12))
    by_matrix = left[..., :, None] * right[..., None, :]
    columns[..., 9:] = -left @ matrix
    for left, right in products[1:]:
        by_matrix += left[..., :, None] * right[..., None, :]
    columns[..., :9] = by_matrix.reshape(*left.shape[:-1], 9)
    return columns
