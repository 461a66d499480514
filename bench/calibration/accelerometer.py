"""Accelerometer alone, from the rig's pitch and roll: 12 coefficients and the base's level.

An uncalibrated accelerometer of 30 mg and 1 deg costs 3 deg of level heading at dip 60; a few
milli-g cost more than the whole magnetometer. The truth-aided fit contains this one; it stands
alone for the comparison of methods and for units whose magnetometer is not to be touched.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import sphere_coverage
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.prediction import heading_grid, model_jacobian, predicted_heading_deg
from bench.calibration.truth_aided import ACCELEROMETER_PARAMETERS
from bench.calibration.truth_model import LARGEST_AXIS_RATIO, RigPoses, observed, rig_poses
from bench.calibration.truth_solver import DOWN, Sensor, Solution, solved, started

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

METHOD: Final = "accelerometer"
LARGEST_RESIDUAL_G: Final = 0.15


def fit_accelerometer(data: CalibrationData) -> Fit:
    """Fit bias, gain and misalignment of the accelerometer on poses of known pitch and roll.

    Parameters
    ----------
    data : CalibrationData
        Needs `accel_g` and the rig's angles, tilted in pitch and in roll: level poses give
        rank 3 of 12, one tilt 6, pitch only or roll only 9.

    Returns
    -------
    Fit
        The magnetometer stays raw (offset 0, matrix 1); the prediction holds the accelerometer's
        part only. Refused with NO_ACCELERATION, NO_TRUTH, TOO_FEW, NOT_OBSERVABLE, DEGENERATE,
        NOT_CONVERGED or RESIDUAL_TOO_LARGE.
    """
    if data.accel_g is None:
        message = "the accelerometer fit needs the specific force of every reading"
        return refusal(METHOD, Cause.NO_ACCELERATION, message, data)
    if data.azimuth_deg is None or data.pitch_deg is None or data.roll_deg is None:
        message = "the accelerometer fit needs the rig's azimuth, pitch and roll of every reading"
        return refusal(METHOD, Cause.NO_TRUTH, message, data)
    if len(data) < 5:
        message = f"the accelerometer fit needs at least 5 poses; instead received {len(data)}"
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    poses = rig_poses(data.azimuth_deg, data.pitch_deg, data.roll_deg)
    rank, condition = observed(poses.turned(DOWN))
    refuse = partial(refusal, METHOD, data=data, rank=rank, condition=condition)
    if rank < 12:
        message = (
            f"the poses determine {rank} of the accelerometer's 12 coefficients: tilt in pitch "
            "and in roll"
        )
        return refuse(Cause.NOT_OBSERVABLE, message)
    return _solved(data, poses, refuse)


def _solved(data: CalibrationData, poses: RigPoses, refuse: Callable[..., Fit]) -> Fit:
    start = started(poses, data, with_magnetometer=False)
    assert start.accelerometer is not None  # noqa: S101
    values = np.linalg.svd(start.accelerometer.gain, compute_uv=False)
    if not values[-1] * LARGEST_AXIS_RATIO > values[0]:
        message = "the accelerometer's readings do not span three axes: an axis is stuck"
        return refuse(Cause.DEGENERATE, message)
    solution = solved(start, poses, data.rig_sd_deg)
    sensor = solution.accelerometer
    assert sensor is not None  # noqa: S101
    vectors = poses.turned(solution.force_rig_g())
    residual_g = float(
        np.sqrt(((sensor.raw - vectors @ sensor.gain.T - sensor.offset) ** 2).mean())
    )
    if not solution.converged:
        message = "the accelerometer fit did not settle: the angles do not match the readings"
        return refuse(Cause.NOT_CONVERGED, message)
    if residual_g > LARGEST_RESIDUAL_G:
        message = (
            f"the accelerometer's residual of {residual_g:.3f} g exceeds "
            f"{LARGEST_RESIDUAL_G:.2f} g: the module moved while it was read"
        )
        return refuse(Cause.RESIDUAL_TOO_LARGE, message)
    return _fit_of(data, solution, sensor, vectors, residual_g)


def _fit_of(
    data: CalibrationData,
    solution: Solution,
    sensor: Sensor,
    vectors: NDArray[np.float64],
    residual_g: float,
) -> Fit:
    assert solution.covariance is not None  # noqa: S101
    assert solution.jacobian is not None  # noqa: S101
    rank, condition = observed(vectors)
    equations, unknowns = solution.jacobian.shape
    chi2 = solution.chi2 / max(equations - unknowns, 1)
    covariance = solution.covariance * max(chi2, 1.0)
    rms_deg, max_deg = _predicted(data, sensor.gain, covariance)
    to_deg = np.ones(14)
    to_deg[12:] = 180.0 / np.pi
    covariance = covariance * to_deg[:, None] * to_deg
    return Fit(
        method=METHOD,
        message="the magnetometer stays raw; the prediction holds the accelerometer's part only",
        samples=len(data),
        offset_mg=np.zeros(3),
        matrix=np.eye(3),
        accel_offset_g=sensor.offset,
        accel_matrix=np.array(np.linalg.inv(sensor.gain), dtype=float),
        parameters=ACCELEROMETER_PARAMETERS,
        covariance=covariance,
        accel_residual_rms_g=residual_g,
        chi2_reduced=chi2,
        dof=equations - unknowns,
        rank=rank,
        condition=condition,
        coverage=sphere_coverage(vectors),
        predicted_heading_rms_deg=rms_deg,
        predicted_heading_max_deg=max_deg,
        extra=_base_level(solution, np.sqrt(np.diag(covariance)[12:])),
    )


def _base_level(solution: Solution, sd_deg: NDArray[np.float64]) -> dict[str, float]:
    return {
        "base_level_north_deg": float(np.rad2deg(solution.north_rad)),
        "base_level_north_deg_sd": float(sd_deg[0]),
        "base_level_east_deg": float(np.rad2deg(solution.east_rad)),
        "base_level_east_deg_sd": float(sd_deg[1]),
    }


def _predicted(
    data: CalibrationData, gain: NDArray[np.float64], covariance: NDArray[np.float64]
) -> tuple[float, float]:
    level = None
    if data.station_field_mg is not None:
        north, east, down = data.station_field_mg
        level = np.array([np.hypot(north, east), 0.0, down])
    grid = heading_grid(level)
    jacobian = model_jacobian(grid.force_gradient_deg, grid.force_g, gain)
    return predicted_heading_deg(jacobian, covariance[:12, :12])
