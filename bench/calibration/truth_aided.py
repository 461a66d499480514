"""Coefficients of magnetometer and accelerometer from poses whose angles the rig knows.

What is written to the unit: 12 coefficients of each sensor, fitted together with the field's
azimuth against the rig's zero, its dip, and the two tilts of the rig's base, by generalised
least squares with the uncertainty of the rig's angles. The linear model raw = W v + b at known
attitude has no mirror image and no spurious minimum; it reaches the Cramer-Rao bound.

Not observable by any run on one seat: the seat's azimuth error and iron that is fixed to the
seat; and the magnetometer's common gain, which is held against the station's field strength.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.consistency import growth, largest_chi2
from bench.calibration.coverage import sphere_coverage
from bench.calibration.disturbed import contradiction, left_out, named
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.prediction import (
    DEFAULT_FIELD_MG,
    DOWN,
    heading_grid,
    model_jacobian,
    predicted_heading_deg,
)
from bench.calibration.saturation import STOPPED, saturated_axis
from bench.calibration.truth_disturbed import outstanding, undisturbed
from bench.calibration.truth_iteration import LARGEST
from bench.calibration.truth_model import (
    LARGEST_AXIS_RATIO,
    LARGEST_PREDICTED_DEG,
    LARGEST_RESIDUAL,
    SMALLEST,
    RigPoses,
    observed,
    poses_of,
)
from bench.calibration.truth_solver import Sensor, Solution, solved, started

if TYPE_CHECKING:
    from numpy.typing import NDArray

METHOD: Final = "truth_aided"
LEVEL_DEG: Final = 3.0
"""Poses tilted by less count as level."""
SMALLEST_SINGULAR: Final = 1e-5
_ELEMENTS: Final = ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz")
MAGNETOMETER_PARAMETERS: Final = (
    *(f"gain_{element}" for element in _ELEMENTS),
    *(f"offset_{axis}_mg" for axis in "xyz"),
    "field_azimuth_deg",
    "dip_deg",
)
ACCELEROMETER_PARAMETERS: Final = (
    *(f"accel_gain_{element}" for element in _ELEMENTS),
    *(f"accel_offset_{axis}_g" for axis in "xyz"),
    "base_level_north_deg",
    "base_level_east_deg",
)


def fit_truth_aided(data: CalibrationData) -> Fit:
    """Fit both sensors, field direction and base level on poses of known rig angles.

    Parameters
    ----------
    data : CalibrationData
        Needs the rig's three angles; without `accel_g` only the magnetometer is fitted and the
        base is taken as level. Without `station_field_mg` the field strength is that at which
        the matrix has a determinant of one.

    Returns
    -------
    Fit
        `extra` holds ``field_azimuth_deg``, ``dip_deg``, ``base_level_north_deg``,
        ``base_level_east_deg`` (rotations of the base about the rig's north and east axes),
        each with ``_sd``, and ``field_magnitude_mg``: the strength in the module's nominal
        scale, |det W|^(1/3) times the station's. The parameters are those of raw = W v + b; the
        covariance is the weights' own, times chi2_reduced where that exceeds one, and more where
        the noise is known and does not explain it (`consistency.growth`).
        Poses that contradict the others are left out and named in the message; `extra` then
        holds ``disturbed_poses`` and for each ``disturbed_<row>_sigmas``.
        Refused with NO_TRUTH, TOO_FEW, TILT_TOO_SMALL, NOT_OBSERVABLE, SATURATED,
        DEGENERATE, NOT_CONVERGED, RESIDUAL_TOO_LARGE or FIELD_DISTURBED (more than one pose in
        six disturbed).

    Notes
    -----
    Level poses give rank 3 of the accelerometer's 12, pitch or roll alone 9, both 12; the
    magnetometer's is 9 level and 12 with one tilt ring. `rank` counts both sensors (24).

    The rig's errors count as independent from pose to pose. An encoder's error is the same
    whenever an angle comes back, so that the standard deviations of the magnetometer's gains
    are up to 1.4 times too small; those of offsets, field azimuth and dip hold within a fifth.
    """
    poses = poses_of(data)
    if poses is None:
        message = "the truth-aided fit needs the rig's azimuth, pitch and roll of every reading"
        return refusal(METHOD, Cause.NO_TRUTH, message, data)
    if len(data) < SMALLEST:
        message = (
            f"the truth-aided fit needs at least {SMALLEST} poses; instead received {len(data)}"
        )
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    rank, condition = sensors_observed(data, poses)
    needed = 12 if data.accel_g is None else 24
    if rank < needed:
        return _unobservable(data, rank, needed, condition)
    if not np.abs(data.field_mg).max() <= LARGEST:
        message = f"a reading is beyond {LARGEST:.0e} mG, or is no number: no magnetometer reads so"
        return refusal(METHOD, Cause.DEGENERATE, message, data, rank=rank, condition=condition)
    held = saturated_axis(data.field_mg)
    if held is not None:
        message = f"axis {held} {STOPPED}"
        return refusal(METHOD, Cause.SATURATED, message, data, rank=rank, condition=condition)
    start = started(poses, data)
    broken = _broken(start)
    if broken:
        return refusal(METHOD, Cause.DEGENERATE, broken, data, rank=rank, condition=condition)
    solution = solved(start, poses, data.rig_sd_deg)
    if outstanding(solution, poses, data.rig_sd_deg):
        return _without_disturbed(data, solution, poses, rank, condition)
    return _checked(data, solution, poses, rank, condition)


def _without_disturbed(
    data: CalibrationData, solution: Solution, poses: RigPoses, rank: int, condition: float
) -> Fit:
    """Return the fit of the poses that do not contradict the others, with the rest named."""
    rest = undisturbed(data, poses, solution)
    if not rest.found:
        return _checked(data, solution, poses, rank, condition)
    needed = 12 if data.accel_g is None else 24
    if rest.solution is None or sensors_observed(rest.data, rest.poses)[0] < needed:
        seen = contradiction(rest.found, len(data))
        message = f"{seen}: the field around the module changed, or the rig was not where it said"
        return refusal(METHOD, Cause.FIELD_DISTURBED, message, data, rank=rank, condition=condition)
    fit = _checked(rest.data, rest.solution, rest.poses, *sensors_observed(rest.data, rest.poses))
    message = f"left out as disturbed: poses {named(rest.found)}"
    if fit.refused:
        return replace(fit, message=f"{fit.message}; {message}")
    return replace(fit, message=message, extra=fit.extra | left_out(rest.found))


def sensors_observed(data: CalibrationData, poses: RigPoses) -> tuple[int, float]:
    """Return (rank over both sensors, worse condition) that the rig's angles alone allow."""
    station = DEFAULT_FIELD_MG if data.station_field_mg is None else data.station_field_mg
    rank, condition = observed(poses.turned(station))
    if data.accel_g is not None:
        accel_rank, accel_condition = observed(poses.turned(DOWN))
        rank, condition = rank + accel_rank, max(condition, accel_condition)
    return rank, condition


def _unobservable(data: CalibrationData, rank: int, needed: int, condition: float) -> Fit:
    assert data.pitch_deg is not None  # noqa: S101
    assert data.roll_deg is not None  # noqa: S101
    tilt_deg = float(max(np.abs(data.pitch_deg).max(), np.abs(data.roll_deg).max()))
    if tilt_deg < LEVEL_DEG:
        cause = Cause.TILT_TOO_SMALL
        advice = f"the largest tilt is {tilt_deg:.1f} deg; add poses tilted in pitch and in roll"
    else:
        cause = Cause.NOT_OBSERVABLE
        advice = "add headings, and poses tilted both in pitch and in roll"
    message = f"the poses determine {rank} of {needed} sensor coefficients: {advice}"
    return refusal(METHOD, cause, message, data, rank=rank, condition=condition)


def _broken(solution: Solution) -> str:
    for name, sensor in (
        ("magnetometer", solution.magnetometer),
        ("accelerometer", solution.accelerometer),
    ):
        if sensor is None:
            continue
        values = np.linalg.svd(sensor.gain, compute_uv=False)
        if not values[-1] * LARGEST_AXIS_RATIO > values[0]:
            return (
                f"the {name}'s readings do not span three axes (gains from {values[0]:.3g} to "
                f"{values[-1]:.3g}): an axis is stuck or two axes read the same"
            )
    return ""


def _checked(
    data: CalibrationData, solution: Solution, poses: RigPoses, rank: int, condition: float
) -> Fit:
    assert solution.jacobian is not None  # noqa: S101
    columns = solution.jacobian / np.linalg.norm(solution.jacobian, axis=0)
    values = np.linalg.svd(columns, compute_uv=False)
    refuse = partial(refusal, METHOD, data=data, rank=rank, condition=condition)
    if not solution.converged:
        message = "the truth-aided fit did not settle: the rig's angles do not match the readings"
        return refuse(Cause.NOT_CONVERGED, message)
    if values[-1] < SMALLEST_SINGULAR * values[0]:
        found = int((values >= SMALLEST_SINGULAR * values[0]).sum())
        message = (
            f"the poses determine {found} of {len(values)} parameters: field direction or base "
            "level cannot be told from the sensors' misalignment; tilt in pitch and in roll"
        )
        return refuse(Cause.NOT_OBSERVABLE, message)
    fit = _fit_of(data, solution, poses, rank, condition)
    assert fit.residual_rms_mg is not None  # noqa: S101
    assert fit.predicted_heading_rms_deg is not None  # noqa: S101
    cause, message = _contradiction(data, solution, fit.residual_rms_mg)
    if cause is None and fit.predicted_heading_rms_deg > LARGEST_PREDICTED_DEG:
        cause = Cause.NOT_OBSERVABLE
        message = (
            f"the poses would leave a heading error of {fit.predicted_heading_rms_deg:.1f} deg "
            "RMS: tilt further or add poses"
        )
    if cause is None:
        return fit
    return refuse(
        cause, message, residual_rms_mg=fit.residual_rms_mg, chi2_reduced=fit.chi2_reduced
    )


def _contradiction(
    data: CalibrationData, solution: Solution, residual_mg: float
) -> tuple[Cause | None, str]:
    """Return what the residuals have against the fit, and the sentence; None if nothing."""
    assert solution.jacobian is not None  # noqa: S101
    equations, unknowns = solution.jacobian.shape
    dof = equations - unknowns
    chi2_reduced = solution.chi2 / max(dof, 1)
    relative = residual_mg / solution.field_mg
    blame = "the field moved, or the angles are not the unit's"
    if relative > LARGEST_RESIDUAL:
        limit = f"exceeds {100.0 * LARGEST_RESIDUAL:.0f} %"
        message = f"the residual of {100.0 * relative:.1f} % of the field {limit}: {blame}"
    elif data.noise_known and chi2_reduced > largest_chi2(dof):
        times = chi2_reduced**0.5
        message = f"the residual is {times:.1f} times what noise and rig explain: {blame}"
    else:
        return None, ""
    return Cause.RESIDUAL_TOO_LARGE, message


def _fit_of(
    data: CalibrationData, solution: Solution, poses: RigPoses, rank: int, condition: float
) -> Fit:
    magnetometer, accelerometer = solution.magnetometer, solution.accelerometer
    assert magnetometer is not None  # noqa: S101
    assert solution.covariance is not None  # noqa: S101
    assert solution.jacobian is not None  # noqa: S101
    equations, unknowns = solution.jacobian.shape
    chi2_reduced = solution.chi2 / max(equations - unknowns, 1)
    noise = max(chi2_reduced, 1.0)
    if data.noise_known:
        noise = float(growth(np.array(chi2_reduced), equations - unknowns))
    covariance = solution.covariance * noise
    rms_deg, max_deg = _predicted(solution, magnetometer, accelerometer, covariance)
    names = MAGNETOMETER_PARAMETERS + (ACCELEROMETER_PARAMETERS if accelerometer else ())
    units = np.array([_unit(name) for name in names])
    covariance = covariance * units[:, None] * units
    vectors = poses.turned(solution.field_rig_mg())
    return Fit(
        method=METHOD,
        samples=len(data),
        offset_mg=magnetometer.offset,
        matrix=_inverse(magnetometer.gain),
        accel_offset_g=accelerometer.offset if accelerometer else None,
        accel_matrix=_inverse(accelerometer.gain) if accelerometer else None,
        field_mg=solution.field_mg,
        dip_deg=float(np.rad2deg(solution.dip_rad)),
        parameters=names,
        covariance=covariance,
        residual_rms_mg=_residual_rms(magnetometer, vectors),
        accel_residual_rms_g=_accel_residual_rms_g(solution, poses),
        chi2_reduced=chi2_reduced,
        dof=equations - unknowns,
        rank=rank,
        condition=condition,
        coverage=sphere_coverage(vectors),
        predicted_heading_rms_deg=rms_deg,
        predicted_heading_max_deg=max_deg,
        extra=_extra(solution, magnetometer, names, covariance),
    )


def _unit(name: str) -> float:
    """Return the factor from the solver's unit of a parameter to that of its name."""
    return 180.0 / np.pi if name.startswith(("field_", "dip_", "base_")) else 1.0


def _inverse(gain: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array(np.linalg.inv(gain), dtype=float)


def _residual_rms(sensor: Sensor, vectors: NDArray[np.float64]) -> float:
    residual = sensor.raw - vectors @ sensor.gain.T - sensor.offset
    return float(np.sqrt((residual**2).mean()))


def _accel_residual_rms_g(solution: Solution, poses: RigPoses) -> float | None:
    if solution.accelerometer is None:
        return None
    return _residual_rms(solution.accelerometer, poses.turned(solution.force_rig_g()))


def _predicted(
    solution: Solution,
    magnetometer: Sensor,
    accelerometer: Sensor | None,
    covariance: NDArray[np.float64],
) -> tuple[float, float]:
    horizontal = solution.field_mg * np.cos(solution.dip_rad)
    vertical = solution.field_mg * np.sin(solution.dip_rad)
    grid = heading_grid(np.array([horizontal, 0.0, vertical]))
    jacobian = np.zeros((len(grid.field_mg), len(covariance)))
    jacobian[:, :12] = model_jacobian(grid.field_gradient_deg, grid.field_mg, magnetometer.gain)
    if accelerometer is not None:
        jacobian[:, 14:26] = model_jacobian(
            grid.force_gradient_deg, grid.force_g, accelerometer.gain
        )
    return predicted_heading_deg(jacobian, covariance)


def _extra(
    solution: Solution,
    magnetometer: Sensor,
    names: tuple[str, ...],
    covariance: NDArray[np.float64],
) -> dict[str, float]:
    values = {
        "field_azimuth_deg": solution.azimuth_rad,
        "dip_deg": solution.dip_rad,
        "base_level_north_deg": solution.north_rad,
        "base_level_east_deg": solution.east_rad,
    }
    extra: dict[str, float] = {}
    for name, value_rad in values.items():
        if name in names:
            index = names.index(name)
            extra[name] = float(np.rad2deg(value_rad))
            extra[f"{name}_sd"] = float(np.sqrt(covariance[index, index]))
    nominal = float(np.abs(np.linalg.det(magnetometer.gain)) ** (1.0 / 3.0))
    extra["field_magnitude_mg"] = solution.field_mg * nominal
    return extra
