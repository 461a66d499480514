"""Hard iron and soft iron of the horizontal axes from the ellipse of a level turn.

Konvalin (3)-(7): turn the major axis r onto x by theta, scale it to the minor axis q, turn
back. As printed it fails: arcsin(y1/r) in (4) loses the sign of x1, and (7), sigma = q/r with x
*divided* by it, stretches the ellipse further. Caruso turns by 45 deg whatever the ellipse.
Here the ellipse is fitted as a whole and the matrix is its symmetric root, which is rotate,
scale by q/r, rotate back for any theta and adds no rotation.

What no turn can show stays: the antisymmetric part of soft iron and misalignment, a constant
heading error; the vertical axis; the tilt of the turn.

References
----------
.. [1] C. Konvalin, "Compensating for Tilt, Hard-Iron, and Soft-Iron Effects", 2009, equations
   (1)-(7).
.. [2] M. J. Caruso, "Applications of Magnetic Sensors for Low Cost Compass Systems", PLANS
   2000: rotation by 45 deg.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.ellipse import Ellipses, fitted_ellipses
from bench.calibration.fit import CalibrationData, Cause, Fit
from bench.calibration.level_kernel import (
    LARGEST_AXIS_RATIO,
    SMALLEST_SWING,
    LevelFits,
    accepted_or_neutral,
    disturbed_units,
    first_cause,
    largest_gap_deg,
    require_readings,
    saturated_units,
    within_range,
)
from bench.calibration.level_turn import fit_level_turn, level_fit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

METHOD: Final = "soft_iron"
SMALLEST: Final = 6
LARGEST_GAP_DEG: Final = 75.0
"""Largest gap between neighbouring directions: six headings of a turn pass, three quarters of
a turn do not."""
LARGEST_RESIDUAL: Final = 0.10
UNKNOWN_ANGLE_DEG: Final = 180.0 / float(np.sqrt(12.0))
"""Standard deviation of an axis that may point anywhere: the ellipse is a circle."""
PARAMETERS: Final = ("offset_x_mg", "offset_y_mg", "matrix_xx", "matrix_yy", "matrix_xy")
MATRIX_SLOPES: Final = np.array(
    [
        [[0.0, 0.0], [0.0, 0.0]],
        [[0.0, 0.0], [0.0, 0.0]],
        [[1.0, 0.0], [0.0, 0.0]],
        [[0.0, 0.0], [0.0, 1.0]],
        [[0.0, 1.0], [1.0, 0.0]],
    ]
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SoftIronFits(LevelFits):
    """Level fits with the ellipse in Konvalin's terms.

    Attributes
    ----------
    theta_deg, theta_sd_deg : ndarray, shape (...)
        Direction of the major axis from x towards y in [0, 180); at most 52 deg uncertain.
    axis_ratio, axis_ratio_sd : ndarray, shape (...)
        Major over minor axis, r/q.
    """

    theta_deg: NDArray[np.float64]
    theta_sd_deg: NDArray[np.float64]
    axis_ratio: NDArray[np.float64]
    axis_ratio_sd: NDArray[np.float64]


def fit_soft_iron(data: CalibrationData) -> Fit:
    """Fit offset and symmetric matrix of x and y on a level turn.

    Parameters
    ----------
    data : CalibrationData
        Where rig angles or specific force are known, only rows within 5 deg of level count.

    Returns
    -------
    Fit
        z keeps offset 0 and gain 1; the circle's radius is the station's horizontal field, or
        the geometric mean of both half-axes. Refused with TOO_FEW, NO_TURN, SATURATED,
        DEGENERATE (a hyperbola, a line), FIELD_DISTURBED, NOT_CONVERGED or RESIDUAL_TOO_LARGE.

    Examples
    --------
    >>> turn = np.deg2rad(np.arange(0.0, 360.0, 15.0))
    >>> x, y = 250.0 * np.cos(turn), -250.0 * np.sin(turn)
    >>> field = np.column_stack([40 + x + 0.1 * y, -30 + 0.1 * x + y, 0 * turn])
    >>> fit = fit_soft_iron(CalibrationData(field_mg=field))
    >>> round(fit.extra["theta_deg"], 6), round(fit.extra["axis_ratio"], 6)
    (45.0, 1.222222)
    """
    return fit_level_turn(METHOD, data, SMALLEST, soft_iron_batch, _fit_of)


def soft_iron_batch(
    field_mg: ArrayLike, field_sd_mg: float, *, horizontal_mg: ArrayLike | None = None
) -> SoftIronFits:
    """Fit the ellipse of x and y of many units, without a loop over them.

    Parameters
    ----------
    field_mg : array-like, shape (..., n, 2), n >= 6
        x and y of a level turn in order of time, however spaced.
    field_sd_mg : float
        Standard deviation of one reading.
    horizontal_mg : array-like, shape (...), optional
        Radius of the corrected circle; else the geometric mean of both half-axes.

    Returns
    -------
    SoftIronFits
        Covariance of offset x, y and matrix xx, yy, xy: noise, times chi2_reduced where that
        exceeds 1.

    Raises
    ------
    ValueError
        If the shape is another or a value is not finite.
    """
    readings, beyond = within_range(require_readings(field_mg, SMALLEST))
    ellipse = fitted_ellipses(readings)
    count = readings.shape[-2]
    radius = 1.0 / np.sqrt(np.maximum(np.linalg.det(ellipse.root), 1e-300))
    horizontal = radius if horizontal_mg is None else np.broadcast_to(horizontal_mg, radius.shape)
    residual = np.sqrt((ellipse.distance**2).mean(axis=-1))
    chi2 = count * (residual / field_sd_mg) ** 2 / max(count - 5, 1)
    unit = (readings - ellipse.centre[..., None, :]) @ ellipse.root
    gap_deg = largest_gap_deg(unit)
    matrix = ellipse.root * horizontal[..., None, None]
    cause = _causes(readings, ellipse, beyond, radius, residual, gap_deg, unit, field_sd_mg)
    covariance = _covariance(ellipse, horizontal) * field_sd_mg**2
    offset, matrix, covariance = accepted_or_neutral(
        cause, ellipse.centre, matrix, covariance * np.maximum(chi2, 1.0)[..., None, None]
    )
    return SoftIronFits(
        offset_mg=offset,
        matrix=matrix,
        horizontal_mg=np.asarray(horizontal, dtype=float),
        covariance=covariance,
        residual_rms_mg=residual,
        chi2_reduced=chi2,
        gap_deg=gap_deg,
        cause=cause,
        **_axes(matrix, covariance),
    )


def _causes(
    readings: NDArray[np.float64],
    ellipse: Ellipses,
    beyond: NDArray[np.bool_],
    radius: NDArray[np.float64],
    residual: NDArray[np.float64],
    gap_deg: NDArray[np.float64],
    unit: NDArray[np.float64],
    field_sd_mg: float,
) -> NDArray[np.int8]:
    swing = np.ptp(readings, axis=-2).max(axis=-1) / 2.0
    ratio = _axes(ellipse.root, None)["axis_ratio"]
    return first_cause(
        (Cause.DEGENERATE, beyond),
        (Cause.NO_TURN, swing <= SMALLEST_SWING * field_sd_mg),
        (Cause.SATURATED, saturated_units(readings)),
        (Cause.NO_TURN, gap_deg > LARGEST_GAP_DEG),
        (Cause.DEGENERATE, ~ellipse.found),
        (Cause.NOT_CONVERGED, ~ellipse.settled),
        (Cause.DEGENERATE, ratio >= LARGEST_AXIS_RATIO),
        (Cause.FIELD_DISTURBED, disturbed_units(ellipse.distance, unit, radius, field_sd_mg)),
        (Cause.RESIDUAL_TOO_LARGE, residual > LARGEST_RESIDUAL * radius),
    )


def _covariance(ellipse: Ellipses, horizontal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance, shape (..., 5, 5), of offset and matrix for noise of 1 mG."""
    scale = np.stack([np.ones_like(horizontal)] * 2 + [horizontal] * 3, axis=-1)
    return ellipse.covariance * scale[..., :, None] * scale[..., None, :]


