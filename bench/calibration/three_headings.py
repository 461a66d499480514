"""Hard iron and index error from three known level headings.

Caruso: 'the calibration procedure can be as simple as pointing the host in three known
directions'. A level reading (x, -y) is a rotated and scaled (cos, sin) of the heading plus an
offset: four numbers, six readings. Known headings also show what no turn can, the index error:
the module's rotation in its housing, and of the station's field azimuth. Unequal axes and soft
iron are left; they show as a residual.

References
----------
.. [1] M. J. Caruso, "Applications of Magnetic Sensors for Low Cost Compass Systems", PLANS
   2000, nearby ferrous materials.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.level_kernel import (
    SMALLEST_SWING,
    LevelFits,
    accepted_or_neutral,
    first_cause,
    largest_azimuth_gap_deg,
    reading_covariance,
    require_readings,
    within_range,
)
from bench.calibration.level_turn import (
    level_fit,
    level_rows,
    refused_fit,
    refused_rows,
    station_horizontal_mg,
)
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

METHOD: Final = "three_headings"
SMALLEST: Final = 3
THIRD_DEG: Final = 120.0
NEAR_THIRD_DEG: Final = 15.0
"""How far from a third of a turn the second and third heading may lie."""
LARGEST_GAP_DEG: Final = 150.0
LARGEST_RESIDUAL: Final = 0.20
PARAMETERS: Final = ("offset_x_mg", "offset_y_mg", "gain_mg", "index_deg")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThreeHeadingsFits(LevelFits):
    """Level fits with gain and index error.

    Attributes
    ----------
    gain_mg : ndarray, shape (...)
        The horizontal field as the module reads it.
    index_deg : ndarray, shape (...)
        By how much the raw heading is too large, in (-180, 180].
    """

    gain_mg: NDArray[np.float64]
    index_deg: NDArray[np.float64]


def fit_three_headings(data: CalibrationData) -> Fit:
    """Fit offset, gain and index error to three level headings that the rig gives.

    Parameters
    ----------
    data : CalibrationData
        Of a longer recording the first level row and the first ones within 15 deg of a third
        and of two thirds of a turn from it are taken, as if the host had been pointed three
        times; where there are none, all level rows with no gap of more than 150 deg.

    Returns
    -------
    Fit
        z keeps offset 0 and gain 1; the circle's radius is the station's horizontal field, or
        the gain. Refused with NO_TRUTH, TOO_FEW, NO_TURN, SATURATED, POSITIONS_NOT_SQUARE
        (headings not spread over the turn), FIELD_DISTURBED or RESIDUAL_TOO_LARGE.

    Examples
    --------
    >>> heading = np.array([10.0, 130.0, 250.0])
    >>> turn = np.deg2rad(heading + 2.0)  # read 2 deg too large
    >>> field = np.column_stack([40 + 250 * np.cos(turn), -30 - 250 * np.sin(turn), 0 * turn])
    >>> fit = fit_three_headings(CalibrationData(field_mg=field, azimuth_deg=heading))
    >>> fit.offset_mg.round(6).tolist(), round(fit.extra["index_deg"], 6)
    ([40.0, -30.0, 0.0], 2.0)
    """
    if data.azimuth_deg is None:
        message = "three known headings need the rig's azimuth of every reading"
        return refusal(METHOD, Cause.NO_TRUTH, message, data)
    rows = level_rows(data)
    refused = refused_rows(METHOD, data, rows, SMALLEST)
    if refused is not None:
        return refused
    chosen = _thirds(data.azimuth_deg, np.flatnonzero(rows))
    field_mg = data.field_mg[chosen][:, :2]
    fits = three_headings_batch(
        field_mg,
        data.azimuth_deg[chosen] - data.field_azimuth_deg,
        data.field_sd_mg,
        horizontal_mg=station_horizontal_mg(data),
        heading_sd_deg=data.rig_sd_deg,
    )
    message = (
        f"three known headings must be spread over the turn with no gap of more than "
        f"{LARGEST_GAP_DEG:.0f} deg; instead received one of {fits.gap_deg:.0f} deg"
    )
    spread = fits.gap_deg <= LARGEST_GAP_DEG
    return refused_fit(METHOD, data, fits, None if spread else message) or _fit_of(fits, field_mg)


def three_headings_batch(
    field_mg: ArrayLike,
    heading_deg: ArrayLike,
    field_sd_mg: float,
    *,
    horizontal_mg: ArrayLike | None = None,
    heading_sd_deg: float = 0.0,
) -> ThreeHeadingsFits:
    """Fit offset, gain and index error of many units by least squares, without a loop over them.

    (x, -y) = G (cos(psi + i), sin(psi + i)) + (offset x, -offset y), linear in G cos i, G sin i
    and the offsets.

    Parameters
    ----------
    field_mg : array-like, shape (..., n, 2), n >= 3
        x and y at each heading.
    heading_deg : array-like, shape (n,) or (..., n)
        Known magnetic headings psi.
    field_sd_mg, heading_sd_deg : float
        Standard deviations of one reading and of one heading.
    horizontal_mg : array-like, shape (...), optional
        Radius of the corrected circle; else G.

    Returns
    -------
    ThreeHeadingsFits
        Covariance of offset x, y, gain (mG) and index (deg): noise, times chi2_reduced where
        that exceeds 1, and the headings' errors.

    Raises
    ------
    ValueError
        If a shape is another or a value is not finite.
    """
    readings, beyond = within_range(require_readings(field_mg, SMALLEST))
    heading = _headings(heading_deg, readings.shape[:-1])
    gap_deg = largest_azimuth_gap_deg(heading)
    spread = gap_deg <= LARGEST_GAP_DEG
    inverse, solution, squares = _solved(readings, heading, spread)
    cosine, sine = solution[..., 2], solution[..., 3]
    gain, index = np.hypot(cosine, sine), np.arctan2(sine, cosine)
    rms = np.sqrt(squares / (2 * heading.shape[-1]))
    cause = first_cause(
        (Cause.DEGENERATE, beyond),
        (Cause.POSITIONS_NOT_SQUARE, ~spread),
        (Cause.NO_TURN, gain <= SMALLEST_SWING * field_sd_mg),
        (Cause.RESIDUAL_TOO_LARGE, rms > LARGEST_RESIDUAL * gain),
    )
    safe = np.where(cause != 0, 1.0, gain)
    chi2 = squares / field_sd_mg**2 / (2 * heading.shape[-1] - 4)
    sd_mg = np.asarray(field_sd_mg * np.sqrt(np.maximum(chi2, 1.0)), dtype=float)
    covariance = _covariance(inverse, safe, index, heading, sd_mg, heading_sd_deg)
    horizontal = safe if horizontal_mg is None else np.broadcast_to(horizontal_mg, safe.shape)
    offset, matrix, covariance = accepted_or_neutral(
        cause,
        solution[..., :2],
        _turn_back(index) * (horizontal / safe)[..., None, None],
        covariance,
    )
    return ThreeHeadingsFits(
        offset_mg=offset,
        matrix=matrix,
        horizontal_mg=np.asarray(horizontal, dtype=float),
        covariance=covariance,
        residual_rms_mg=rms,
        chi2_reduced=chi2,
        gap_deg=gap_deg,
        cause=cause,
        gain_mg=gain,
        index_deg=np.rad2deg(index),
    )


def _headings(heading_deg: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    heading = np.broadcast_to(np.asarray(heading_deg, dtype=float), shape)
    if not np.isfinite(heading).all():
        message = "heading_deg must be finite; instead received a value that is not"
        raise ValueError(message)
    return heading


def _solved(
    readings: NDArray[np.float64], heading_deg: NDArray[np.float64], spread: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the design's inverse (..., 4, 2 n), the unknowns (..., 4) and the sum of squares.

    Where the headings are not spread, thirds stand for them: the unit is refused.
    """
    thirds = np.arange(heading_deg.shape[-1]) * 360.0 / heading_deg.shape[-1]
    design = _design(np.where(spread[..., None], heading_deg, thirds))
    inverse = np.asarray(np.linalg.pinv(design), dtype=float)
    values = readings.reshape(*readings.shape[:-2], 2 * readings.shape[-2], 1)
    solution = inverse @ values
    squares = ((values - design @ solution) ** 2).sum(axis=(-1, -2))
    return inverse, solution[..., 0], squares


