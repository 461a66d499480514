"""Offset and scale of the horizontal axes from the extremes of a level turn.

Skula (2)-(3): offset = (max + min)/2 of each axis. Konvalin (1)-(2) is the same. Cho & Park
(5)-(7), (27)-(28) also divide by the half-ranges, which makes the axes' gains equal. What it
leaves: the vertical axis, soft iron off the axes, misalignment, and the tilt of the turn: 0.1
deg between body and level reads as hard iron worth 0.17 deg of heading at dip 60.

References
----------
.. [1] J. Skula, "New Method for Magnetometer Offset Compensation", 2010.
.. [2] M. Konvalin, "Compensating for Tilt, Hard-Iron, and Soft-Iron Effects", 2009.
.. [3] S. Y. Cho and C. G. Park, ETRI Journal 27(3), 2005.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import sphere_coverage
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.prediction import heading_grid, predicted_heading_deg
from bench.calibration.tilt import attitude_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

METHOD: Final = "min_max"
SMALLEST: Final = 4
LEVEL_DEG: Final = 5.0
"""Rows tilted by more are left out where the tilt is known."""
LARGEST_GAP_DEG: Final = 95.0
"""Largest gap between neighbouring directions of a turn; four quarters still pass."""
LARGEST_AXIS_RATIO: Final = 5.0
LARGEST_RESIDUAL: Final = 0.20
"""RMS distance from the circle, as a part of its radius: more is no turn in one field."""
PARAMETERS: Final = ("offset_x_mg", "offset_y_mg", "amplitude_x_mg", "amplitude_y_mg")


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
        TOO_FEW, NO_TURN, DEGENERATE or RESIDUAL_TOO_LARGE.

    Examples
    --------
    >>> turn = np.deg2rad(np.arange(0.0, 360.0, 15.0))
    >>> field = np.column_stack([40 + 250 * np.cos(turn), -30 - 200 * np.sin(turn), 0 * turn])
    >>> fit_min_max(CalibrationData(field_mg=field)).offset_mg.round(9).tolist()
    [40.0, -30.0, 0.0]
    """
    level = level_rows(data)
    field_mg = data.field_mg[level]
    if len(field_mg) < SMALLEST:
        message = (
            f"a level turn needs at least {SMALLEST} readings within {LEVEL_DEG:.0f} deg of "
            f"level; instead received {len(field_mg)}"
        )
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    high, low = field_mg[:, :2].max(axis=0), field_mg[:, :2].min(axis=0)
    offset, amplitude = (high + low) / 2.0, (high - low) / 2.0
    if amplitude.min() * LARGEST_AXIS_RATIO <= amplitude.max():
        message = (
            f"the turn moves x by {amplitude[0]:.1f} and y by {amplitude[1]:.1f} mG: no full "
            "turn, or an axis is stuck"
        )
        cause = Cause.NO_TURN if amplitude.max() < 10.0 * data.field_sd_mg else Cause.DEGENERATE
        return refusal(METHOD, cause, message, data)
    unit = (field_mg[:, :2] - offset) / amplitude
    gap_deg = largest_gap_deg(unit)
    if gap_deg > LARGEST_GAP_DEG:
        message = (
            f"the turn leaves a gap of {gap_deg:.0f} deg, more than {LARGEST_GAP_DEG:.0f}: turn "
            "through all headings"
        )
        return refusal(METHOD, Cause.NO_TURN, message, data, coverage=1.0 - gap_deg / 360.0)
    residual_mg = _residual_mg(unit, amplitude)
    if residual_mg > LARGEST_RESIDUAL * amplitude.mean():
        message = (
            f"the turn is {100.0 * residual_mg / amplitude.mean():.0f} % off a circle: tilted, "
            "soft iron off the axes, or a field that changed"
        )
        return refusal(METHOD, Cause.RESIDUAL_TOO_LARGE, message, data, residual_rms_mg=residual_mg)
    return _fit_of(data, unit, offset, amplitude, residual_mg)


def level_rows(data: CalibrationData) -> NDArray[np.bool_]:
    """Return which rows, shape (n,), are within 5 deg of level; all where tilt is unknown."""
    if data.pitch_deg is not None and data.roll_deg is not None:
        pitch_deg, roll_deg = data.pitch_deg, data.roll_deg
    elif data.accel_g is not None:
        pitch_deg, roll_deg = attitude_deg(data.accel_g)
    else:
        return np.ones(len(data), dtype=bool)
    return np.asarray(np.maximum(np.abs(pitch_deg), np.abs(roll_deg)) < LEVEL_DEG)


def largest_gap_deg(horizontal: NDArray[np.float64]) -> float:
    """Return the largest gap between neighbouring directions, shape (n, 2), round the circle.

    >>> largest_gap_deg(np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]))
    180.0
    """
    turned_deg = np.sort(np.rad2deg(np.arctan2(horizontal[:, 1], horizontal[:, 0])))
    gaps_deg = np.diff(turned_deg, append=turned_deg[0] + 360.0)
    return float(gaps_deg.max())


def _fit_of(
    data: CalibrationData,
    unit: NDArray[np.float64],
    offset: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    residual_mg: float,
) -> Fit:
    horizontal_mg = _horizontal_mg(data, amplitude)
    dof = max(len(unit) - 4, 1)
    chi2 = len(unit) * residual_mg**2 / data.field_sd_mg**2 / dof
    variance = data.field_sd_mg**2 / 2.0 * max(chi2, 1.0)
    rms_deg, max_deg = _predicted(horizontal_mg, variance)
    turn = np.column_stack([unit, np.ones(len(unit))])
    singular = np.linalg.svd(turn, compute_uv=False)
    return Fit(
        method=METHOD,
        message="from level readings only; z, soft iron and misalignment are not in the prediction",
        samples=len(unit),
        offset_mg=np.array([offset[0], offset[1], 0.0]),
        matrix=np.diag([horizontal_mg / amplitude[0], horizontal_mg / amplitude[1], 1.0]),
        field_mg=horizontal_mg,
        parameters=PARAMETERS,
        covariance=np.eye(4) * variance,
        residual_rms_mg=residual_mg,
        chi2_reduced=chi2,
        dof=dof,
        rank=4,
        condition=float(singular[0] / singular[-1]),
        coverage=sphere_coverage(np.insert(unit, 2, 0.0, axis=1)),
        predicted_heading_rms_deg=rms_deg,
        predicted_heading_max_deg=max_deg,
        extra={
            "amplitude_x_mg": float(amplitude[0]),
            "amplitude_y_mg": float(amplitude[1]),
            "largest_gap_deg": largest_gap_deg(unit),
        },
    )


def _residual_mg(unit: NDArray[np.float64], amplitude: NDArray[np.float64]) -> float:
    """Return the RMS distance of the scaled turn from its circle."""
    radial = np.hypot(unit[:, 0], unit[:, 1]) - 1.0
    return float(np.sqrt((radial**2).mean())) * float(amplitude.mean())


def _horizontal_mg(data: CalibrationData, amplitude: NDArray[np.float64]) -> float:
    if data.station_field_mg is None:
        return float(amplitude.mean())
    return float(np.hypot(data.station_field_mg[0], data.station_field_mg[1]))


def _predicted(horizontal_mg: float, variance: float) -> tuple[float, float]:
    grid = heading_grid(np.array([horizontal_mg, 0.0, 0.0]), level_only=True)
    gradient = grid.field_gradient_deg[:, :2]
    by_amplitude = -gradient * grid.field_mg[:, :2] / horizontal_mg
    return predicted_heading_deg(np.hstack([-gradient, by_amplitude]), np.eye(4) * variance)
