"""Affine map of the x and y readings of a level turn whose azimuths the rig knows.

raw = W (H cos psi, -H sin psi) + offset is linear in six numbers. It takes gains, the soft iron
between x and y and the sensor's rotation about z, and does not rest on four extremes as
Cho & Park's half-ranges (27)-(28) do. What it leaves is the vertical axis, and the tilt of the
turn: 0.1 deg reads as hard iron worth 0.17 deg of heading at dip 60. An azimuth error that all
rows share turns every heading by as much; neither residual nor covariance shows it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import Cause
from bench.calibration.level_kernel import (
    LARGEST_AXIS_RATIO,
    SMALLEST_SWING,
    LevelFits,
    accepted_or_neutral,
    first_cause,
    largest_azimuth_gap_deg,
    require_readings,
    saturated_units,
    within_range,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

PARAMETERS: Final = (
    "offset_x_mg", "offset_y_mg", "gain_xx", "gain_xy", "gain_yx", "gain_yy",
)  # fmt: skip
SMALLEST: Final = 4
LARGEST_GAP_DEG: Final = 95.0
LARGEST_RESIDUAL: Final = 0.20
"""Residual RMS an axis, as a part of the horizontal field."""
PASSES: Final = 2


def affine_turn_batch(
    field_mg: ArrayLike,
    azimuth_deg: ArrayLike,
    *,
    horizontal_mg: ArrayLike | None = None,
    field_sd_mg: float = 0.5,
    azimuth_sd_deg: float = 0.02,
) -> LevelFits:
    """Return offset and matrix of x and y of each unit by generalised least squares.

    Parameters
    ----------
    field_mg : array-like, shape (..., n, 2), n >= 4
        Level readings.
    azimuth_deg : array-like, broadcast to (..., n)
        Magnetic azimuths.
    horizontal_mg : array-like, shape (...), optional
        Without it, half the range of the readings, the mean of both axes.
    field_sd_mg, azimuth_sd_deg : float
        Of one reading; an azimuth error moves it along the circle, which its weight knows.

    Returns
    -------
    LevelFits
        Covariance in the order of `PARAMETERS`, times chi2_reduced where that exceeds 1.
        Refused with NO_TURN, SATURATED, DEGENERATE or RESIDUAL_TOO_LARGE.

    Examples
    --------
    >>> psi = np.arange(0.0, 360.0, 30.0)
    >>> turn = np.column_stack([np.cos(np.deg2rad(psi)), -np.sin(np.deg2rad(psi))]) * 250.0
    >>> fits = affine_turn_batch(turn @ [[1.1, 0.0], [0.1, 0.9]] + [40.0, -30.0], psi)
    >>> fits.offset_mg.round(6).tolist()
    [40.0, -30.0]
    """
    readings, beyond = within_range(require_readings(field_mg, SMALLEST))
    psi = np.broadcast_to(np.deg2rad(np.asarray(azimuth_deg, dtype=float)), readings.shape[:-1])
    swing_mg = np.ptp(readings, axis=-2) / 2.0
    H = swing_mg.mean(axis=-1) if horizontal_mg is None else np.asarray(horizontal_mg, float)
    H = np.maximum(np.broadcast_to(H, swing_mg.shape[:-1]), 1e-9)
    circle = np.stack([np.cos(psi), -np.sin(psi)], axis=-1) * H[..., None, None]
    solution, inverse, tangent = _settled(circle, readings, field_sd_mg, azimuth_sd_deg)
    gain = solution[..., 2:].reshape(*solution.shape[:-1], 2, 2)
    residual = readings - solution[..., None, :2] - circle @ np.swapaxes(gain, -1, -2)
    chi2 = _whitened_square(residual, tangent, field_sd_mg) / max(2 * readings.shape[-2] - 6, 1)
    residual_mg = np.sqrt((residual**2).mean(axis=(-2, -1)))
    gap_deg = largest_azimuth_gap_deg(np.rad2deg(psi))
    cause = first_cause(
        (Cause.DEGENERATE, beyond),
        (Cause.NO_TURN, gap_deg > LARGEST_GAP_DEG),
        (Cause.NO_TURN, swing_mg.max(axis=-1) < SMALLEST_SWING * field_sd_mg),
        (Cause.SATURATED, saturated_units(readings)),
        (Cause.DEGENERATE, _flat(gain)),
        (Cause.RESIDUAL_TOO_LARGE, residual_mg > LARGEST_RESIDUAL * H),
    )
    offset_mg, matrix, covariance = accepted_or_neutral(
        cause,
        solution[..., :2],
        _inverse(gain, cause == 0),
        inverse * np.maximum(chi2, 1.0)[..., None, None],
    )
    return LevelFits(
        offset_mg=offset_mg,
        matrix=matrix,
        horizontal_mg=H,
        covariance=covariance,
        residual_rms_mg=residual_mg,
        chi2_reduced=chi2,
        gap_deg=gap_deg,
        cause=cause,
    )


def affine_slopes(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of the matrix, shape (..., 2, 2), by `PARAMETERS`: (..., 6, 2, 2).

    The matrix is the inverse of the gains: d matrix = -matrix d gain matrix.
    """
    slopes = np.zeros((*matrix.shape[:-2], 6, 2, 2))
    for row in range(2):
        for column in range(2):
            outer = matrix[..., :, row, None] * matrix[..., None, column, :]
            slopes[..., 2 + 2 * row + column, :, :] = -outer
    return slopes


