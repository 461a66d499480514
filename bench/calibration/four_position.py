"""Offset and amplitude of the horizontal axes from four positions a quarter turn apart.

Skula (4): H1 = A sin(alpha) + c, H2 = A cos(alpha) + c, H3 = -A sin(alpha) + c and
H4 = -A cos(alpha) + c, in each axis, with c the offset, A the amplitude and alpha the angle of
the first position, which may be any. His (5)-(6) are not used as printed: arctan makes A
negative at half of all alpha, then 'or 1, what is bigger' in (7) drops the scale, and c from
H1 and H3 alone takes in a second harmonic. Here A = hypot(H1 - H3, H2 - H4)/2,
alpha = atan2(H1 - H3, H2 - H4) and c is the mean of the four.

A second harmonic of an axis drops out of the mean of four; of a fourth one, which a whole turn
averages, four readings see all.

References
----------
.. [1] D. Skula, "New Method for Magnetometer Offset Compensation", 2010, equations (4)-(7).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.level_kernel import (
    LARGEST_AXIS_RATIO,
    SMALLEST_SWING,
    LevelFits,
    accepted_or_neutral,
    circle_of_amplitudes,
    first_cause,
    reading_covariance,
    refused_cause,
    require_readings,
    within_range,
)
from bench.calibration.level_turn import (
    amplitude_fit,
    level_rows,
    refused_fit,
    refused_rows,
    station_horizontal_mg,
)
from protocols.angles import wrap_180_deg, wrap_360_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

METHOD: Final = "four_position"
POSITIONS: Final = 4
SQUARE_DEG: Final = 1.0
"""Largest error of a position against a quarter turn."""
LARGEST_MISCLOSURE: Final = float(np.sin(np.deg2rad(SQUARE_DEG))) / 4.0
"""Largest |H1 - H2 + H3 - H4|/4 beyond noise, as a part of the amplitude: 0 if square, this if
one position is off by 1 deg."""
LARGEST_CHANGE: Final = 2.0 * LARGEST_MISCLOSURE
"""The same where the rig says that they are square: a field that changed by 3 %."""
LARGEST_SKEW_DEG: Final = 20.0
"""Largest difference of both axes' alpha from 90 deg; soft iron makes some of it too."""
SIGMA: Final = 4.0
QUARTERS_RAD: Final = np.arange(POSITIONS) * np.pi / 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FourPositionFits(LevelFits):
    """Level fits with A and alpha of Skula (4).

    Attributes
    ----------
    amplitude_mg, alpha_deg : ndarray, shape (..., 2)
        A and alpha of x and y; alpha in (-180, 180].
    misclosure_mg : ndarray, shape (..., 2)
        (H1 - H2 + H3 - H4)/4: 0 for exact quarter turns in one field.
    skew_deg : ndarray, shape (...)
        By how much both axes' alpha differ from 90 deg.
    """

    amplitude_mg: NDArray[np.float64]
    alpha_deg: NDArray[np.float64]
    misclosure_mg: NDArray[np.float64]
    skew_deg: NDArray[np.float64]


def fit_four_position(data: CalibrationData) -> Fit:
    """Fit offset and gain of x and y on four level positions, from any first one.

    Parameters
    ----------
    data : CalibrationData
        Taken are the first level row and the first ones within 1 deg of a quarter, a half and
        three quarters of a turn from it by the rig's azimuth. Without azimuths the level rows
        must be four in order, or a whole number of fours evenly spread over one turn; whether
        they are square is then seen from the readings alone.

    Returns
    -------
    Fit
        z keeps offset 0 and gain 1. Refused with TOO_FEW, NO_TURN, SATURATED, DEGENERATE,
        POSITIONS_NOT_SQUARE or FIELD_DISTURBED (positions square by the rig, readings not).

    Examples
    --------
    >>> turn = np.deg2rad([20.0, 110.0, 200.0, 290.0])
    >>> field = np.column_stack([40 + 250 * np.cos(turn), -30 - 200 * np.sin(turn), 0 * turn])
    >>> fit_four_position(CalibrationData(field_mg=field)).offset_mg.round(9).tolist()
    [40.0, -30.0, 0.0]
    """
    rows = level_rows(data)
    refused = refused_rows(METHOD, data, rows, POSITIONS)
    if refused is not None:
        return refused
    chosen, found = _positions(data, np.flatnonzero(rows))
    if chosen is None and _still(data, rows):
        message = "the rig's azimuth did not change: turn to four positions 90 deg apart"
        return refusal(METHOD, Cause.NO_TURN, message, data)
    if chosen is None:
        message = (
            f"four level positions must lie 90 deg apart within {SQUARE_DEG:.0f} deg; instead "
            f"received {found}"
        )
        return refusal(METHOD, Cause.POSITIONS_NOT_SQUARE, message, data)
    field_mg = data.field_mg[chosen][:, :2]
    known = data.azimuth_deg is not None
    fits = four_position_batch(
        field_mg,
        data.field_sd_mg,
        horizontal_mg=station_horizontal_mg(data),
        position_sd_deg=data.rig_sd_deg if known else 0.0,
        largest_misclosure=LARGEST_CHANGE if known else LARGEST_MISCLOSURE,
    )
    return _judged(data, fits, field_mg, square_by_rig=known)


