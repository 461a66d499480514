"""What set and reset readings say of field, bridge offset, cross-axis term and straps.

A bridge reads set = S H/(1 + C/Hk) + b and reset = -S H/(1 - C/Hk) + b, with C the field along
the film's other axis. Half the difference is the field; half the sum is **not** the offset: to
first order in C/Hk it is

    (set + reset)/2 = b - H C/Hk + a H

where a is half the difference of the gains after set and after reset. The middle term is up to
2.5 mG (0.7 deg) that turns with the heading, and averaging over headings does not remove it
where there is hard iron. So half the sum is regressed on 1, H C and H.

The field's own cross-axis term, 1/(1 - (C/Hk)^2), is 0.1 % at 250 mG and 8 G; it stays here, and
`cross_axis` takes it out with the Hk found.

References
----------
.. [1] M. J. Caruso, PLANS 2000, equations (5)-(7).
.. [2] D. Skula, "New Method for Magnetometer Offset Compensation", 2010, equation (1).
.. [3] P. Ripka et al., Sensors and Actuators A 2006: cross-axis term of AMR bridges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.crossed_field import CROSS_AXIS
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.level_kernel import LARGEST_MG, first_cause, refused_cause
from bench.calibration.saturation import STOPPED, saturated

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

METHOD: Final = "set_reset"
AXES: Final = "xyz"
SMALLEST: Final = 4
SMALLEST_WITH_GAIN: Final = 6
SMALLEST_PRODUCT_MG2: Final = 5000.0
"""Range of H C below which Hk is left out."""
SMALLEST_SWING: Final = 0.1
"""Range of H, as a part of its largest value, below which the gains' difference is left out."""
NOT_FLIPPING: Final = 0.2
"""Range of the half difference against that of the half sum below which a strap is dead."""
MG_PER_G: Final = 1000.0
PARAMETERS: Final = tuple(f"bridge_offset_{axis}_mg" for axis in AXES)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SetResetFits:
    """What the pairs of many units tell; arrays have shape (..., 3), for x, y, z of each unit.

    Attributes
    ----------
    bridge_offset_mg, bridge_offset_sd_mg : ndarray
        Offset of the bridge without the cross-axis term.
    hk_g, hk_sd_g : ndarray
        Film anisotropy field; where `hk_observed` is False a lower bound (two standard
        deviations, 0 where the fields do not excite it), and its standard deviation is 0.
    hk_observed, cross_fitted, gain_fitted : ndarray of bool
        Whether the cross-axis term stands out from the noise; whether it, and the gains'
        difference, are excited enough to be in the regression.
    cross_per_mg, cross_sd_per_mg, asymmetry : ndarray
        Coefficient of H C (that is -1/Hk), its standard deviation, and coefficient of H; 0 where
        left out.
    amplitude_mg : ndarray
        Largest |set - reset|/2.
    symmetry : ndarray
        Gain after set over gain after reset: 1 for a sound strap, 0 where the reading does
        not flip at all.
    residual_rms_mg : ndarray
        RMS of the half sum that the regression leaves.
    cause : ndarray of int8, shape (...)
        Index into level_kernel.CAUSES; 0 is accepted.
    """

    bridge_offset_mg: NDArray[np.float64]
    bridge_offset_sd_mg: NDArray[np.float64]
    hk_g: NDArray[np.float64]
    hk_sd_g: NDArray[np.float64]
    hk_observed: NDArray[np.bool_]
    cross_fitted: NDArray[np.bool_]
    gain_fitted: NDArray[np.bool_]
    cross_per_mg: NDArray[np.float64]
    cross_sd_per_mg: NDArray[np.float64]
    asymmetry: NDArray[np.float64]
    amplitude_mg: NDArray[np.float64]
    symmetry: NDArray[np.float64]
    residual_rms_mg: NDArray[np.float64]
    cause: NDArray[np.int8]


def fit_set_reset(data: CalibrationData) -> Fit:
    """Take the pairs as they are: the field is half their difference, offset 0, matrix 1.

    Parameters
    ----------
    data : CalibrationData
        Needs `offset_mg`, half the sum of each pair.

    Returns
    -------
    Fit
        `extra` holds ``bridge_offset_x_mg`` and ``hk_x_g`` of each axis with ``_sd``, or
        ``hk_x_g_min`` where Hk is too large to be seen; the covariance is that of the bridge
        offsets. Nothing is predicted: hard and soft iron stay. Refused with NO_SET_RESET,
        TOO_FEW, SATURATED or DEGENERATE (a strap that does not flip its film).
    """
    if data.offset_mg is None:
        message = "set/reset needs set and reset readings; instead received single readings"
        return refusal(METHOD, Cause.NO_SET_RESET, message, data)
    if len(data) < SMALLEST:
        message = f"set/reset needs at least {SMALLEST} pairs; instead received {len(data)}"
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    fits = set_reset_batch(data.field_mg, data.offset_mg)
    cause = refused_cause(fits.cause)
    if cause is not None:
        dead = " and ".join(AXES[axis] for axis in range(3) if fits.symmetry[axis] == 0.0)
        message = (
            f"an axis {STOPPED}"
            if cause is Cause.SATURATED
            else f"half the difference of set and reset does not follow the field on "
            f"{dead or 'any axis'}: the strap does not flip the film, or the field is too small"
        )
        return refusal(METHOD, cause, message, data)
    return _fit_of(data, fits)