def _flat(gain: NDArray[np.float64]) -> NDArray[np.bool_]:
    singular = np.linalg.svd(gain, compute_uv=False)
    return np.asarray(singular[..., 1] * LARGEST_AXIS_RATIO <= singular[..., 0])


def _inverse(gain: NDArray[np.float64], usable: NDArray[np.bool_]) -> NDArray[np.float64]:
    safe = np.where(usable[..., None, None], gain, np.eye(2))
    return np.asarray(np.linalg.inv(safe), dtype=float)


def _settled(
    circle: NDArray[np.float64],
    readings: NDArray[np.float64],
    field_sd_mg: float,
    azimuth_sd_deg: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return parameters, covariance, and the readings' spread by azimuth errors (..., n, 2)."""
    along = circle[..., ::-1] * [1.0, -1.0] * np.deg2rad(azimuth_sd_deg)
    design, tangent = _design(circle), np.zeros_like(along)
    for _ in range(PASSES):
        solution, inverse = _solved(design, tangent, readings, field_sd_mg)
        gain = solution[..., 2:].reshape(*solution.shape[:-1], 2, 2)
        tangent = along @ np.swapaxes(gain, -1, -2)
    return solution, inverse, tangent


def _design(circle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of the readings, shape (..., n, 2, 6), by `PARAMETERS`."""
    design = np.zeros((*circle.shape, 6))
    design[..., 0, 0] = design[..., 1, 1] = 1.0
    design[..., 0, 2:4] = circle
    design[..., 1, 4:6] = circle
    return design


def _solved(
    design: NDArray[np.float64],
    tangent: NDArray[np.float64],
    readings: NDArray[np.float64],
    field_sd_mg: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return parameters and covariance for readings of covariance sd^2 I + t t^T.

    Its inverse is (I - s t t^T)/sd^2 with s = 1/(sd^2 + t.t), so that no 2 x 2 weight is formed.
    """
    flat = design.reshape(*design.shape[:-3], 2 * readings.shape[-2], 6)
    values = readings.reshape(*readings.shape[:-2], 2 * readings.shape[-2], 1)
    moved = (design * tangent[..., None]).sum(axis=-2)
    pulled = (readings * tangent).sum(axis=-1)[..., None]
    shared = np.swapaxes(moved * _share(tangent, field_sd_mg)[..., None], -1, -2)
    transposed = np.swapaxes(flat, -1, -2)
    normal = (transposed @ flat - shared @ moved) / field_sd_mg**2
    right = (transposed @ values - shared @ pulled) / field_sd_mg**2
    scale = np.sqrt(np.maximum(np.einsum("...pp->...p", normal), 1e-30))
    both = scale[..., :, None] * scale[..., None, :]
    inverse = np.linalg.pinv(normal / both, hermitian=True) / both
    return (inverse @ right)[..., 0], inverse


def _whitened_square(
    residual: NDArray[np.float64], tangent: NDArray[np.float64], field_sd_mg: float
) -> NDArray[np.float64]:
    along = (residual * tangent).sum(axis=-1)
    square = (residual**2).sum(axis=-1) - _share(tangent, field_sd_mg) * along**2
    return np.asarray(square.sum(axis=-1) / field_sd_mg**2)


def _share(tangent: NDArray[np.float64], field_sd_mg: float) -> NDArray[np.float64]:
    return np.asarray(1.0 / (field_sd_mg**2 + (tangent**2).sum(axis=-1)))