def four_position_batch(
    field_mg: ArrayLike,
    field_sd_mg: float,
    *,
    horizontal_mg: ArrayLike | None = None,
    position_sd_deg: float = 0.0,
    largest_misclosure: float = LARGEST_MISCLOSURE,
) -> FourPositionFits:
    """Fit c, A and alpha of x and y of many units [1]_ (4), without a loop over them.

    Parameters
    ----------
    field_mg : array-like, shape (..., 4, 2)
        x and y at the first position, a quarter, a half and three quarters of a turn from it.
    field_sd_mg, position_sd_deg : float
        Standard deviations of one reading and of one position.
    horizontal_mg : array-like, shape (...), optional
        Radius of the corrected circle; else the mean of both amplitudes.
    largest_misclosure : float
        Part of the amplitude by which H1 + H3 and H2 + H4 may differ, over four; larger values
        let a study fit readings that are no sine.

    Returns
    -------
    FourPositionFits
        Covariance of c of x and y and A of x and y: noise, times chi2_reduced (of the two
        misclosures) where that exceeds 1, and the positions' errors.

    Raises
    ------
    ValueError
        If the shape is another or a value is not finite.
    """
    readings, beyond = within_range(four_readings(field_mg))
    first, second, third, fourth = np.moveaxis(readings, -2, 0)
    a, b = (first - third) / 2.0, (second - fourth) / 2.0
    amplitude, alpha = np.hypot(a, b), np.arctan2(a, b)
    misclosure = (first - second + third - fourth) / 4.0
    skew_deg = np.abs(wrap_180_deg(np.rad2deg(alpha[..., 1] - alpha[..., 0]))) - 90.0
    limit = SIGMA * field_sd_mg / 2.0 + largest_misclosure * amplitude
    cause = first_cause(
        (Cause.DEGENERATE, beyond),
        *_causes(readings, amplitude, np.abs(misclosure) > limit, skew_deg, field_sd_mg),
    )
    chi2 = 2.0 * (misclosure**2).sum(axis=-1) / field_sd_mg**2
    sd_mg = field_sd_mg * np.sqrt(np.maximum(chi2, 1.0))
    covariance = _covariance(amplitude, alpha, sd_mg, position_sd_deg)
    matrix, horizontal = circle_of_amplitudes(amplitude, cause, horizontal_mg)
    offset, matrix, covariance = accepted_or_neutral(
        cause, readings.mean(axis=-2), matrix, covariance
    )
    return FourPositionFits(
        offset_mg=offset,
        matrix=matrix,
        horizontal_mg=horizontal,
        covariance=covariance,
        residual_rms_mg=np.sqrt((misclosure**2).mean(axis=-1)),
        chi2_reduced=chi2,
        gap_deg=np.full(cause.shape, 90.0),
        cause=cause,
        amplitude_mg=amplitude,
        alpha_deg=np.rad2deg(alpha),
        misclosure_mg=misclosure,
        skew_deg=skew_deg,
    )


def four_readings(field_mg: ArrayLike) -> NDArray[np.float64]:
    """Return x and y at four positions, shape (..., 4, 2); ValueError if they are of another."""
    readings = require_readings(field_mg, POSITIONS)
    if readings.shape[-2] != POSITIONS:
        message = f"field_mg must have the shape (..., 4, 2); instead received {readings.shape}"
        raise ValueError(message)
    return readings


def _causes(
    readings: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    misclosed: NDArray[np.bool_],
    skew_deg: NDArray[np.float64],
    field_sd_mg: float,
) -> tuple[tuple[Cause, NDArray[np.bool_]], ...]:
    """Return causes and the units, shape (...), where each holds; the first one counts."""
    smallest, largest = amplitude.min(axis=-1), amplitude.max(axis=-1)
    not_square = np.asarray(misclosed.any(axis=-1))
    return (
        (Cause.NO_TURN, np.asarray(largest < SMALLEST_SWING * field_sd_mg)),
        (Cause.SATURATED, not_square & _held(readings)),
        (Cause.POSITIONS_NOT_SQUARE, not_square),
        (Cause.DEGENERATE, np.asarray(smallest * LARGEST_AXIS_RATIO <= largest)),
        (Cause.POSITIONS_NOT_SQUARE, np.asarray(np.abs(skew_deg) > LARGEST_SKEW_DEG)),
    )


