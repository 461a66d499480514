"""Magnetometer against the accelerometer alone: matrix, offset and dip.

The accelerometer says where down is; the angle between down and the field is the same in every
pose. This makes the rotation from magnetometer to accelerometer observable, which the
magnetometer alone leaves open. It needs poses tilted in pitch and in roll: about one axis alone
a mirror image fits as well, with the dip's sign turned.

The rig's angles, where they are known, only correct the force (`bench.calibration.tilt_force`).
A force that stays raw is not taken for exact: what it may be off is in covariance and prediction.

Poses that contradict all others are named and left out; they are never only weighted down.

References
----------
.. [1] M. Kok and T. B. Schon, "Magnetometer Calibration Using Inertial Sensors", IEEE Sensors
   Journal 16(14), 2016.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import sphere_coverage
from bench.calibration.disturbed import (
    Disturbance,
    Search,
    contradiction,
    disturbed_poses,
    left_out,
    named,
    search,
)
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.saturation import saturated_axis
from bench.calibration.tilt_aided_batch import (
    CAUSES,
    LARGEST_PREDICTED_DEG,
    SMALLEST,
    SMALLEST_MIRROR,
    TiltAidedFits,
    tilt_aided_batch,
)
from bench.calibration.tilt_force import (
    RAW_BIAS_SD_G,
    Force,
    ForceCost,
    force_cost,
    force_of,
)
from bench.calibration.tilt_readings import UNKNOWNS, readings_of, tilt_minimum

if TYPE_CHECKING:
    from numpy.typing import NDArray

METHOD: Final = "tilt_aided"
NO_POSE_S_FAULT: Final = (
    Cause.NO_TURN,
    Cause.NO_ACCELERATION,
    Cause.TILT_TOO_SMALL,
    Cause.SATURATED,
)
"""Causes that no disturbed pose brings about, and that none is looked for."""
_ELEMENTS: Final = ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz")
PARAMETERS: Final = (
    *(f"matrix_{element}" for element in _ELEMENTS),
    *(f"offset_{axis}_mg" for axis in "xyz"),
    "dip_deg",
)


def fit_tilt_aided(data: CalibrationData) -> Fit:
    """Fit the magnetometer's matrix and offset, and the dip, against the accelerometer.

    Parameters
    ----------
    data : CalibrationData
        Needs `accel_g`. Where the `accelerometer` fit of the same readings accepts, its
        coefficients correct the force and go along with the fit; else the force stays raw, and
        the matrix takes the magnetometer to *its* axes. The strength is the station's, or
        without one that of a matrix of determinant one.

    Returns
    -------
    Fit
        `accel_from` says whose accelerometer coefficients it took: ``accelerometer`` or ``raw``.
        `extra` holds ``dip_deg_sd``, ``misalignment_deg`` (rotation from the magnetometer's to
        the accelerometer's axes), ``residual_correlation`` (from pose to pose; 0 if it is
        noise's), ``drift_deg`` (change of the heading if field and offset are let drift over
        the run; 0 if they do not), ``disturbed_poses`` and for each one left out
        ``disturbed_<row>_sigmas``; the message names them. Refused with NO_ACCELERATION, TOO_FEW,
        NO_TURN, TILT_TOO_SMALL, SATURATED, NOT_OBSERVABLE, DEGENERATE, NOT_CONVERGED,
        RESIDUAL_TOO_LARGE or FIELD_DISTURBED.
    """
    if data.accel_g is None:
        message = "the tilt-aided fit needs the specific force of every reading"
        return refusal(METHOD, Cause.NO_ACCELERATION, message, data)
    if len(data) < SMALLEST:
        message = (
            f"the tilt-aided fit needs at least {SMALLEST} poses; instead received {len(data)}"
        )
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    return fit_with_force(data, force_of(data, data.accel_g))


def fit_with_force(data: CalibrationData, force: Force) -> Fit:
    """Fit at least 8 poses against a force of known uncertainty; see `fit_tilt_aided`."""
    everything = np.ones(len(data), dtype=bool)
    fits = _fitted(data, force, everything)
    cause = CAUSES[int(fits.cause)]
    if cause in NO_POSE_S_FAULT:
        return _refused(data, fits, cause)
    seen = search(len(data), partial(_disturbances, data, force))
    if seen.hopeless:
        message = f"{contradiction(seen.found, len(data))}: the field around the module changed"
        return refusal(METHOD, Cause.FIELD_DISTURBED, message, data)
    if seen.found:
        fits = _fitted(data, force, seen.kept)
        cause = CAUSES[int(fits.cause)]
    if cause is not None:
        return _refused(data, fits, cause, seen.found)
    cost = force_cost(data, seen.kept, force, fits)
    if cost.rms_deg > LARGEST_PREDICTED_DEG:
        return _refused(data, fits, Cause.NOT_OBSERVABLE, seen.found)
    return _accepted(data, fits, seen, force, cost)


def _fitted(data: CalibrationData, force: Force, kept: NDArray[np.bool_]) -> TiltAidedFits:
    return tilt_aided_batch(
        data.field_mg[kept],
        force.accel_g[kept],
        data.field_sd_mg,
        data.accel_sd_g,
        station_field_mg=data.station_field_mg,
        raw_force=force.raw,
        noise_known=data.noise_known,
    )


def _disturbances(
    data: CalibrationData, force: Force, kept: NDArray[np.bool_]
) -> tuple[Disturbance, ...] | None:
    """Return the poses, of all, that contradict the rest under the fit of the kept ones.

    None where these have no fit. What a raw force may be off is no disturbance: its coefficients
    are let free here.
    """
    noise = (data.field_sd_mg, data.accel_sd_g)
    mine = readings_of(data.field_mg[None, kept], force.accel_g[None, kept], *noise)
    best = tilt_minimum(mine)
    if not np.isfinite(best.chi2[0]):
        return None
    every = mine.extended(data.field_mg[None], force.accel_g[None])
    residual, jacobian = every.rows(best.parameters, np.array([0]))
    columns = jacobian[0]
    if force.raw:
        columns = np.concatenate([columns, every.force_columns(best.parameters)[0]], axis=1)
    count = len(data)
    by_pose = np.swapaxes(residual.reshape(2, count), 0, 1)
    return disturbed_poses(by_pose, np.swapaxes(columns.reshape(2, count, -1), 0, 1))


def _refused(
    data: CalibrationData,
    fits: TiltAidedFits,
    cause: Cause,
    found: tuple[Disturbance, ...] = (),
) -> Fit:
    relative = 100.0 * float(fits.residual_rms_mg) / max(float(fits.field_mg), 1e-9)
    sentences = {
        Cause.NO_TURN: "all readings are the same: turn the module through all directions",
        Cause.NO_ACCELERATION: "the force is near zero in a reading: the module fell or is dead",
        Cause.TILT_TOO_SMALL: "the poses are all of one tilt: tilt the module in pitch and in roll",
        Cause.SATURATED: f"axis {saturated_axis(data.field_mg)} stops at one value: the sensor is "
        "saturated; degauss the module",
        Cause.NOT_OBSERVABLE: _unobservable(fits),
        Cause.DEGENERATE: "the readings lie on no ellipsoid, or have a dip of "
        f"{float(fits.dip_deg):.0f} deg: an axis is stuck or mirrored, or the force has its sign",
        Cause.FIELD_DISTURBED: "field or offset drifted over the run, by "
        f"{float(fits.drift_deg):.1f} deg of heading: keep iron away, let the module warm up",
        Cause.NOT_CONVERGED: "the tilt-aided fit did not settle: cover more directions",
        Cause.RESIDUAL_TOO_LARGE: f"the residual of {relative:.2g} % of the field is "
        f"{float(fits.chi2_reduced) ** 0.5:.1f} times the noise: the field around the module "
        "changed",
    }
    without = f"; left out as disturbed: poses {named(found)}" if found else ""
    return refusal(
        METHOD,
        cause,
        sentences[cause] + without,
        data,
        rank=int(fits.rank),
        condition=float(fits.condition),
        residual_rms_mg=float(fits.residual_rms_mg),
        chi2_reduced=float(fits.chi2_reduced),
    )


def _unobservable(fits: TiltAidedFits) -> str:
    if float(fits.mirror) < SMALLEST_MIRROR:
        return "the poses tilt about one axis and leave a mirror image: tilt in pitch and in roll"
    return (
        "the poses would leave a heading error of more than "
        f"{LARGEST_PREDICTED_DEG:.0f} deg RMS: tilt further, in pitch and in roll, or add poses"
    )


def _accepted(
    data: CalibrationData,
    fits: TiltAidedFits,
    seen: Search,
    force: Force,
    cost: ForceCost,
) -> Fit:
    count = int(seen.kept.sum())
    corrected = (data.field_mg[seen.kept] - fits.offset_mg) @ fits.matrix.T
    extra = {
        "dip_deg_sd": float(np.sqrt(cost.covariance[12, 12])),
        "misalignment_deg": _misalignment_deg(fits.matrix),
        "residual_correlation": float(fits.correlation),
        "drift_deg": float(fits.drift_deg),
        **left_out(seen.found),
    }
    return Fit(
        method=METHOD,
        message=_message(seen.found, force),
        samples=count,
        offset_mg=fits.offset_mg,
        matrix=fits.matrix,
        field_mg=float(fits.field_mg),
        dip_deg=float(fits.dip_deg),
        parameters=PARAMETERS,
        covariance=cost.covariance,
        residual_rms_mg=float(fits.residual_rms_mg),
        chi2_reduced=float(fits.chi2_reduced),
        dof=2 * count - UNKNOWNS,
        rank=int(fits.rank),
        condition=float(fits.condition),
        coverage=sphere_coverage(corrected),
        predicted_heading_rms_deg=cost.rms_deg,
        predicted_heading_max_deg=cost.max_deg,
        accel_offset_g=None if force.raw else force.offset_g,
        accel_matrix=None if force.raw else np.array(np.linalg.inv(force.gain), dtype=float),
        accel_from=force.source,
        extra=extra,
    )


def _message(found: tuple[Disturbance, ...], force: Force) -> str:
    parts = [f"left out as disturbed: poses {named(found)}"] if found else []
    if force.raw:
        parts.append(
            f"the force is raw: {1000.0 * RAW_BIAS_SD_G:.0f} mg of bias are in the prediction"
        )
    return "; ".join(parts)


def _misalignment_deg(matrix: NDArray[np.float64]) -> float:
    """Return the angle of the rotation in matrix = rotation @ symmetric."""
    left, _, right = np.linalg.svd(matrix)
    cosine = (float(np.trace(left @ right)) - 1.0) / 2.0
    return float(np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0))))
