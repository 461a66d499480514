"""Offset and symmetric matrix of many units from the magnetometer alone, without a loop over them.

Taubin's ellipsoid as the start and the Sampson distance with its weight differentiated, as in
`bench.calibration.ellipsoid`; here with analytic derivatives.

References
----------
.. [1] G. Taubin, IEEE Trans. Pattern Analysis 13(11), 1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import sphere_coverage
from bench.calibration.ellipsoid import (
    DISTURBED_COVERAGE,
    DISTURBED_SPREAD,
    FLAT,
    LARGEST_AXIS_RATIO,
    LARGEST_PREDICTED_DEG,
    LARGEST_RESIDUAL,
    SECOND_QUADRIC,
    SMALLEST,
    SMALLEST_SECOND,
)
from bench.calibration.fit import Cause
from bench.calibration.grid_error import correction_rows, grid_axes, grid_field, predicted_deg
from bench.calibration.least_squares import Inverse, Minimum, inverted, minimised
from bench.calibration.prediction import DEFAULT_FIELD_MG
from bench.calibration.saturation import saturated
from bench.calibration.sphere_model import (
    SYMMETRIC_COLUMNS,
    SYMMETRIC_ROWS,
    folded,
    sphere_rows,
    symmetric,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

UNKNOWNS: Final = 9
BLOCK: Final = 512
"""Units at a time, so that their derivatives stay in the processor's cache."""
LARGEST_MG: Final = 1e7
SMALLEST_DETERMINANT: Final = 1e-12
CAUSES: Final[tuple[Cause | None, ...]] = (
    None,
    Cause.TOO_FEW,
    Cause.NO_TURN,
    Cause.TILT_TOO_SMALL,
    Cause.SATURATED,
    Cause.FIELD_DISTURBED,
    Cause.DEGENERATE,
    Cause.NOT_CONVERGED,
    Cause.RESIDUAL_TOO_LARGE,
    Cause.NOT_OBSERVABLE,
)
"""Causes by the code that the kernel returns; code 0 is no cause: accepted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SphereFits:
    """Coefficients of many units; the leading axes (...) are units.

    corrected = matrix @ (raw - offset_mg) lies on a sphere of radius `field_mg`. A refused unit
    keeps offset 0, matrix 1 and covariance 0 beside its cause, never a NaN.

    Attributes
    ----------
    offset_mg, matrix : ndarray, shape (..., 3) and (..., 3, 3)
    field_mg : ndarray, shape (...)
    covariance : ndarray, shape (..., p, p)
        Of the method's PARAMETERS; the weights' own times chi2_reduced where that exceeds 1.
    residual_rms_mg, chi2_reduced, condition : ndarray, shape (...)
        RMS distance from the ellipsoid, sum of squares over the degrees of freedom, condition
        of the scaled Jacobian.
    rank : ndarray of int, shape (...)
    predicted_rms_deg, predicted_max_deg : ndarray, shape (...)
        Heading error to expect over the verification grid.
    cause : ndarray of int8, shape (...)
        Index into the method's CAUSES; 0 is accepted.
    """

    offset_mg: NDArray[np.float64]
    matrix: NDArray[np.float64]
    field_mg: NDArray[np.float64]
    covariance: NDArray[np.float64]
    residual_rms_mg: NDArray[np.float64]
    chi2_reduced: NDArray[np.float64]
    condition: NDArray[np.float64]
    rank: NDArray[np.intp]
    predicted_rms_deg: NDArray[np.float64]
    predicted_max_deg: NDArray[np.float64]
    cause: NDArray[np.int8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Normalised:
    """Readings (b, n, 3) centred and divided by their RMS length, with both."""

    points: NDArray[np.float64]
    centre_mg: NDArray[np.float64]
    scale_mg: NDArray[np.float64]
    extent_ratio: NDArray[np.float64]
    usable: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TaubinStarts:
    """Taubin's ellipsoids |M (x - c)| = 1 of normalised readings; 1 and 0 where there is none."""

    matrix: NDArray[np.float64]
    centre: NDArray[np.float64]
    found: NDArray[np.bool_]
    told_apart: NDArray[np.bool_]


def ellipsoid_batch(
    field_mg: ArrayLike,
    field_sd_mg: float,
    *,
    station_field_mg: ArrayLike | None = None,
) -> SphereFits:
    """Fit offset and symmetric matrix (9 parameters) of many units.

    Parameters
    ----------
    field_mg : array-like, shape (..., n, 3)
        Raw readings; n is the same for all units.
    field_sd_mg : float
        Standard deviation of one reading, each axis.
    station_field_mg : array-like, shape (3,), optional
        Field in NED: its strength is the sphere's radius, its dip that of the prediction.
        Without it the radius is that of a matrix of determinant one, and the dip 60 deg.

    Returns
    -------
    SphereFits
        Covariance of `ellipsoid.PARAMETERS`, with the strength held.

    Raises
    ------
    ValueError
        If the shape is another or a value is not finite.

    Notes
    -----
    Unlike `fit_ellipsoid` the predictions do not take the dip from an accelerometer.
    """
    readings = require_vectors("field_mg", field_mg)
    units = readings.reshape(-1, *readings.shape[-2:])
    station = None if station_field_mg is None else np.asarray(station_field_mg, dtype=float)
    blocks = [
        _fitted(units[first : first + BLOCK], field_sd_mg, station)
        for first in range(0, len(units), BLOCK)
    ]
    return joined(blocks, readings.shape[:-2])


