"""From the recording of one unit to the Fit of its x and y: level rows, refusals, prediction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from bench.calibration.coverage import sphere_coverage
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.level_kernel import DISTURBED_SIGMA, LARGEST_MG, LevelFits, refused_cause
from bench.calibration.prediction import grid_attitudes_deg, predicted_heading_deg
from bench.calibration.saturation import STOPPED, saturated_axis
from bench.calibration.tilt import attitude_deg
from protocols.angles import wrap_180_deg, wrap_360_deg

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

LEVEL_DEG: Final = 5.0
"""Rows tilted by more are left out where the tilt is known."""
RETURNED_SHARE: Final = 0.03
"""Change between two readings at one azimuth, as a part of the amplitude."""
AMPLITUDE_PARAMETERS: Final = (
    "offset_x_mg",
    "offset_y_mg",
    "amplitude_x_mg",
    "amplitude_y_mg",
)
TURNED_DEG: Final = 2.0
"""Shift of the heading between the halves of a turn: 9 mG of 250."""
SAME_AZIMUTH_DEG: Final = 0.2
Kernel = TypeVar("Kernel", bound=LevelFits)


def fit_level_turn(
    method: str,
    data: CalibrationData,
    smallest: int,
    kernel: Callable[..., Kernel],
    fit_of: Callable[[Kernel, NDArray[np.float64]], Fit],
) -> Fit:
    """Fit all level rows of one unit by a kernel, or refuse with its cause and one sentence.

    Parameters
    ----------
    smallest : int
        Fewest level rows.
    kernel : callable
        ``kernel(field_mg, field_sd_mg, horizontal_mg=...)`` returns the LevelFits.
    fit_of : callable
        Makes the Fit of accepted LevelFits and the readings, shape (n, 2).
    """
    rows = level_rows(data)
    refused = refused_rows(method, data, rows, smallest)
    if refused is not None:
        return refused
    field_mg = data.field_mg[rows][:, :2]
    fits = kernel(field_mg, data.field_sd_mg, horizontal_mg=station_horizontal_mg(data))
    refused = refused_fit(method, data, fits)
    if refused is None and data.azimuth_deg is not None:
        turned_deg = halves_turned_deg(fits.corrected_mg(field_mg), data.azimuth_deg[rows])
        if abs(turned_deg) > TURNED_DEG:
            message = (
                f"the heading of the second half of the turn is {turned_deg:.1f} deg off that of "
                "the first: the field changed during the turn"
            )
            return refusal(method, Cause.FIELD_DISTURBED, message, data)
    return refused or fit_of(fits, field_mg)


def refused_rows(
    method: str, data: CalibrationData, rows: NDArray[np.bool_], smallest: int
) -> Fit | None:
    """Return a refusal of level rows that are too few, saturated or of a field that changed."""
    if rows.sum() < smallest:
        message = (
            f"a level turn needs at least {smallest} readings within {LEVEL_DEG:.0f} deg of "
            f"level; instead received {rows.sum()}"
        )
        return refusal(method, Cause.TOO_FEW, message, data)
    field_mg = data.field_mg[rows]
    if np.abs(field_mg).max() > LARGEST_MG:
        message = f"a reading of {np.abs(field_mg).max():.3g} mG is no magnetometer's"
        return refusal(method, Cause.DEGENERATE, message, data)
    held = saturated_axis(field_mg)
    if held is not None:
        message = f"axis {held} {STOPPED}"
        return refusal(method, Cause.SATURATED, message, data)
    amplitude_mg = float(np.ptp(field_mg[:, :2], axis=0).mean()) / 2.0
    change_mg = returned_change_mg(data, rows)
    limit_mg = max(RETURNED_SHARE * amplitude_mg, DISTURBED_SIGMA * data.field_sd_mg)
    if change_mg > limit_mg:
        message = (
            f"two readings at one azimuth differ by {change_mg:.1f} mG, more than "
            f"{limit_mg:.1f}: the field changed during the turn"
        )
        return refusal(method, Cause.FIELD_DISTURBED, message, data)
    return None


def refused_fit(
    method: str, data: CalibrationData, fits: LevelFits, message: str | None = None
) -> Fit | None:
    """Return the refusal of LevelFits of one unit with their cause's sentence; None if accepted."""
    cause = refused_cause(fits.cause)
    if cause is None:
        return None
    share = 100.0 * float(fits.residual_rms_mg) / max(float(fits.horizontal_mg), 1e-9)
    sentences = {
        Cause.NO_TURN: f"the turn leaves a gap of {fits.gap_deg:.0f} deg, or the readings hardly "
        "change: turn through all headings",
        Cause.SATURATED: f"an axis {STOPPED}",
        Cause.DEGENERATE: "the readings lie on no ellipse of usable shape: no full turn, or an "
        "axis is stuck",
        Cause.FIELD_DISTURBED: "the halves of the turn differ: the field changed during the turn",
        Cause.RESIDUAL_TOO_LARGE: f"the readings are {share:.0f} % off the model: tilted, a field "
        "that changed, or iron that this method cannot take out",
        Cause.NOT_CONVERGED: "the fit did not settle: the readings lie on no ellipse",
    }
    return refusal(
        method,
        cause,
        message or sentences[cause],
        data,
        coverage=1.0 - float(fits.gap_deg) / 360.0,
        residual_rms_mg=float(fits.residual_rms_mg),
    )


