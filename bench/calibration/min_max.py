"""Offset and scale of the horizontal axes from the extremes of a level turn.

Skula (2)-(3): offset = (max + min)/2 of each axis. Konvalin (1)-(2) is the same. Cho & Park
(5)-(7), (27)-(28) also divide by the half-ranges, which makes the axes' gains equal. What it
leaves: the vertical axis, soft iron off the axes, misalignment, and the tilt of the turn: 0.1
deg between body and level reads as hard iron worth 0.17 deg of heading at dip 60.

The extreme of noisy readings lies outside: of a thousand readings the amplitude is about two
standard deviations too large, on both axes alike, so that heading and offset do not feel it.
The largest reading of a coarse turn lies inside; what that makes unequal is in the covariance.

References
----------
.. [1] D. Skula, "New Method for Magnetometer Offset Compensation", 2010.
.. [2] C. Konvalin, "Compensating for Tilt, Hard-Iron, and Soft-Iron Effects", 2009.
.. [3] S. Y. Cho and C. G. Park, ETRI Journal 27(3), 2005.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import CalibrationData, Cause, Fit
from bench.calibration.level_kernel import (
    LARGEST_AXIS_RATIO,
    SMALLEST_SWING,
    LevelFits,
    accepted_or_neutral,
    circle_of_amplitudes,
    disturbed_units,
    first_cause,
    largest_gap_deg,
    require_readings,
    saturated_units,
    within_range,
)
from bench.calibration.level_turn import AMPLITUDE_PARAMETERS, amplitude_fit, fit_level_turn

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

METHOD: Final = "min_max"
SMALLEST: Final = 4
LARGEST_GAP_DEG: Final = 95.0
"""Largest gap between neighbouring directions of a turn; four quarters still pass."""
LARGEST_RESIDUAL: Final = 0.20
"""RMS distance from the circle, as a part of its radius: more is no turn in one field."""
PARAMETERS: Final = AMPLITUDE_PARAMETERS


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MinMaxFits(LevelFits):
    """Level fits with the half-ranges of x and y.

    Attributes
    ----------
    amplitude_mg : ndarray, shape (..., 2)
    """

    amplitude_mg: NDArray[np.float64]


def fit_min_max(data: CalibrationData) -> Fit:
    """Fit offset and gain of x and y on a level turn.

    Parameters
    ----------
    data : CalibrationData
        Where rig angles or specific force are known, only rows within 5 deg of level count.
        The amplitude becomes the station's horizontal field, or the mean of both amplitudes.

    Returns
    -------
    Fit
        z keeps offset 0 and gain 1. The prediction is for level headings. Refused with
        TOO_FEW, NO_TURN, SATURATED, DEGENERATE, FIELD_DISTURBED or RESIDUAL_TOO_LARGE.

    Examples
    --------
    >>> turn = np.deg2rad(np.arange(0.0, 360.0, 15.0))
    >>> field = np.column_stack([40 + 250 * np.cos(turn), -30 - 200 * np.sin(turn), 0 * turn])
    >>> fit_min_max(CalibrationData(field_mg=field)).offset_mg.round(9).tolist()
    [40.0, -30.0, 0.0]
    """
    return fit_level_turn(METHOD, data, SMALLEST, min_max_batch, _fit_of)


def min_max_batch(
    field_mg: ArrayLike, field_sd_mg: float, *, horizontal_mg: ArrayLike | None = None
) -> MinMaxFits:
    """Fit offset and amplitude of x and y of many units [1]_ (2), without a loop over them.

    Parameters
    ----------
    field_mg : array-like, shape (..., n, 2), n >= 4
        x and y of a level turn in order of time.
    field_sd_mg : float
        Standard deviation of one reading.
    horizontal_mg : array-like, shape (...), optional
        Radius of the corrected circle; else the mean of both amplitudes.

    Returns
    -------
    MinMaxFits
        Covariance of offset x, y and amplitude x, y: the noise of two readings each, times
        chi2_reduced (without a scale common to both axes) where that exceeds 1, and the outer
        product of the errors that the angles between the extreme readings and the axes cause.

    Raises
    ------
    ValueError
        If the shape is another or a value is not finite.
    """
    readings, beyond = within_range(require_readings(field_mg, SMALLEST))
    high, low = readings.max(axis=-2), readings.min(axis=-2)
    offset, amplitude = (high + low) / 2.0, (high - low) / 2.0
    flat = amplitude.min(axis=-1) * LARGEST_AXIS_RATIO <= amplitude.max(axis=-1)
    safe = np.where(flat[..., None], 1.0, amplitude)
    unit = (readings - offset[..., None, :]) / safe[..., None, :]
    mean_mg = safe.mean(axis=-1)
    radial = (np.hypot(unit[..., 0], unit[..., 1]) - 1.0) * mean_mg[..., None]
    # A scale common to both axes is no misfit of the heading.
    spread = radial.var(axis=-1) / field_sd_mg**2
    chi2 = radial.shape[-1] * spread / max(radial.shape[-1] - 4, 1)
    cause = first_cause(
        (Cause.DEGENERATE, beyond),
        *_causes(readings, amplitude, unit, radial, field_sd_mg),
    )
    noise = field_sd_mg**2 / 2.0 * np.maximum(chi2, 1.0)
    coarse = _coarseness_mg(unit, safe)
    covariance = np.eye(4) * noise[..., None, None] + coarse[..., None] * coarse[..., None, :]
    matrix, horizontal = circle_of_amplitudes(amplitude, cause, horizontal_mg)
    offset, matrix, covariance = accepted_or_neutral(cause, offset, matrix, covariance)
    return MinMaxFits(
        offset_mg=offset,
        matrix=matrix,
        horizontal_mg=horizontal,
        covariance=covariance,
        residual_rms_mg=np.sqrt((radial**2).mean(axis=-1)),
        chi2_reduced=chi2,
        gap_deg=largest_gap_deg(unit),
        cause=cause,
        amplitude_mg=amplitude,
    )


def _causes(
    readings: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    unit: NDArray[np.float64],
    radial: NDArray[np.float64],
    field_sd_mg: float,
) -> tuple[tuple[Cause, NDArray[np.bool_]], ...]:
    """Return causes and the units, shape (...), where each holds; the first one counts."""
    largest, mean_mg = amplitude.max(axis=-1), amplitude.mean(axis=-1)
    residual = np.sqrt((radial**2).mean(axis=-1))
    return (
        (Cause.NO_TURN, np.asarray(largest < SMALLEST_SWING * field_sd_mg)),
        (Cause.SATURATED, saturated_units(readings)),
        (Cause.DEGENERATE, np.asarray(amplitude.min(axis=-1) * LARGEST_AXIS_RATIO <= largest)),
        (Cause.NO_TURN, np.asarray(largest_gap_deg(unit) > LARGEST_GAP_DEG)),
        (Cause.FIELD_DISTURBED, disturbed_units(radial, unit, mean_mg, field_sd_mg)),
        (Cause.RESIDUAL_TOO_LARGE, np.asarray(residual > LARGEST_RESIDUAL * mean_mg)),
    )


def _coarseness_mg(
    unit: NDArray[np.float64], amplitude: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return, shape (..., 4), the parameters' errors where no reading lies on an axis.

    A reading d off the axis has an extreme too small by A (1 - cos d); alike at both ends it
    leaves the offset, alike on both axes it leaves the heading.
    """
    missed = []
    for extreme in (unit.argmax(axis=-2), unit.argmin(axis=-2)):
        across = np.take_along_axis(unit[..., ::-1], extreme[..., None, :], axis=-2)[..., 0, :]
        missed.append(1.0 - np.sqrt(np.maximum(1.0 - across**2, 0.0)))
    offset = (missed[1] - missed[0]) / 2.0 * amplitude
    half_range = -(missed[0] + missed[1]) / 2.0 * amplitude
    return np.concatenate([offset, half_range], axis=-1)


def _fit_of(fits: MinMaxFits, field_mg: NDArray[np.float64]) -> Fit:
    dof = max(len(field_mg) - 4, 1)
    return amplitude_fit(METHOD, fits, field_mg, fits.amplitude_mg, dof=dof)