def require_vectors(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return values as a finite array of shape (..., n, 3).

    Raises
    ------
    ValueError
        If the shape is another or a value is not finite.
    """
    vectors = np.asarray(values, dtype=float)
    if vectors.ndim < 2 or vectors.shape[-1] != 3 or not vectors.size:
        message = f"{name} must have the shape (..., n, 3); instead received {vectors.shape}"
        raise ValueError(message)
    if not np.isfinite(vectors).all():
        message = f"{name} must be finite; instead received a value that is not"
        raise ValueError(message)
    return vectors


def joined(blocks: list[SphereFits], shape: tuple[int, ...]) -> SphereFits:
    """Return blocks of fits, each with one unit axis, as one with unit axes of a shape."""

    def whole(name: str) -> NDArray[np.float64]:
        values = np.concatenate([getattr(block, name) for block in blocks])
        return values.reshape(*shape, *values.shape[1:])

    return SphereFits(**{name: whole(name) for name in SphereFits.__slots__})


def normalised(field_mg: NDArray[np.float64]) -> Normalised:
    """Return readings, shape (b, n, 3), centred and of RMS length 1; `usable` where they vary."""
    beyond = np.abs(field_mg).max(axis=(1, 2)) > LARGEST_MG
    readings = np.where(beyond[:, None, None], 0.0, field_mg)
    centre_mg = readings.mean(axis=1)
    points = readings - centre_mg[:, None, :]
    scale_mg = np.sqrt(np.einsum("bni,bni->b", points, points) / field_mg.shape[1])
    still = scale_mg <= 1e-12 * (1.0 + np.abs(centre_mg).max(axis=1))
    scale_mg = np.where(still, 1.0, scale_mg)
    points = points / scale_mg[:, None, None]
    spread = np.linalg.eigvalsh(np.swapaxes(points, 1, 2) @ points)
    ratio = np.sqrt(np.maximum(spread[:, 0], 0.0) / np.maximum(spread[:, 2], 1e-300))
    return Normalised(
        points=points,
        centre_mg=centre_mg,
        scale_mg=scale_mg,
        extent_ratio=np.where(still, 0.0, ratio),
        usable=~still,
    )


def taubin_batch(points: NDArray[np.float64]) -> TaubinStarts:
    """Return Taubin's ellipsoids [1]_ of normalised points, shape (b, n, 3).

    The points must be centred: terms of first order in the gradients' moments are then zero.
    """
    x, y, z = np.moveaxis(points, -1, 0)
    squares = [x * x, y * y, z * z, 2.0 * x * y, 2.0 * x * z, 2.0 * y * z]
    terms = np.stack([*squares, x, y, z], axis=-1)
    mean = terms.mean(axis=1)
    centred = terms - mean[:, None, :]
    moments = np.swapaxes(centred, 1, 2) @ centred / points.shape[1]
    weights = _gradient_moments(np.swapaxes(points, 1, 2) @ points / points.shape[1])
    values, vectors = np.linalg.eigh(weights)
    flat = values[:, 0] < 1e-9 * values[:, -1]
    half = vectors / np.sqrt(np.maximum(values, 1e-9 * values[:, -1:]))[:, None, :]
    whitened = np.concatenate(
        [np.swapaxes(half, 1, 2) @ moments[:, :6], moments[:, 6:]], axis=1
    )
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
    return vectors * roots[:, None, :] @ np.swapaxes(vectors, 1, 2), centre, found


def sphere_minimum(
    points: NDArray[np.float64], starts: TaubinStarts, sd: NDArray[np.float64]
) -> Minimum:
    """Return the Sampson minimum of normalised points (b, n, 3) of noise `sd` (b,)."""

    def rows(
        parameters: NDArray[np.float64], units: NDArray[np.intp]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        residual, by_all = sphere_rows(
            symmetric(parameters[:, :6]), parameters[:, 6:], points[units], sd[units]
        )
        return residual, np.concatenate([folded(by_all[..., :9]), by_all[..., 9:]], axis=-1)

    elements = starts.matrix[:, SYMMETRIC_ROWS, SYMMETRIC_COLUMNS]
    return minimised(rows, np.concatenate([elements, starts.centre], axis=1))


def _fitted(
    field_mg: NDArray[np.float64], field_sd_mg: float, station_mg: NDArray[np.float64] | None
) -> SphereFits:
    few = field_mg.shape[1] < SMALLEST
    cloud = normalised(field_mg)
    starts = taubin_batch(cloud.points)
    best = sphere_minimum(cloud.points, starts, field_sd_mg / cloud.scale_mg)
    found = inverted(best.normal)
    rank = np.where(starts.told_apart, found.rank, np.minimum(found.rank, UNKNOWNS - 1))
    values = np.linalg.eigvalsh(symmetric(best.parameters[:, :6]))
    ratio_fits = (values[:, 0] > 0.0) & (values[:, 2] <= LARGEST_AXIS_RATIO * values[:, 0])
    determinant = np.where(ratio_fits, values.prod(axis=1), 1.0) ** (1.0 / 3.0)
    residual = np.sqrt(best.chi2 / field_mg.shape[1]) * field_sd_mg / cloud.scale_mg
    fits = _in_mg(cloud, best, found, determinant, field_sd_mg, station_mg, ratio_fits)
    no_ellipsoid = ~(starts.found & (ratio_fits | ~best.converged))
    disturbed = _all_round(cloud, no_ellipsoid)
    conditions = {
        Cause.TOO_FEW: np.full(len(field_mg), few),
        Cause.NO_TURN: ~cloud.usable,
        Cause.TILT_TOO_SMALL: cloud.extent_ratio < FLAT,
        Cause.SATURATED: saturated(field_mg).any(axis=-1),
        Cause.FIELD_DISTURBED: disturbed,
        Cause.DEGENERATE: no_ellipsoid,
        Cause.NOT_CONVERGED: ~best.converged,
        Cause.RESIDUAL_TOO_LARGE: residual * determinant > LARGEST_RESIDUAL,
        Cause.NOT_OBSERVABLE: (rank < UNKNOWNS) | (fits.predicted_rms_deg > LARGEST_PREDICTED_DEG),
    }
    codes = [np.int8(CAUSES.index(cause)) for cause in conditions]
    cause = np.select(list(conditions.values()), codes, np.int8(0)).astype(np.int8)
    return neutral_where_refused(fits, cause, rank)


def _all_round(cloud: Normalised, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which units, of those asked for, read all round and far beside their centre."""
    spread = cloud.scale_mg / (np.linalg.norm(cloud.centre_mg, axis=1) + cloud.scale_mg)
    found = np.zeros(len(asked), dtype=bool)
    for unit in np.flatnonzero(asked & (spread > DISTURBED_SPREAD)):
        found[unit] = sphere_coverage(cloud.points[unit]) > DISTURBED_COVERAGE
    return found


def _in_mg(
    cloud: Normalised,
    best: Minimum,
    found: Inverse,
    determinant: NDArray[np.float64],
    field_sd_mg: float,
    station_mg: NDArray[np.float64] | None,
    usable: NDArray[np.bool_],
) -> SphereFits:
    count = cloud.points.shape[1]
    strength = cloud.scale_mg / determinant
    sine = np.full(len(strength), np.sin(np.deg2rad(60.0)))
    if station_mg is not None:
        strength = np.full(len(strength), float(np.linalg.norm(station_mg)))
        sine = np.full(len(strength), float(station_mg[2]) / strength[0])
    factor = strength / cloud.scale_mg
    matrix = symmetric(best.parameters[:, :6]) * factor[:, None, None]
    matrix = np.where(usable[:, None, None], matrix, np.eye(3))
    chi2 = best.chi2 / max(count - UNKNOWNS, 1)
    units = np.repeat(np.stack([factor, cloud.scale_mg], axis=1), [6, 3], axis=1)
    covariance = found.covariance * units[:, :, None] * units[:, None, :]
    covariance = covariance * np.maximum(chi2, 1.0)[:, None, None]
    rows = correction_rows(*grid_field(grid_axes(), strength, sine), matrix)
    rows = np.concatenate([folded(rows[..., :9]), rows[..., 9:]], axis=-1)
    rms_deg, max_deg = predicted_deg(rows, covariance)
    return SphereFits(
        offset_mg=cloud.centre_mg + cloud.scale_mg[:, None] * best.parameters[:, 6:],
        matrix=matrix,
        field_mg=strength,
        covariance=covariance,
        residual_rms_mg=np.sqrt(best.chi2 / count) * field_sd_mg,
        chi2_reduced=chi2,
        condition=found.condition,
        rank=found.rank,
        predicted_rms_deg=rms_deg,
        predicted_max_deg=max_deg,
        cause=np.zeros(len(strength), dtype=np.int8),
    )


def neutral_where_refused(
    fits: SphereFits, cause: NDArray[np.int8], rank: NDArray[np.intp]
) -> SphereFits:
    """Return the fits with cause and rank, and offset 0, matrix 1, covariance 0 where refused."""
    refused = cause != 0
    return SphereFits(
        offset_mg=np.where(refused[:, None], 0.0, fits.offset_mg),
        matrix=np.where(refused[:, None, None], np.eye(3), fits.matrix),
        field_mg=fits.field_mg,
        covariance=np.where(refused[:, None, None], 0.0, fits.covariance),
        residual_rms_mg=np.where(np.isfinite(fits.residual_rms_mg), fits.residual_rms_mg, 0.0),
        chi2_reduced=np.where(np.isfinite(fits.chi2_reduced), fits.chi2_reduced, 0.0),
        condition=fits.condition,
        rank=rank,
        predicted_rms_deg=np.where(refused, 0.0, fits.predicted_rms_deg),
        predicted_max_deg=np.where(refused, 0.0, fits.predicted_max_deg),
        cause=cause,
    )
