"""Offset and symmetric matrix of many units from the magnetometer alone, without a loop over them.

Start: Taubin's algebraic ellipsoid (one generalised eigenvalue problem), which is nearly
unbiased in noise. End: Levenberg-Marquardt on the Sampson distance, the first-order maximum
likelihood, with the gradient weight differentiated too and analytic derivatives; a radial cost
instead is biased by noise and has a spurious minimum where the ellipsoid becomes a plane.

References
----------
.. [1] G. Taubin, IEEE Trans. Pattern Analysis 13(11), 1991.
.. [2] P. D. Sampson, Computer Graphics and Image Processing 18, 1982.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import COVERED_WITHIN_DEG, sphere_points
from bench.calibration.fit import Cause
from bench.calibration.grid_error import correction_rows, grid_axes, grid_field, predicted_deg
from bench.calibration.least_squares import Inverse, Minimum, Rows, inverted, minimised
from bench.calibration.saturation import saturated
from bench.calibration.sphere_fits import (
    SphereFits,
    joined,
    neutral_where_refused,
    require_vectors,
)
from bench.calibration.sphere_model import (
    SYMMETRIC_COLUMNS,
    SYMMETRIC_ROWS,
    folded,
    sphere_rows,
    symmetric,
)
from bench.calibration.taubin import (
    LARGEST_AXIS_RATIO,
    Normalised,
    TaubinStarts,
    normalised,
    taubin_batch,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

UNKNOWNS: Final = 9
SMALLEST: Final = 9
FLAT: Final = 0.03
"""Smallest to largest extent of the readings below which they lie in a plane."""
LARGEST_RESIDUAL: Final = 0.10
LARGEST_PREDICTED_DEG: Final = 3.0
DISTURBED_COVERAGE: Final = 0.6
"""Readings all round that still fit no ellipsoid were not of one field."""
DISTURBED_SPREAD: Final = 0.25
DEFAULT_SINE: Final = float(np.sin(np.deg2rad(60.0)))
"""Sine of the dip that predictions assume where the station's is not given."""
BLOCK: Final = 512
"""Units at a time, so that their derivatives stay in the processor's cache."""
DIRECTIONS: Final = 400
DOUBTFUL_DEG: Final = 0.75
"""Predicted RMS above which it is asked how far the prediction itself can be trusted."""
PESSIMISM: Final = 5.0
"""Standard deviations by which the estimate may be off in that question."""
CAUSES: Final[tuple[Cause | None, ...]] = (
    None,
    Cause.TOO_FEW,
    Cause.NO_TURN,
    Cause.TILT_TOO_SMALL,
    Cause.SATURATED,
    Cause.FIELD_DISTURBED,
    Cause.DEGENERATE,
    Cause.RESIDUAL_TOO_LARGE,
    Cause.NOT_OBSERVABLE,
    Cause.NOT_CONVERGED,
)
"""Causes by the code that the kernel returns; code 0 is no cause: accepted."""


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
    The predictions do not take the dip from an accelerometer; `predicted_at` does.
    """
    readings = require_vectors("field_mg", field_mg)
    units = readings.reshape(-1, *readings.shape[-2:])
    station = None if station_field_mg is None else np.asarray(station_field_mg, dtype=float)
    blocks = [
        _fitted(units[first : first + BLOCK], field_sd_mg, station)
        for first in range(0, len(units), BLOCK)
    ]
    return joined(blocks, readings.shape[:-2])


def sphere_rows_of(points: NDArray[np.float64], sd: NDArray[np.float64]) -> Rows:
    """Return the Sampson residuals of normalised points (b, n, 3) of noise `sd` (b,) as rows."""

    def rows(
        parameters: NDArray[np.float64], units: NDArray[np.intp]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        residual, by_all = sphere_rows(
            symmetric(parameters[:, :6]), parameters[:, 6:], points[units], sd[units]
        )
        return residual, np.concatenate([folded(by_all[..., :9]), by_all[..., 9:]], axis=-1)

    return rows


def sphere_minimum(
    points: NDArray[np.float64], starts: TaubinStarts, sd: NDArray[np.float64]
) -> Minimum:
    """Return the Sampson minimum of normalised points (b, n, 3) of noise `sd` (b,)."""
    elements = starts.matrix[:, SYMMETRIC_ROWS, SYMMETRIC_COLUMNS]
    start = np.concatenate([elements, starts.centre], axis=1)
    return minimised(sphere_rows_of(points, sd), start)


def _fitted(
    field_mg: NDArray[np.float64], field_sd_mg: float, station_mg: NDArray[np.float64] | None
) -> SphereFits:
    few = field_mg.shape[1] < SMALLEST
    cloud = normalised(field_mg)
    starts = taubin_batch(cloud.points)
    sd = field_sd_mg / cloud.scale_mg
    best = sphere_minimum(cloud.points, starts, sd)
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
        Cause.NO_TURN: cloud.still,
        Cause.TILT_TOO_SMALL: cloud.extent_ratio < FLAT,
        Cause.SATURATED: saturated(field_mg).any(axis=-1),
        Cause.FIELD_DISTURBED: disturbed,
        Cause.DEGENERATE: no_ellipsoid,
        Cause.RESIDUAL_TOO_LARGE: residual * determinant > LARGEST_RESIDUAL,
        Cause.NOT_OBSERVABLE: (rank < UNKNOWNS) | (fits.predicted_rms_deg > LARGEST_PREDICTED_DEG),
        Cause.NOT_CONVERGED: ~best.converged,
    }
    codes = [np.int8(CAUSES.index(cause)) for cause in conditions]
    cause = np.select(list(conditions.values()), codes, np.int8(0)).astype(np.int8)
    doubtful = np.flatnonzero((cause == 0) & (fits.predicted_rms_deg > DOUBTFUL_DEG))
    if len(doubtful):
        growth = _growth(sphere_rows_of(cloud.points, sd), best, doubtful)
        worse = fits.predicted_rms_deg[doubtful] * growth > LARGEST_PREDICTED_DEG
        cause[doubtful[worse]] = CAUSES.index(Cause.NOT_OBSERVABLE)
    return neutral_where_refused(fits, cause, rank)


def _growth(rows: Rows, best: Minimum, units: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return by which factor the prediction could be too small, shape (b,), for some units.

    Where the readings are weak the prediction depends on the estimate's own error: it is
    evaluated one standard deviation to either side along the weakest direction, and continued
    in equal ratios to five.
    """
    normal = best.normal[units]
    scale = np.sqrt(np.diagonal(normal, axis1=1, axis2=2))
    values, vectors = np.linalg.eigh(normal / (scale[:, :, None] * scale[:, None, :]))
    shift = vectors[:, :, 0] / np.sqrt(np.maximum(values[:, :1], 1e-12)) / scale

    def predicted(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        jacobian = rows(parameters, units)[1]
        covariance = inverted(np.swapaxes(jacobian, 1, 2) @ jacobian).covariance
        strength, sine = np.ones(len(units)), np.full(len(units), DEFAULT_SINE)
        return predicted_at(strength, sine, symmetric(parameters[:, :6]), covariance)[0]

    here = predicted(best.parameters[units])
    beside = [predicted(best.parameters[units] + sign * shift) for sign in (1.0, -1.0)]
    return np.asarray((np.maximum(*beside) / here) ** PESSIMISM)


def predicted_at(
    strength: NDArray[np.float64],
    sine: NDArray[np.float64],
    matrix: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return predicted RMS and maximum (deg), shape (b,), in a field of a strength and dip.

    Parameters
    ----------
    strength, sine : ndarray, shape (b,)
        Field strength and sine of the dip.
    matrix, covariance : ndarray, shape (b, 3, 3) and (b, 9, 9)
    """
    rows = correction_rows(*grid_field(grid_axes(), strength, sine), matrix)
    rows = np.concatenate([folded(rows[..., :9]), rows[..., 9:]], axis=-1)
    return predicted_deg(rows, covariance)


def _all_round(cloud: Normalised, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which units, of those asked for, read all round and far beside their centre."""
    spread = cloud.scale_mg / (np.linalg.norm(cloud.centre_mg, axis=1) + cloud.scale_mg)
    units = np.flatnonzero(asked & (spread > DISTURBED_SPREAD))
    lengths = np.linalg.norm(cloud.points[units], axis=-1, keepdims=True)
    directions = cloud.points[units] / np.where(lengths > 0.0, lengths, 1.0)
    near = (sphere_points(DIRECTIONS) @ np.swapaxes(directions, 1, 2)).max(axis=-1)
    found = np.zeros(len(asked), dtype=bool)
    found[units] = (near >= np.cos(np.deg2rad(COVERED_WITHIN_DEG))).mean(axis=-1) > (
        DISTURBED_COVERAGE
    )
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
    sine = np.full(len(strength), DEFAULT_SINE)
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
    rms_deg, max_deg = predicted_at(strength, sine, matrix, covariance)
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