def _covariance(
    amplitude: NDArray[np.float64],
    alpha: NDArray[np.float64],
    field_sd_mg: NDArray[np.float64],
    position_sd_deg: float,
) -> NDArray[np.float64]:
    """Return the covariance, shape (..., 4, 4), of c and A of x and y."""
    cosines = np.cos(alpha[..., None, :] + QUARTERS_RAD[:, None])
    slopes, tangents = _slopes(alpha), amplitude[..., None, :] * cosines
    return reading_covariance(slopes, tangents, field_sd_mg, position_sd_deg)


def _slopes(alpha: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of c and A of x and y by each reading, shape (..., 4, 4, 2)."""
    sines = np.sin(alpha[..., None, :] + QUARTERS_RAD[:, None]) / 2.0
    slopes = np.zeros((*alpha.shape[:-1], 4, POSITIONS, 2))
    for axis in range(2):
        slopes[..., axis, :, axis] = 1.0 / POSITIONS
        slopes[..., 2 + axis, :, axis] = sines[..., axis]
    return slopes


def _held(readings: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which units, shape (...), read one extreme value twice on an axis."""
    at_high = (readings == readings.max(axis=-2, keepdims=True)).sum(axis=-2)
    at_low = (readings == readings.min(axis=-2, keepdims=True)).sum(axis=-2)
    return np.asarray((np.maximum(at_high, at_low) > 1).any(axis=-1))


def _still(data: CalibrationData, rows: NDArray[np.bool_]) -> bool:
    if data.azimuth_deg is None:
        return False
    level_deg = data.azimuth_deg[rows]
    return bool((np.abs(wrap_180_deg(level_deg - level_deg[0])) <= SQUARE_DEG).all())


def _positions(
    data: CalibrationData, level: NDArray[np.intp]
) -> tuple[NDArray[np.intp] | None, str]:
    """Return the rows of the four positions, or None and what was found instead."""
    if data.azimuth_deg is None:
        step, rest = divmod(len(level), POSITIONS)
        found = f"{len(level)} level readings without azimuths"
        return (None, found) if rest else (level[::step], found)
    turned_deg = data.azimuth_deg[level] - data.azimuth_deg[level[0]]
    chosen = [level[0]]
    for quarter_deg in (90.0, 180.0, 270.0):
        off_deg = np.abs(wrap_180_deg(turned_deg - quarter_deg))
        near = np.flatnonzero(off_deg <= SQUARE_DEG)
        if not len(near):
            nearest_deg = float(wrap_360_deg(turned_deg[np.argmin(off_deg)]))
            return None, f"{nearest_deg:.1f} deg from the first as nearest to {quarter_deg:.0f}"
        chosen.append(level[near[0]])
    return np.array(chosen), ""


def _judged(
    data: CalibrationData,
    fits: FourPositionFits,
    field_mg: NDArray[np.float64],
    *,
    square_by_rig: bool,
) -> Fit:
    """Return the Fit, or what its cause means where the rig says that the positions are square."""
    message = None
    if refused_cause(fits.cause) is Cause.POSITIONS_NOT_SQUARE:
        skewed = abs(float(fits.skew_deg)) > LARGEST_SKEW_DEG
        message = (
            f"(H1 - H2 + H3 - H4)/4 is {np.abs(fits.misclosure_mg).max():.1f} mG and the axes "
            f"are {90.0 + float(fits.skew_deg):.1f} deg apart: "
        )
        if not square_by_rig:
            message += "the positions are not a quarter turn apart"
        elif skewed:
            fits = replace(fits, cause=first_cause((Cause.RESIDUAL_TOO_LARGE, np.array(True))))
            message += "the positions are square, so there is iron that this method cannot take out"
        else:
            fits = replace(fits, cause=first_cause((Cause.FIELD_DISTURBED, np.array(True))))
            message += "the positions are square, so the field changed meanwhile"
    return refused_fit(METHOD, data, fits, message) or _fit_of(fits, field_mg)


def _fit_of(fits: FourPositionFits, field_mg: NDArray[np.float64]) -> Fit:
    return amplitude_fit(
        METHOD,
        fits,
        field_mg,
        fits.amplitude_mg,
        dof=2,
        extra={
            "alpha_x_deg": float(fits.alpha_deg[0]),
            "alpha_y_deg": float(fits.alpha_deg[1]),
            "misclosure_x_mg": float(fits.misclosure_mg[0]),
            "misclosure_y_mg": float(fits.misclosure_mg[1]),
        },
    )