def level_rows(data: CalibrationData, within_deg: float = LEVEL_DEG) -> NDArray[np.bool_]:
    """Return which rows, shape (n,), are level: by the rig, else by the raw force, else all."""
    if data.pitch_deg is not None and data.roll_deg is not None:
        pitch_deg, roll_deg = data.pitch_deg, data.roll_deg
    elif data.accel_g is not None:
        pitch_deg, roll_deg = attitude_deg(data.accel_g)
    else:
        return np.ones(len(data), dtype=bool)
    return np.asarray(np.maximum(np.abs(pitch_deg), np.abs(roll_deg)) < within_deg)


def returned_change_mg(data: CalibrationData, rows: NDArray[np.bool_]) -> float:
    """Return the largest change of x and y between two of the rows at one rig azimuth; 0 if none.

    Hysteresis of a sound sensor is one or two mG; more is a field that changed meanwhile.
    """
    if data.azimuth_deg is None or rows.sum() < 2:
        return 0.0
    azimuth_deg = wrap_360_deg(data.azimuth_deg[rows])
    order = np.argsort(azimuth_deg, kind="stable")
    field_mg = data.field_mg[rows][order, :2]
    change_mg = np.linalg.norm(np.roll(field_mg, -1, axis=0) - field_mg, axis=1)
    step_deg = wrap_180_deg(np.roll(azimuth_deg[order], -1) - azimuth_deg[order])
    return float(np.max(change_mg, where=np.abs(step_deg) < SAME_AZIMUTH_DEG, initial=0.0))


def halves_turned_deg(corrected_mg: NDArray[np.float64], azimuth_deg: NDArray[np.float64]) -> float:
    """Return the heading's shift from the first to the second half of the rows.

    0 if it does not stand out. Within one turn a field whose direction changed half-way makes a
    good ellipse; the rig's azimuth shows it. The two-cycle error that soft iron may leave is
    regressed out. A magnet that joined the module half-way looks like soft iron and is not seen.

    Parameters
    ----------
    corrected_mg, azimuth_deg : ndarray, shape (n, 2) and (n,)
        Corrected x and y in order of time and the rig's azimuth.
    """
    heading_rad = np.arctan2(-corrected_mg[:, 1], corrected_mg[:, 0])
    off_deg = wrap_180_deg(np.rad2deg(heading_rad) - azimuth_deg)
    off_deg = wrap_180_deg(off_deg - off_deg[0])
    later = np.where(np.arange(len(off_deg)) < len(off_deg) / 2.0, -0.5, 0.5)
    design = np.column_stack(
        [np.ones_like(later), np.cos(2.0 * heading_rad), np.sin(2.0 * heading_rad), later]
    )
    inverse = np.linalg.pinv(design)
    solution = inverse @ off_deg
    residual_deg = off_deg - design @ solution
    variance = float(residual_deg @ residual_deg) / max(len(off_deg) - 4, 1)
    sd_deg = float(np.sqrt(variance * (inverse[3] ** 2).sum()))
    return float(solution[3]) if abs(solution[3]) > 3.0 * sd_deg else 0.0


def station_horizontal_mg(data: CalibrationData) -> float | None:
    """Return the station's horizontal field, None where it is not known."""
    station = data.station_field_mg
    return None if station is None else float(np.hypot(station[0], station[1]))


