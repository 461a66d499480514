"""The ellipsoid that always exists: an algebraic fit that cannot give another quadric.

Noise on a small part of an ellipsoid makes the best quadric a hyperboloid or a paraboloid. Here
the quadric a x2 + b y2 + c z2 + 2 f yz + 2 g xz + 2 h xy + ... is held to 4 J - I2 = 1 with
I = a + b + c and J = ab + bc + ac - f2 - g2 - h2, which only ellipsoids meet: all whose shortest
semi-axis is at least half of the longest. The price is a bias towards the sphere. It is a start
and a witness, never a result by itself: readings that need it hardly determine an ellipsoid.

References
----------
.. [1] Q. Li and J. G. Griffiths, "Least Squares Ellipsoid Specific Fitting", Geometric Modeling
   and Processing 2004, IEEE, section 3, with k = 4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.least_squares import inverted
from bench.calibration.sphere_minimum import sphere_minimum
from bench.calibration.sphere_model import sphere_rows, symmetric
from bench.calibration.sphere_prediction import DEFAULT_SINE, predicted_at
from bench.calibration.taubin import LARGEST_AXIS_RATIO, TaubinStarts, normalised

if TYPE_CHECKING:
    from numpy.typing import NDArray

K: Final = 4.0
LINEAR_RIDGE: Final = 1e-12
"""Part of the linear terms' moments that is added, for readings in a plane."""


def _constraint_inverse() -> NDArray[np.float64]:
    """Return the inverse, shape (6, 6), of the form that gives k J - I2, with k = 4.

    The terms are x2, y2, z2, 2xy, 2xz, 2yz, as in `symmetric`.
    """
    form = np.zeros((6, 6))
    form[:3, :3] = K / 2.0 - 1.0
    np.fill_diagonal(form, [-1.0, -1.0, -1.0, -K, -K, -K])
    return np.asarray(np.linalg.inv(form))


CONSTRAINT_INVERSE: Final = _constraint_inverse()


def ellipsoid_specific(points: NDArray[np.float64]) -> TaubinStarts:
    """Return the ellipsoid-specific fits of normalised points, shape (b, n, 3).

    Returns
    -------
    TaubinStarts
        Ellipsoids |M (x - c)| = 1; `found` wherever the arithmetic is regular. `told_apart` is
        False: that one ellipsoid fits best says nothing of other quadrics.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> points = rng.normal(size=(1, 40, 3))
    >>> points /= np.linalg.norm(points, axis=2, keepdims=True)
    >>> bool(np.allclose(ellipsoid_specific(1.2 * points).matrix, np.eye(3) / 1.2))
    True
    """
    count = points.shape[1]
    x, y, z = np.moveaxis(points, -1, 0)
    squares = np.stack([x * x, y * y, z * z, 2.0 * x * y, 2.0 * x * z, 2.0 * y * z], axis=-1)
    linear = np.concatenate([2.0 * points, np.ones((len(points), count, 1))], axis=-1)
    turned = np.swapaxes(linear, 1, 2)
    own = turned @ linear / count
    own = own + LINEAR_RIDGE * np.trace(own, axis1=1, axis2=2)[:, None, None] * np.eye(4)
    mixed = turned @ squares / count
    back = np.linalg.solve(own, mixed)
    scatter = np.swapaxes(squares, 1, 2) @ squares / count - np.swapaxes(mixed, 1, 2) @ back
    values, vectors = np.linalg.eig(CONSTRAINT_INVERSE @ scatter)
    best = np.argmax(values.real, axis=1)
    quadric = np.take_along_axis(vectors.real, best[:, None, None], axis=2)[..., 0]
    rest = -(back @ quadric[..., None])[..., 0]
    return _ellipsoids(symmetric(quadric), rest[:, :3], rest[:, 3])


def _ellipsoids(
    shape: NDArray[np.float64], slope: NDArray[np.float64], constant: NDArray[np.float64]
) -> TaubinStarts:
    """Return M and c of x.A x + 2 l.x + constant = 0."""
    sign = np.where(np.trace(shape, axis1=1, axis2=2) < 0.0, -1.0, 1.0)
    shape, slope, constant = sign[:, None, None] * shape, sign[:, None] * slope, sign * constant
    definite = np.linalg.eigvalsh(shape)[:, 0] > 0.0
    shape = np.where(definite[:, None, None], shape, np.eye(3))
    centre = -np.linalg.solve(shape, slope[..., None])[..., 0]
    level = np.einsum("bi,bij,bj->b", centre, shape, centre) - constant
    found = definite & (level > 0.0)
    values, vectors = np.linalg.eigh(shape / np.where(found, level, 1.0)[:, None, None])
    roots = np.sqrt(np.where(found[:, None], values, 1.0))
    matrix = vectors * roots[:, None, :] @ np.swapaxes(vectors, 1, 2)
    return TaubinStarts(
        matrix=np.where(found[:, None, None], matrix, np.eye(3)),
        centre=np.where(found[:, None], centre, 0.0),
        found=found,
        told_apart=np.zeros(len(found), dtype=bool),
    )


def witness(
    field_mg: NDArray[np.float64], field_sd_mg: float, strength_mg: float | None
) -> dict[str, float]:
    """Return what the ellipsoid-specific start leads to, as the `extra` of a refused fit.

    The Sampson likelihood goes on from the start; where it ends in no ellipsoid, the numbers are
    the start's own, and nothing is predicted.

    Parameters
    ----------
    field_mg : ndarray, shape (n, 3)
        Readings that span three axes.
    field_sd_mg : float
    strength_mg : float or None
        Field strength to hold; None leaves it free (a matrix of determinant one).

    Returns
    -------
    dict
        ``degenerate`` (1), ``specific_offset_{x,y,z}_mg``, ``specific_residual_rms_mg``,
        ``specific_field_mg`` and, where the likelihood has a minimum,
        ``specific_predicted_heading_rms_deg``.
    """
    cloud = normalised(field_mg[None])
    start = ellipsoid_specific(cloud.points)
    sd = field_sd_mg / cloud.scale_mg
    best = sphere_minimum(cloud.points, start, sd)
    matrix, centre = symmetric(best.parameters[:, :6]), best.parameters[:, 6:]
    values = np.linalg.eigvalsh(matrix)[0]
    proper = bool(best.converged[0] and values[0] * LARGEST_AXIS_RATIO > values[2] > 0.0)
    if not proper:
        matrix, centre = start.matrix, start.centre
    residual = sphere_rows(matrix, centre, cloud.points, sd)[0][0] * field_sd_mg
    scale_mg = float(cloud.scale_mg[0])
    offset_mg = cloud.centre_mg[0] + scale_mg * centre[0]
    free_mg = scale_mg / float(np.cbrt(np.linalg.det(matrix[0])))
    found = {"degenerate": 1.0}
    found |= {f"specific_offset_{axis}_mg": float(offset_mg["xyz".index(axis)]) for axis in "xyz"}
    found["specific_residual_rms_mg"] = float(np.sqrt((residual**2).mean()))
    found["specific_field_mg"] = free_mg if strength_mg is None else strength_mg
    if proper:
        covariance = inverted(best.normal).covariance
        one, sine = np.ones(1), np.array([DEFAULT_SINE])
        rms_deg = predicted_at(one, sine, matrix, covariance)[0]
        found["specific_predicted_heading_rms_deg"] = float(rms_deg[0])
    return found