def set_reset_batch(field_mg: ArrayLike, offset_mg: ArrayLike) -> SetResetFits:
    """Regress half the sum of the pairs of many units and all axes, without a loop over units.

    Parameters
    ----------
    field_mg, offset_mg : array-like, shape (..., n, 3), n >= 4
        Half the difference and half the sum of set and reset readings at several headings.

    Raises
    ------
    ValueError
        If there are fewer than 4 readings, shapes differ, or a value is not finite.
    """
    field, half_sum, beyond = _readings(field_mg, offset_mg)
    along = np.ascontiguousarray(np.swapaxes(field, -1, -2))
    across = np.take(along, CROSS_AXIS, axis=-2)
    total = np.ascontiguousarray(np.swapaxes(half_sum, -1, -2))
    count = along.shape[-1]
    largest = np.abs(along).max(axis=-1)
    dead, steady = _not_flipping(along, total)
    cross = np.ptp(along * across, axis=-1) >= SMALLEST_PRODUCT_MG2
    swings = np.ptp(along, axis=-1) > SMALLEST_SWING * largest
    gain = cross & swings & ~dead & (count >= SMALLEST_WITH_GAIN)
    solution, covariance, rms = _regressed(along, across, total, cross, gain)
    offset_slope = np.zeros_like(solution)
    offset_slope[..., 0], offset_slope[..., 2] = 1.0, -along.mean(axis=-1)
    ratio = np.clip(solution[..., 2], -0.999, 0.999)
    symmetry = np.where(dead, np.where(steady, 1.0, 0.0), (1.0 + ratio) / (1.0 - ratio))
    slope_sd = np.sqrt(covariance[..., 1, 1])
    hk_g, hk_sd_g, observed = _hk_g(solution[..., 1] * MG_PER_G, slope_sd * MG_PER_G, cross)
    offset_variance = np.einsum("...p,...pq,...q->...", offset_slope, covariance, offset_slope)
    return SetResetFits(
        bridge_offset_mg=(solution * offset_slope).sum(axis=-1),
        bridge_offset_sd_mg=np.sqrt(np.maximum(offset_variance, 0.0)),
        hk_g=hk_g,
        hk_sd_g=hk_sd_g,
        hk_observed=observed,
        cross_fitted=cross,
        gain_fitted=gain,
        cross_per_mg=solution[..., 1],
        cross_sd_per_mg=slope_sd,
        asymmetry=solution[..., 2],
        amplitude_mg=largest,
        symmetry=symmetry,
        residual_rms_mg=rms,
        cause=first_cause(
            (Cause.DEGENERATE, beyond),
            (Cause.SATURATED, np.asarray(saturated(field).any(axis=-1))),
            (Cause.DEGENERATE, np.asarray((dead & ~steady).any(axis=-1))),
        ),
    )