def _axes(
    matrix: NDArray[np.float64], covariance: NDArray[np.float64] | None
) -> dict[str, NDArray[np.float64]]:
    """Return the ellipse's axes with their standard deviations (0 without a covariance).

    The matrix stretches the minor axis by mean + half and the major one by mean - half, with
    half the length of (h, o) = ((xx - yy)/2, xy).
    """
    xx, yy, xy = matrix[..., 0, 0], matrix[..., 1, 1], matrix[..., 0, 1]
    mean, h = (xx + yy) / 2.0, (xx - yy) / 2.0
    half = np.hypot(h, xy)
    small = np.where(mean > half, mean - half, np.inf)
    round_ = half < 1e-12 * np.abs(mean)
    safe = np.where(round_, 1.0, half)
    cosine, sine = np.where(round_, 1.0, h / safe), np.where(round_, 0.0, xy / safe)
    theta_sd = ratio_sd = np.zeros_like(half)
    if covariance is not None:
        zero = np.zeros_like(half)
        by_theta = np.stack([zero, zero, -sine / 4.0, sine / 4.0, cosine / 2.0], axis=-1)
        theta_sd = np.rad2deg(_sd(by_theta, covariance)) / np.where(round_, 1e-12, half)
        by_half = np.stack([zero, zero, cosine / 2.0, -cosine / 2.0, sine], axis=-1)
        by_mean = np.array([0.0, 0.0, 0.5, 0.5, 0.0])
        by_ratio = 2.0 * (mean[..., None] * by_half - half[..., None] * by_mean)
        ratio_sd = _sd(by_ratio, covariance) / small**2
    return {
        "theta_deg": np.mod(np.rad2deg(np.arctan2(-xy, -h)) / 2.0, 180.0),
        "theta_sd_deg": np.minimum(theta_sd, UNKNOWN_ANGLE_DEG),
        "axis_ratio": np.where(
            mean > half, (mean + half) / np.where(small < np.inf, small, 1.0), np.inf
        ),
        "axis_ratio_sd": ratio_sd,
    }


def _sd(slope: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    variance = np.einsum("...p,...pq,...q->...", slope, covariance, slope)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _fit_of(fits: SoftIronFits, field_mg: NDArray[np.float64]) -> Fit:
    return level_fit(
        METHOD,
        fits,
        field_mg,
        parameters=PARAMETERS,
        matrix_slopes=MATRIX_SLOPES,
        dof=max(len(field_mg) - 5, 1),
        extra={
            "theta_deg": float(fits.theta_deg),
            "theta_deg_sd": float(fits.theta_sd_deg),
            "axis_ratio": float(fits.axis_ratio),
            "axis_ratio_sd": float(fits.axis_ratio_sd),
        },
    )
