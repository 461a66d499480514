"""Offset and symmetric matrix of many units from the magnetometer alone, without a loop over them.

Start: Taubin's algebraic ellipsoid (one generalised eigenvalue problem), which is nearly
unbiased in noise. End: Gauss-Newton, damped where it must be, on the Sampson distance, the
first-order maximum likelihood, with the gradient weight differentiated too and analytic
derivatives; a radial cost instead is biased by noise and has a spurious minimum where the
ellipsoid becomes a plane.

References
----------
.. [1] G. Taubin, IEEE Trans. Pattern Analysis 13(11), 1991.
.. [2] P. D. Sampson, Computer Graphics and Image Processing 18, 1982.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.consistency import largest_chi2
from bench.calibration.coverage import COVERED_WITHIN_DEG, sphere_points
from bench.calibration.fit import Cause
from bench.calibration.fitted_ellipsoids import FittedEllipsoids, fitted_ellipsoids
from bench.calibration.least_squares import inverted
from bench.calibration.sphere_fits import (
    SphereCoefficients,
    SphereFits,
    joined,
    neutral_where_refused,
    require_vectors,
)
from bench.calibration.sphere_minimum import UNKNOWNS, one_step, sphere_rows_of
from bench.calibration.sphere_prediction import DEFAULT_SINE, predicted_at, understatement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

    from bench.calibration.taubin import Normalised

SMALLEST: Final = 9
FLAT: Final = 0.03
"""Smallest to largest extent of the readings below which they lie in a plane."""
LARGEST_RESIDUAL: Final = 0.10
LARGEST_PREDICTED_DEG: Final = 3.0
DISTURBED_COVERAGE: Final = 0.6
"""Readings all round that still fit no ellipsoid were not of one field."""
DISTURBED_SPREAD: Final = 0.25
BLOCK: Final = 256
"""Units at a time, so that their derivatives stay in the processor's cache."""
ONE_STEP_DEG: Final = 0.5
"""Predicted RMS up to which coefficients are those of one step: the likelihood is then so nearly
a parabola that it ends within a twentieth of a standard deviation of the minimum."""
DIRECTIONS: Final = 400
DOUBTFUL_DEG: Final = 0.75
"""Predicted RMS above which it is asked how far the prediction itself can be trusted."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Given:
    """What holds for all units: noise, field and the largest chi2_reduced that noise explains.

    `strength_mg` is None where it is free.
    """

    field_sd_mg: float
    strength_mg: float | None
    sine: float
    largest_chi2: float


def ellipsoid_coefficients(
    field_mg: ArrayLike,
    field_sd_mg: float,
    *,
    station_field_mg: ArrayLike | None = None,
    noise_known: bool = True,
) -> SphereCoefficients:
    """Return offset, symmetric matrix and cause of many units: no more than a unit is given.

    The refusals are those of `ellipsoid_batch`, which takes the same arguments and says besides
    what the numbers are worth. Where the readings determine the ellipsoid well, the numbers are
    those of one step from Taubin's (`sphere_minimum.one_step`), as accurate as the minimum's.

    Raises
    ------
    ValueError
        If the shape is another or a value is not finite.

    Examples
    --------
    >>> turned = sphere_points(40) @ np.diag([1.1, 0.9, 1.0]) * 500.0 + [120.0, -60.0, 30.0]
    >>> found = ellipsoid_coefficients(turned, 0.5)
    >>> found.offset_mg.round(3).tolist(), CAUSES[found.cause.item()]
    ([120.0, -60.0, 30.0], None)
    """
    readings = require_vectors("field_mg", field_mg)
    given = _given(readings, field_sd_mg, station_field_mg, noise_known=noise_known)
    blocks = [_quick(block, given) for block in _blocks(readings)]
    return joined(blocks, readings.shape[:-2])


def ellipsoid_batch(
    field_mg: ArrayLike,
    field_sd_mg: float,
    *,
    station_field_mg: ArrayLike | None = None,
    noise_known: bool = True,
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
    noise_known : bool
        Whether `field_sd_mg` is more than a guess: a unit whose residuals it cannot explain
        (`consistency.largest_chi2`) is then refused with RESIDUAL_TOO_LARGE. Which poses are
        to blame, `fit_ellipsoid` names.

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
    given = _given(readings, field_sd_mg, station_field_mg, noise_known=noise_known)
    blocks = [_fits(block, given) for block in _blocks(readings)]
    return joined(blocks, readings.shape[:-2])


def _given(
    readings: NDArray[np.float64],
    field_sd_mg: float,
    station_field_mg: ArrayLike | None,
    *,
    noise_known: bool,
) -> _Given:
    strength_mg, sine = None, DEFAULT_SINE
    if station_field_mg is not None:
        station_mg = np.asarray(station_field_mg, dtype=float)
        strength_mg = float(np.sqrt(station_mg @ station_mg))
        sine = float(station_mg[2]) / strength_mg
    largest = largest_chi2(readings.shape[-2] - UNKNOWNS) if noise_known else np.inf
    return _Given(field_sd_mg=field_sd_mg, strength_mg=strength_mg, sine=sine, largest_chi2=largest)


def _blocks(readings: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    units = readings.reshape(-1, *readings.shape[-2:])
    return (units[first : first + BLOCK] for first in range(0, len(units), BLOCK))


def _quick(field_mg: NDArray[np.float64], given: _Given) -> SphereCoefficients:
    """Return coefficients of one step where that is enough, and of the minimum elsewhere."""
    fitted = fitted_ellipsoids(field_mg, given.field_sd_mg, given.sine, one_step)
    good = _good(fitted, given, ONE_STEP_DEG)
    found = _coefficients(fitted, np.zeros(len(good), dtype=np.int8), given)
    if good.all():
        return found
    rest = np.flatnonzero(~good)
    slow = fitted_ellipsoids(field_mg[rest], given.field_sd_mg, given.sine)
    exact = _coefficients(slow, _causes(slow, given), given)
    for one in fields(exact):
        getattr(found, one.name)[rest] = getattr(exact, one.name)
    return found


def _good(fitted: FittedEllipsoids, given: _Given, largest_deg: float) -> NDArray[np.bool_]:
    """Return which units nothing speaks against, not even the prediction's own uncertainty."""
    cloud, best = fitted.cloud, fitted.best
    if cloud.points.shape[1] < SMALLEST:
        return np.zeros(len(fitted.sd), dtype=bool)
    good = fitted.told & fitted.ellipsoid & _explained(fitted, given)
    good &= best.converged & (fitted.rms_deg <= largest_deg)
    return good & (cloud.extent_ratio >= FLAT) & ~fitted.held