def field_and_offset_mg(
    set_mg: NDArray[np.float64], reset_mg: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return ((set - reset)/2, (set + reset)/2), each of the readings' shape [1]_ [2]_.

    >>> field, offset = field_and_offset_mg(np.array([130.0]), np.array([-70.0]))
    >>> field.item(), offset.item()
    (100.0, 30.0)
    """
    return (set_mg - reset_mg) / 2.0, (set_mg + reset_mg) / 2.0


def check_set_reset(set_mg: NDArray[np.float64], reset_mg: NDArray[np.float64]) -> SetResetFits:
    """Estimate bridge offset, Hk and strap symmetry of each axis from the readings themselves.

    Parameters
    ----------
    set_mg, reset_mg : ndarray, shape (..., n, 3), n >= 4
        Readings at several headings (24 of a level turn, or all poses).

    Raises
    ------
    ValueError
        If there are fewer than 4 readings, shapes differ, or a value is not finite.
    """
    set_mg, reset_mg = np.asarray(set_mg, dtype=float), np.asarray(reset_mg, dtype=float)
    if set_mg.shape != reset_mg.shape:
        message = (
            f"set_mg and reset_mg must be of one shape; instead received {set_mg.shape} and "
            f"{reset_mg.shape}"
        )
        raise ValueError(message)
    return set_reset_batch(*field_and_offset_mg(set_mg, reset_mg))


def _readings(
    field_mg: ArrayLike, offset_mg: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return both as arrays, 0 for units beyond any sensor's range, and which units those are."""
    field, half_sum = np.asarray(field_mg, dtype=float), np.asarray(offset_mg, dtype=float)
    shape = field.shape
    if shape != half_sum.shape or len(shape) < 2 or shape[-1] != 3 or shape[-2] < SMALLEST:
        message = (
            f"field_mg and offset_mg must be of one shape (..., n, 3) with n >= {SMALLEST}; "
            f"instead received {shape} and {half_sum.shape}"
        )
        raise ValueError(message)
    if not (np.isfinite(field).all() and np.isfinite(half_sum).all()):
        message = "field_mg and offset_mg must be finite; instead received a value that is not"
        raise ValueError(message)
    beyond = np.maximum(np.abs(field), np.abs(half_sum)).max(axis=(-1, -2)) > LARGEST_MG
    hidden = beyond[..., None, None]
    return np.where(hidden, 0.0, field), np.where(hidden, 0.0, half_sum), np.asarray(beyond)


def _not_flipping(
    along: NDArray[np.float64], total: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where the field hardly changes, and where it is at least there: steady, not dead."""
    largest_sum = np.abs(total).max(axis=-1)
    swing = np.maximum(np.ptp(total, axis=-1), 0.01 * largest_sum)
    still = np.ptp(along, axis=-1) < NOT_FLIPPING * swing
    steady = np.abs(along).max(axis=-1) > NOT_FLIPPING * largest_sum
    return np.asarray(still), np.asarray(steady)


def _regressed(
    along: NDArray[np.float64],
    across: NDArray[np.float64],
    total: NDArray[np.float64],
    cross: NDArray[np.bool_],
    gain: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return coefficients (..., 3, 3) of 1, H C and centred H, their covariance, and RMS left."""
    product = np.where(cross[..., None], along * across, 0.0)
    centred = np.where(gain[..., None], along - along.mean(axis=-1, keepdims=True), 0.0)
    columns = np.stack([np.ones_like(along), product, centred], axis=-1)
    scale = np.maximum(np.linalg.norm(columns, axis=-2), 1e-12)
    scaled = columns / scale[..., None, :]
    transposed = np.swapaxes(scaled, -1, -2)
    # A column left out has neither pivot nor product: its coefficient is 0.
    inverse = np.linalg.pinv(transposed @ scaled, rcond=1e-12, hermitian=True)
    solution = (inverse @ (transposed @ total[..., None]))[..., 0]
    residual = total - (scaled @ solution[..., None])[..., 0]
    freedom = np.maximum(along.shape[-1] - 1 - cross.astype(int) - gain, 1)
    variance = (residual**2).sum(axis=-1) / freedom
    covariance = inverse * variance[..., None, None]
    covariance = covariance / (scale[..., :, None] * scale[..., None, :])
    return solution / scale, covariance, np.sqrt((residual**2).mean(axis=-1))


def _hk_g(
    slope: NDArray[np.float64], sd: NDArray[np.float64], fitted: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return Hk, its standard deviation and whether it is observed, of slopes in 1/G."""
    size = np.abs(slope)
    observed = fitted & (size > 2.0 * sd) & (size > 1e-9)
    safe = np.where(observed, size, 1.0)
    bound = np.where(fitted, 1.0 / np.maximum(size + 2.0 * sd, 1e-3), 0.0)
    hk_g = np.where(observed, 1.0 / safe, bound)
    return hk_g, np.where(observed, sd / safe**2, 0.0), np.asarray(observed)


def _fit_of(data: CalibrationData, fits: SetResetFits) -> Fit:
    extra: dict[str, float] = {}
    for index, axis in enumerate(AXES):
        extra[f"bridge_offset_{axis}_mg"] = float(fits.bridge_offset_mg[index])
        extra[f"bridge_offset_{axis}_mg_sd"] = float(fits.bridge_offset_sd_mg[index])
        if fits.hk_observed[index]:
            extra[f"hk_{axis}_g"] = float(fits.hk_g[index])
            extra[f"hk_{axis}_g_sd"] = float(fits.hk_sd_g[index])
        elif fits.cross_fitted[index]:
            extra[f"hk_{axis}_g_min"] = float(fits.hk_g[index])
    dof = 3 * (len(data) - 1) - int(fits.cross_fitted.sum()) - int(fits.gain_fitted.sum())
    squares = float((fits.residual_rms_mg**2).sum()) * len(data)
    return Fit(
        method=METHOD,
        message="the pairs alone: hard and soft iron, gains and misalignment stay",
        samples=len(data),
        offset_mg=np.zeros(3),
        matrix=np.eye(3),
        parameters=PARAMETERS,
        covariance=np.diag(fits.bridge_offset_sd_mg**2),
        residual_rms_mg=float(np.sqrt((fits.residual_rms_mg**2).mean())),
        chi2_reduced=squares / data.field_sd_mg**2 / max(dof, 1),
        dof=dof,
        extra=extra,
    )