def amplitude_fit(
    method: str,
    fits: LevelFits,
    field_mg: NDArray[np.float64],
    amplitude_mg: NDArray[np.float64],
    *,
    dof: int,
    extra: dict[str, float] | None = None,
) -> Fit:
    """Return the Fit of a method whose matrix is diag(H/A), see `level_fit`."""
    return level_fit(
        method,
        fits,
        field_mg,
        parameters=AMPLITUDE_PARAMETERS,
        matrix_slopes=amplitude_slopes(fits.matrix, amplitude_mg),
        dof=dof,
        extra={
            "amplitude_x_mg": float(amplitude_mg[0]),
            "amplitude_y_mg": float(amplitude_mg[1]),
            **(extra or {}),
        },
    )


def amplitude_slopes(
    matrix: NDArray[np.float64], amplitude_mg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the derivative, (..., 4, 2, 2), of diag(H/A) by offset x, y (none), A of x, of y."""
    slopes = np.zeros((*matrix.shape[:-2], 4, 2, 2))
    for axis in range(2):
        safe_mg = np.maximum(amplitude_mg[..., axis], 1e-9)
        slopes[..., 2 + axis, axis, axis] = -matrix[..., axis, axis] / safe_mg
    return slopes


def level_fit(
    method: str,
    fits: LevelFits,
    field_mg: NDArray[np.float64],
    *,
    parameters: tuple[str, ...],
    matrix_slopes: NDArray[np.float64],
    dof: int,
    extra: dict[str, float],
) -> Fit:
    """Return the Fit of one accepted unit: z keeps offset 0 and gain 1.

    Parameters
    ----------
    fits : LevelFits
        Of one unit, without leading axes.
    field_mg : ndarray, shape (n, 2)
        The readings that it was fitted to.
    parameters, matrix_slopes
        Names of the parameters, and the matrix's derivative by each, see `predicted_level_deg`.
    """
    matrix = np.eye(3)
    matrix[:2, :2] = fits.matrix
    rms_deg, max_deg = predicted_level_deg(fits, matrix_slopes)
    unit = fits.corrected_mg(field_mg) / fits.horizontal_mg
    singular = np.linalg.svd(np.column_stack([unit, np.ones(len(unit))]), compute_uv=False)
    return Fit(
        method=method,
        message="from level readings only; z, tilt and misalignment are not in the prediction",
        samples=len(field_mg),
        offset_mg=np.append(fits.offset_mg, 0.0),
        matrix=matrix,
        field_mg=float(fits.horizontal_mg),
        parameters=parameters,
        covariance=fits.covariance,
        residual_rms_mg=float(fits.residual_rms_mg),
        chi2_reduced=float(fits.chi2_reduced),
        dof=dof,
        rank=len(parameters),
        condition=float(singular[0] / singular[-1]),
        coverage=sphere_coverage(np.insert(unit, 2, 0.0, axis=1)),
        predicted_heading_rms_deg=rms_deg,
        predicted_heading_max_deg=max_deg,
        extra={**extra, "largest_gap_deg": float(fits.gap_deg)},
    )


def predicted_level_deg(fits: LevelFits, matrix_slopes: NDArray[np.float64]) -> tuple[float, float]:
    """Return (RMS, maximum) in degrees of the heading error that one unit's covariance predicts.

    Over 24 level headings: what offset and matrix of x and y leave there, not what z and tilt add.

    Parameters
    ----------
    fits : LevelFits
        Of one unit, without leading axes.
    matrix_slopes : ndarray, shape (p, 2, 2)
        Derivative of the matrix by each parameter; the first two are the offset's: zero.
    """
    heading_rad = np.deg2rad(grid_attitudes_deg(level_only=True)[:, 0])
    seen_mg = fits.horizontal_mg * np.column_stack([np.cos(heading_rad), -np.sin(heading_rad)])
    gradient = np.column_stack([seen_mg[:, 1], -seen_mg[:, 0]]) / fits.horizontal_mg**2
    raw_mg = np.linalg.solve(fits.matrix, seen_mg.T).T
    jacobian = np.einsum("ni,pij,nj->np", gradient, matrix_slopes, raw_mg)
    jacobian[:, :2] -= gradient @ fits.matrix
    return predicted_heading_deg(np.rad2deg(jacobian), fits.covariance)
