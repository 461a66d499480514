"""What the kernels of a level turn share: their result, causes, gaps and covariance.

The kernels take the x and y readings of many units at once, shape (..., n, 2) with units in
front, and return a `LevelFits`. A refused unit keeps offset 0, matrix 1 and covariance 0
beside its cause, never a NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import Cause
from bench.calibration.saturation import saturated
from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

LARGEST_MG: Final = 1e7
"""No magnetometer reads more; beyond it squares of readings would overflow."""
LARGEST_AXIS_RATIO: Final = 5.0
SMALLEST_SWING: Final = 10.0
"""Amplitude in standard deviations below which the module did not turn."""
DISTURBED_SHARE: Final = 0.05
"""Change between the halves of a turn, as a part of its amplitude."""
DISTURBED_SIGMA: Final = 8.0
CAUSES: Final[tuple[Cause | None, ...]] = (
    None,
    Cause.TOO_FEW,
    Cause.NO_TRUTH,
    Cause.NO_TURN,
    Cause.SATURATED,
    Cause.DEGENERATE,
    Cause.POSITIONS_NOT_SQUARE,
    Cause.FIELD_DISTURBED,
    Cause.RESIDUAL_TOO_LARGE,
    Cause.NOT_CONVERGED,
    Cause.NO_SET_RESET,
)
"""Causes by the code that kernels return; code 0 is no cause: accepted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LevelFits:
    """Coefficients of x and y of many units; units are the leading axes (...).

    Attributes
    ----------
    offset_mg : ndarray, shape (..., 2)
    matrix : ndarray, shape (..., 2, 2)
        corrected = matrix @ (raw - offset_mg) lies on a circle of radius `horizontal_mg`.
    horizontal_mg : ndarray, shape (...)
        The horizontal field given, else the readings' own mean amplitude.
    covariance : ndarray, shape (..., p, p)
        Of the method's PARAMETERS, with `horizontal_mg` held.
    residual_rms_mg, chi2_reduced, gap_deg : ndarray, shape (...)
        RMS distance from the model, its square over the noise's, largest gap of the turn.
    cause : ndarray of int8, shape (...)
        Index into CAUSES; 0 is accepted.
    """

    offset_mg: NDArray[np.float64]
    matrix: NDArray[np.float64]
    horizontal_mg: NDArray[np.float64]
    covariance: NDArray[np.float64]
    residual_rms_mg: NDArray[np.float64]
    chi2_reduced: NDArray[np.float64]
    gap_deg: NDArray[np.float64]
    cause: NDArray[np.int8]

    def corrected_mg(self, field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return corrected x and y, shape (..., n, 2), of raw readings of that shape."""
        return corrected_mg(field_mg, self.offset_mg, self.matrix)


def corrected_mg(
    field_mg: NDArray[np.float64], offset_mg: NDArray[np.float64], matrix: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return matrix @ (raw - offset), shape (..., n, 2)."""
    return np.asarray((field_mg - offset_mg[..., None, :]) @ np.swapaxes(matrix, -1, -2))


def require_readings(field_mg: ArrayLike, smallest: int) -> NDArray[np.float64]:
    """Return readings as an array of shape (..., n, 2).

    Raises
    ------
    ValueError
        If the shape is another, n is less than `smallest`, or a value is not finite.
    """
    readings = np.asarray(field_mg, dtype=float)
    if readings.ndim < 2 or readings.shape[-1] != 2 or readings.shape[-2] < smallest:
        message = (
            f"field_mg must have the shape (..., n, 2) with n of at least {smallest}; instead "
            f"received {readings.shape}"
        )
        raise ValueError(message)
    if not np.isfinite(readings).all():
        message = "field_mg must be finite; instead received a value that is not"
        raise ValueError(message)
    return readings


def within_range(
    readings: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return readings with 0 for units beyond LARGEST_MG, and which units those are."""
    beyond = np.abs(readings).max(axis=(-1, -2)) > LARGEST_MG
    return np.where(beyond[..., None, None], 0.0, readings), np.asarray(beyond)


def first_cause(*found: tuple[Cause, NDArray[np.bool_]]) -> NDArray[np.int8]:
    """Return, shape (...), the code of the first cause that holds for each unit; 0 if none.

    >>> first_cause((Cause.NO_TURN, np.array([True, False]))).tolist()
    [3, 0]
    """
    codes = [np.int8(CAUSES.index(cause)) for cause, _ in found]
    return np.asarray(np.select([holds for _, holds in found], codes, np.int8(0)), dtype=np.int8)


def refused_cause(cause: NDArray[np.int8]) -> Cause | None:
    """Return why one unit, whose code has shape (), was refused; None if it was accepted."""
    return CAUSES[int(cause)]


def accepted_or_neutral(
    cause: NDArray[np.int8],
    offset_mg: NDArray[np.float64],
    matrix: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return offset, matrix and covariance with 0, 1 and 0 for refused units."""
    refused = cause != 0
    return (
        np.where(refused[..., None], 0.0, offset_mg),
        np.where(refused[..., None, None], np.eye(2), matrix),
        np.where(refused[..., None, None], 0.0, covariance),
    )


def circle_of_amplitudes(
    amplitude_mg: NDArray[np.float64], cause: NDArray[np.int8], horizontal_mg: ArrayLike | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return diag(H/A), shape (..., 2, 2), and H: the field given, else the mean amplitude."""
    safe_mg = np.where((cause != 0)[..., None], 1.0, amplitude_mg)
    mean_mg = safe_mg.mean(axis=-1)
    horizontal = np.array(
        np.broadcast_to(mean_mg if horizontal_mg is None else horizontal_mg, mean_mg.shape),
        dtype=float,
    )
    return np.eye(2) * (horizontal[..., None] / safe_mg)[..., None, :], horizontal


def largest_gap_deg(horizontal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest gap, shape (...), between neighbouring directions (..., n, 2).

    >>> largest_gap_deg(np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])).item()
    180.0
    """
    turned_deg = np.rad2deg(np.arctan2(horizontal[..., 1], horizontal[..., 0]))
    return largest_azimuth_gap_deg(turned_deg)


def largest_azimuth_gap_deg(azimuth_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest gap, shape (...), between neighbours of angles (..., n) on the circle."""
    turned_deg = np.sort(wrap_360_deg(azimuth_deg), axis=-1)
    last_deg = turned_deg[..., :1] + 360.0
    return np.asarray(np.diff(turned_deg, axis=-1, append=last_deg).max(axis=-1))


def saturated_units(readings: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which units, shape (...), hold x or y of (..., n, 2) at one extreme value."""
    return np.asarray(saturated(readings).any(axis=-1))


def disturbed_units(
    radial_mg: NDArray[np.float64],
    unit: NDArray[np.float64],
    amplitude_mg: NDArray[np.float64],
    field_sd_mg: float,
) -> NDArray[np.bool_]:
    """Return which units, shape (...), read a field that changed between the halves of the turn.

    Compared are the mean distance from the model and, where each half is a turn of its own, the
    shift of its centre; a shift within a single turn shows as a residual.

    Parameters
    ----------
    radial_mg, unit : ndarray, shape (..., n) and (..., n, 2)
        Signed distance from the model and direction of each reading, in order of time.
    amplitude_mg : ndarray, shape (...)
        Mean amplitude of the turn.
    field_sd_mg : float
        Standard deviation of one reading.
    """
    half = radial_mg.shape[-1] // 2
    first, second = slice(None, half), slice(radial_mg.shape[-1] - half, None)
    if not half:
        return np.zeros(radial_mg.shape[:-1], dtype=bool)
    change_mg = np.abs(radial_mg[..., second].mean(axis=-1) - radial_mg[..., first].mean(axis=-1))
    weighted = 2.0 * radial_mg[..., None] * unit
    shift_mg = np.linalg.norm(
        weighted[..., second, :].mean(axis=-2) - weighted[..., first, :].mean(axis=-2), axis=-1
    )
    turned = np.maximum(largest_gap_deg(unit[..., first, :]), largest_gap_deg(unit[..., second, :]))
    change_mg = np.maximum(change_mg, np.where(turned < 100.0, shift_mg, 0.0))
    return np.asarray(
        change_mg > np.maximum(DISTURBED_SHARE * amplitude_mg, DISTURBED_SIGMA * field_sd_mg)
    )


def reading_covariance(
    slopes: NDArray[np.float64],
    tangents_mg: NDArray[np.float64],
    field_sd_mg: ArrayLike,
    position_sd_deg: float,
) -> NDArray[np.float64]:
    """Return the covariance, shape (..., p, p), that noise and position errors give parameters.

    Parameters
    ----------
    slopes : ndarray, shape (..., p, n, 2)
        Derivative of each parameter by each reading of x and y.
    tangents_mg : ndarray, shape (..., n, 2)
        Derivative of each pair of readings by its own position in radians.
    field_sd_mg : array-like, shape (...)
        Standard deviation of a reading.
    position_sd_deg : float
        Standard deviation of a position.
    """
    by_noise = np.einsum("...pna,...qna->...pq", slopes, slopes)
    by_noise = by_noise * np.asarray(field_sd_mg, dtype=float)[..., None, None] ** 2
    moved = np.einsum("...pna,...na->...pn", slopes, tangents_mg) * np.deg2rad(position_sd_deg)
    return np.asarray(by_noise + moved @ np.swapaxes(moved, -1, -2))