def _explained(fitted: FittedEllipsoids, given: _Given) -> NDArray[np.bool_]:
    """Return whether the residuals are small enough."""
    residual = np.sqrt(fitted.best.chi2 / fitted.cloud.points.shape[1])
    relative = residual * fitted.sd * fitted.determinant
    explained = (relative <= LARGEST_RESIDUAL) & (fitted.chi2_reduced <= given.largest_chi2)
    return np.asarray(explained)


def _causes(fitted: FittedEllipsoids, given: _Given) -> NDArray[np.int8]:
    """Return the first cause that applies to each unit, as its index in CAUSES."""
    cloud, best = fitted.cloud, fitted.best
    cause = np.zeros(len(fitted.sd), dtype=np.int8)
    if _good(fitted, given, DOUBTFUL_DEG).all():
        return cause
    observable = fitted.told & (fitted.rms_deg <= LARGEST_PREDICTED_DEG)
    conditions = {
        Cause.TOO_FEW: np.full(len(cause), cloud.points.shape[1] < SMALLEST),
        Cause.NO_TURN: cloud.still,
        Cause.TILT_TOO_SMALL: cloud.extent_ratio < FLAT,
        Cause.SATURATED: fitted.held,
        Cause.FIELD_DISTURBED: _all_round(cloud, ~fitted.ellipsoid),
        Cause.DEGENERATE: ~fitted.ellipsoid,
        Cause.RESIDUAL_TOO_LARGE: ~_explained(fitted, given),
        Cause.NOT_OBSERVABLE: ~observable,
        Cause.NOT_CONVERGED: ~best.converged,
    }
    codes = [np.int8(CAUSES.index(one)) for one in conditions]
    cause = np.select(list(conditions.values()), codes, cause)
    doubtful = np.flatnonzero((cause == 0) & (fitted.rms_deg > DOUBTFUL_DEG))
    if len(doubtful):
        factor = understatement(sphere_rows_of(cloud.points, fitted.sd), best, doubtful)
        worse = fitted.rms_deg[doubtful] * factor > LARGEST_PREDICTED_DEG
        cause[doubtful[worse]] = CAUSES.index(Cause.NOT_OBSERVABLE)
    return cause


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


def _strength(station_mg: NDArray[np.float64]) -> float:
    return float(np.sqrt(station_mg @ station_mg))


def _coefficients(
    fitted: FittedEllipsoids, cause: NDArray[np.int8], given: _Given
) -> SphereCoefficients:
    cloud = fitted.cloud
    if given.strength_mg is None:
        strength = cloud.scale_mg / fitted.determinant
    else:
        strength = np.full(len(cause), given.strength_mg)
    matrix = fitted.matrix * (strength / cloud.scale_mg)[:, None, None]
    offset_mg = cloud.centre_mg + cloud.scale_mg[:, None] * fitted.best.parameters[:, 6:]
    if cause.any():
        matrix = np.where((cause != 0)[:, None, None], np.eye(3), matrix)
        offset_mg = np.where((cause != 0)[:, None], 0.0, offset_mg)
    return SphereCoefficients(offset_mg=offset_mg, matrix=matrix, field_mg=strength, cause=cause)


def _fits(field_mg: NDArray[np.float64], given: _Given) -> SphereFits:
    fitted = fitted_ellipsoids(field_mg, given.field_sd_mg, given.sine)
    cloud, best, cause = fitted.cloud, fitted.best, _causes(fitted, given)
    found = _coefficients(fitted, cause, given)
    factor = found.field_mg / cloud.scale_mg
    units = np.repeat(np.stack([factor, cloud.scale_mg], axis=1), [6, 3], axis=1)
    covariance = fitted.covariance * units[:, :, None] * units[:, None, :]
    covariance *= np.maximum(fitted.chi2_reduced, 1.0)[:, None, None]
    sine = np.full(len(factor), given.sine)
    max_deg = predicted_at(found.field_mg, sine, found.matrix, covariance)[1]
    seen = inverted(best.normal)
    told_apart = fitted.starts.told_apart
    rank = np.where(told_apart, seen.rank, np.minimum(seen.rank, UNKNOWNS - 1))
    fits = SphereFits(
        offset_mg=found.offset_mg,
        matrix=found.matrix,
        field_mg=found.field_mg,
        covariance=covariance,
        residual_rms_mg=np.sqrt(best.chi2 / cloud.points.shape[1]) * given.field_sd_mg,
        chi2_reduced=fitted.chi2_reduced,
        condition=seen.condition,
        rank=rank,
        predicted_rms_deg=fitted.rms_deg,
        predicted_max_deg=max_deg,
        cause=cause,
    )
    return neutral_where_refused(fits, cause, rank)
