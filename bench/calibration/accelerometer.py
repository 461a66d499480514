"""Accelerometer alone, from the rig's pitch and roll: 12 coefficients and the base's level.

An uncalibrated accelerometer of 30 mg and 1 deg costs 3 deg of level heading at dip 60; a few
milli-g cost more than the whole magnetometer. The truth-aided fit contains this one; it stands
alone for the comparison of methods and for units whose magnetometer is not to be touched.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from bench.calibration.accelerometer_batch import (
    CAUSES,
    LARGEST_RESIDUAL_G,
    SMALLEST,
    UNKNOWNS,
    AccelerometerFits,
    accelerometer_batch,
)
from bench.calibration.coverage import sphere_coverage
from bench.calibration.disturbed import contradiction, left_out, named
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.truth_aided import ACCELEROMETER_PARAMETERS
from bench.calibration.truth_disturbed import Undisturbed, outstanding, undisturbed
from bench.calibration.truth_model import RigPoses, poses_of
from bench.calibration.truth_solver import solved, started

METHOD: Final = "accelerometer"
NO_POSE_S_FAULT: Final = (Cause.NOT_OBSERVABLE, Cause.DEGENERATE)
"""Causes that no disturbed pose brings about, and that none is looked for."""


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
        part only. Poses that contradict the others are left out and named. Refused with
        NO_ACCELERATION, NO_TRUTH, TOO_FEW, NOT_OBSERVABLE, DEGENERATE, NOT_CONVERGED or
        RESIDUAL_TOO_LARGE.
    """
    if data.accel_g is None:
        message = "the accelerometer fit needs the specific force of every reading"
        return refusal(METHOD, Cause.NO_ACCELERATION, message, data)
    poses = poses_of(data)
    if poses is None:
        message = "the accelerometer fit needs the rig's azimuth, pitch and roll of every reading"
        return refusal(METHOD, Cause.NO_TRUTH, message, data)
    if len(data) < SMALLEST:
        message = (
            f"the accelerometer fit needs at least {SMALLEST} poses; instead received {len(data)}"
        )
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    everything = _fitted(data)
    if everything.cause in NO_POSE_S_FAULT:
        return everything
    seen = _without_disturbed(data, poses)
    if not seen.found:
        return everything
    if seen.solution is None:
        message = f"{contradiction(seen.found, len(data))}: the module moved while it was read"
        return refusal(METHOD, Cause.RESIDUAL_TOO_LARGE, message, data)
    fit = _fitted(seen.data)
    message = f"{fit.message}; left out as disturbed: poses {named(seen.found)}"
    return replace(fit, message=message, extra=fit.extra | left_out(seen.found))


def _without_disturbed(data: CalibrationData, poses: RigPoses) -> Undisturbed:
    start = started(poses, data, with_magnetometer=False)
    solution = solved(start, poses, data.rig_sd_deg)
    if outstanding(solution, poses, data.rig_sd_deg):
        return undisturbed(data, poses, solution)
    return Undisturbed(found=(), data=data, poses=poses, solution=solution)


def _fitted(data: CalibrationData) -> Fit:
    assert data.accel_g is not None  # noqa: S101
    angles = (data.azimuth_deg, data.pitch_deg, data.roll_deg)
    fits = accelerometer_batch(
        np.column_stack([one for one in angles if one is not None]),
        data.accel_g,
        accel_sd_g=data.accel_sd_g,
        rig_sd_deg=data.rig_sd_deg,
        station_field_mg=data.station_field_mg,
        noise_known=data.noise_known,
    )
    cause = CAUSES[int(fits.cause)]
    if cause is not None:
        return _refused(data, fits, cause)
    matrix = np.array(np.linalg.inv(fits.gain), dtype=float)
    force = (data.accel_g - fits.offset_g) @ matrix.T
    return Fit(
        method=METHOD,
        message="the magnetometer stays raw; the prediction holds the accelerometer's part only",
        samples=len(data),
        offset_mg=np.zeros(3),
        matrix=np.eye(3),
        accel_offset_g=fits.offset_g,
        accel_matrix=matrix,
        parameters=ACCELEROMETER_PARAMETERS,
        covariance=fits.covariance,
        accel_residual_rms_g=float(fits.residual_rms_g),
        chi2_reduced=float(fits.chi2_reduced),
        dof=3 * len(data) - UNKNOWNS,
        rank=int(fits.rank),
        condition=float(fits.condition),
        coverage=sphere_coverage(force),
        predicted_heading_rms_deg=float(fits.predicted_rms_deg),
        predicted_heading_max_deg=float(fits.predicted_max_deg),
        extra=_base_level(fits),
    )


def _base_level(fits: AccelerometerFits) -> dict[str, float]:
    sd_deg = np.sqrt(np.diagonal(fits.covariance)[12:])
    return {
        "base_level_north_deg": float(fits.base_level_north_deg),
        "base_level_north_deg_sd": float(sd_deg[0]),
        "base_level_east_deg": float(fits.base_level_east_deg),
        "base_level_east_deg_sd": float(sd_deg[1]),
    }


def _refused(data: CalibrationData, fits: AccelerometerFits, cause: Cause) -> Fit:
    residual_g = float(fits.residual_rms_g)
    limit = f"exceeds {LARGEST_RESIDUAL_G:.2f} g"
    if residual_g <= LARGEST_RESIDUAL_G:
        limit = f"is {float(fits.chi2_reduced) ** 0.5:.1f} times what noise and rig explain"
    sentences = {
        Cause.NOT_OBSERVABLE: f"the poses determine {int(fits.rank)} of the accelerometer's 12 "
        "coefficients: tilt in pitch and in roll",
        Cause.DEGENERATE: "the accelerometer's readings do not span three axes: an axis is stuck",
        Cause.NOT_CONVERGED: "the accelerometer fit did not settle: the angles do not match the "
        "readings",
        Cause.RESIDUAL_TOO_LARGE: f"the accelerometer's residual of {residual_g:.3g} g {limit}: "
        "the module moved while it was read",
    }
    return refusal(
        METHOD,
        cause,
        sentences[cause],
        data,
        rank=int(fits.rank),
        condition=float(fits.condition),
        chi2_reduced=float(fits.chi2_reduced),
    )