def _design(heading_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative, shape (..., 2 n, 4), of x and y in turn by the four unknowns."""
    c, s = np.cos(np.deg2rad(heading_deg)), np.sin(np.deg2rad(heading_deg))
    one, zero = np.ones_like(c), np.zeros_like(c)
    of_x = np.stack([one, zero, c, -s], axis=-1)
    of_y = np.stack([zero, one, -s, -c], axis=-1)
    rows = np.stack([of_x, of_y], axis=-2)
    return rows.reshape(*heading_deg.shape[:-1], 2 * heading_deg.shape[-1], 4)


def _turn_back(index: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix, shape (..., 2, 2), that takes the index error out of x and y."""
    c, s = np.cos(index), np.sin(index)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def _covariance(
    inverse: NDArray[np.float64],
    gain: NDArray[np.float64],
    index: NDArray[np.float64],
    heading_deg: NDArray[np.float64],
    field_sd_mg: NDArray[np.float64],
    heading_sd_deg: float,
) -> NDArray[np.float64]:
    """Return the covariance, shape (..., 4, 4), of offset x, y, gain and index in degrees."""
    c, s, zero = np.cos(index), np.sin(index), np.zeros_like(index)
    to_gain = np.stack([zero, zero, c, s], axis=-1)
    to_index = np.rad2deg(np.stack([zero, zero, -s, c], axis=-1) / gain[..., None])
    offsets = np.broadcast_to(np.eye(4)[:2], (*index.shape, 2, 4))
    to_parameters = np.concatenate([offsets, np.stack([to_gain, to_index], axis=-2)], axis=-2)
    by_reading = to_parameters @ inverse
    slopes = by_reading.reshape(*by_reading.shape[:-1], by_reading.shape[-1] // 2, 2)
    seen = np.deg2rad(heading_deg) + index[..., None]
    tangents = gain[..., None, None] * np.stack([-np.sin(seen), -np.cos(seen)], axis=-1)
    return reading_covariance(slopes, tangents, field_sd_mg, heading_sd_deg)


def _thirds(azimuth_deg: NDArray[np.float64], level: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the first row and those nearest in time to thirds of a turn from it, else all."""
    turned_deg = azimuth_deg[level] - azimuth_deg[level[0]]
    chosen = [level[0]]
    for third_deg in (THIRD_DEG, 2.0 * THIRD_DEG):
        near = np.flatnonzero(np.abs(wrap_180_deg(turned_deg - third_deg)) <= NEAR_THIRD_DEG)
        if not len(near):
            return level
        chosen.append(level[near[0]])
    return np.array(chosen)


def _fit_of(fits: ThreeHeadingsFits, field_mg: NDArray[np.float64]) -> Fit:
    slopes = np.zeros((4, 2, 2))
    slopes[2] = -fits.matrix / fits.gain_mg
    slopes[3] = np.deg2rad(np.array([[0.0, -1.0], [1.0, 0.0]])) @ fits.matrix
    index_sd_deg = float(np.sqrt(fits.covariance[3, 3]))
    return level_fit(
        METHOD,
        fits,
        field_mg,
        parameters=PARAMETERS,
        matrix_slopes=slopes,
        dof=2 * len(field_mg) - 4,
        extra={
            "gain_mg": float(fits.gain_mg),
            "index_deg": float(fits.index_deg),
            "index_deg_sd": index_sd_deg,
        },
    )
