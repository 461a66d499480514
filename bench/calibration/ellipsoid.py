"""Magnetometer alone: offset and symmetric matrix that put the readings on a sphere.

The numbers are those of `bench.calibration.ellipsoid_batch`: Taubin's ellipsoid as the start,
the Sampson likelihood as the end. Here are its sentences, and what an accelerometer tells besides.

The rotation between sensor and body is unobservable: the predicted heading error is that of
offset and symmetric matrix only, without rotation.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import sphere_coverage
from bench.calibration.disturbed import contradiction, left_out, named, search
from bench.calibration.ellipsoid_batch import (
    CAUSES,
    FLAT,
    LARGEST_PREDICTED_DEG,
    LARGEST_RESIDUAL,
    SMALLEST,
    ellipsoid_batch,
)
from bench.calibration.ellipsoid_disturbed import off_the_ellipsoid
from bench.calibration.ellipsoid_specific import witness
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal, rows_of
from bench.calibration.saturation import STOPPED, saturated_axis
from bench.calibration.sphere_minimum import UNKNOWNS
from bench.calibration.sphere_model import SYMMETRIC_COLUMNS, SYMMETRIC_ROWS, folded
from bench.calibration.sphere_prediction import predicted_at
from bench.calibration.taubin import LARGEST_MG
from bench.calibration.tilt import attitude_deg
from bench.calibration.tilt_readings import SMALLEST_FORCE_G
from bench.calibration.tilt_start import mounted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.sphere_fits import SphereFits

METHOD: Final = "ellipsoid"
NO_POSE_S_FAULT: Final = (Cause.NO_TURN, Cause.TILT_TOO_SMALL, Cause.SATURATED)
"""Causes that no disturbed pose brings about, and that none is looked for."""
UNSEEN: Final = "the rotation between sensor and body is unobservable and not in the prediction"
MIRRORED: Final = (
    "the field dips the other way against the force than at the station: an axis is mirrored or "
    "two are swapped, or the force has its sign"
)
SMALLEST_SINE: Final = 0.3
"""Sine of dip, 17 deg, from which its sign tells a mirror image."""
LARGEST_DIP_DEG: Final = 85.0
PARAMETERS: Final = (
    *(f"matrix_{element}" for element in ("xx", "yy", "zz", "xy", "xz", "yz")),
    *(f"offset_{axis}_mg" for axis in "xyz"),
)


def fit_ellipsoid(data: CalibrationData, *, strength_free: bool = False) -> Fit:
    """Fit offset and symmetric matrix (9 parameters) to readings in many directions.

    Parameters
    ----------
    data : CalibrationData
        Only `field_mg` is needed. With `accel_g` the mean dip is given.
    strength_free : bool
        Whether the sphere's radius is free: that of a matrix with determinant one. Else it is
        held at the station's field strength; without a station it is free too. The heading is
        the same either way: the magnetometer alone does not tell gain from strength.

    Returns
    -------
    Fit
        Poses that contradict the others are left out and named in the message; `extra` then
        holds ``disturbed_poses`` and for each ``disturbed_<row>_sigmas``. With a free strength
        it holds ``field_mg_sd``.
        Refused with TOO_FEW, NO_TURN, TILT_TOO_SMALL (readings in a plane), SATURATED,
        FIELD_DISTURBED, DEGENERATE (no ellipsoid, or with `accel_g` and station a mirror image,
        which the magnetometer alone cannot see), NOT_OBSERVABLE (predicted error too large, or
        not to be trusted), NOT_CONVERGED or RESIDUAL_TOO_LARGE. Never a hyperboloid.

    Notes
    -----
    Where the best quadric is no ellipsoid, the ellipsoid-specific fit starts the search for
    disturbed poses. If it is still needed without them, the fit is refused as DEGENERATE and
    `extra` holds what it led to (`ellipsoid_specific.witness`): such readings leave several
    degrees of heading, and the least of them is the fit's bias.
    """
    if len(data) < SMALLEST:
        message = f"an ellipsoid needs at least {SMALLEST} readings; instead received {len(data)}"
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    strength_free = strength_free or data.station_field_mg is None
    fits = _fitted(data, strength_free=strength_free)
    cause = CAUSES[int(fits.cause)]
    if cause in NO_POSE_S_FAULT:
        return _refused(data, fits, cause, strength_free=strength_free)
    seen = search(len(data), partial(off_the_ellipsoid, data.field_mg, data.field_sd_mg))
    if seen.hopeless:
        message = f"{contradiction(seen.found, len(data))}: the field around the module changed"
        return refusal(METHOD, Cause.FIELD_DISTURBED, message, data)
    if seen.found:
        data = rows_of(data, seen.kept)
        fits = _fitted(data, strength_free=strength_free)
    fit = _judged(data, fits, strength_free=strength_free)
    if not seen.found:
        return fit
    message = f"{fit.message}; left out as disturbed: poses {named(seen.found)}"
    return replace(fit, message=message, extra=fit.extra | left_out(seen.found))


def _fitted(data: CalibrationData, *, strength_free: bool) -> SphereFits:
    return ellipsoid_batch(
        data.field_mg,
        data.field_sd_mg,
        station_field_mg=None if strength_free else data.station_field_mg,
        noise_known=data.noise_known,
    )


def _judged(data: CalibrationData, fits: SphereFits, *, strength_free: bool) -> Fit:
    cause = CAUSES[int(fits.cause)]
    if cause is not None:
        return _refused(data, fits, cause, strength_free=strength_free)
    if _mirrored(data, fits):
        return refusal(METHOD, Cause.DEGENERATE, MIRRORED, data, rank=int(fits.rank))
    dip_deg = _dip_deg(data, fits)
    rms_deg, max_deg = _predicted(data, fits, dip_deg)
    if rms_deg > LARGEST_PREDICTED_DEG:
        return _refused(data, fits, Cause.NOT_OBSERVABLE, strength_free=strength_free)
    extra = {"residual_relative": _relative(fits)}
    covariance = fits.covariance
    if strength_free:
        covariance, extra["field_mg_sd"] = _freed(fits)
    return Fit(
        method=METHOD,
        message=UNSEEN,
        samples=len(data),
        offset_mg=fits.offset_mg,
        matrix=fits.matrix,
        field_mg=float(fits.field_mg),
        dip_deg=dip_deg,
        parameters=PARAMETERS,
        covariance=covariance,
        residual_rms_mg=float(fits.residual_rms_mg),
        chi2_reduced=float(fits.chi2_reduced),
        dof=len(data) - UNKNOWNS,
        rank=int(fits.rank),
        condition=float(fits.condition),
        coverage=sphere_coverage((data.field_mg - fits.offset_mg) @ fits.matrix),
        predicted_heading_rms_deg=rms_deg,
        predicted_heading_max_deg=max_deg,
        extra=extra,
    )


def _freed(fits: SphereFits) -> tuple[NDArray[np.float64], float]:
    """Return the covariance of a matrix of determinant one, and the strength's deviation.

    The kernel holds the strength; what its matrix M does along itself is then the strength's:
    d(ln F) = -tr(M^-1 dM)/3, and M goes with F.
    """
    back = np.asarray(np.linalg.inv(fits.matrix), dtype=float)
    share = folded(back.T.reshape(9)) / 3.0
    elements = fits.matrix[SYMMETRIC_ROWS, SYMMETRIC_COLUMNS]
    turn = np.eye(UNKNOWNS)
    turn[:6, :6] -= np.outer(elements, share)
    variance = float(share @ fits.covariance[:6, :6] @ share)
    return turn @ fits.covariance @ turn.T, float(fits.field_mg) * float(np.sqrt(variance))


def _relative(fits: SphereFits) -> float:
    """Return the residual as a part of the field, in the sensor's own scale."""
    scale = np.cbrt(np.linalg.det(fits.matrix))
    return float(fits.residual_rms_mg * scale / fits.field_mg)


def _refused(data: CalibrationData, fits: SphereFits, cause: Cause, *, strength_free: bool) -> Fit:
    centred = data.field_mg - data.field_mg.mean(axis=0)
    coverage = sphere_coverage(centred)
    seen = f"the readings cover {100.0 * coverage:.0f} % of all directions"
    sentences = {
        Cause.NO_TURN: "all readings are the same"
        f"{_beyond(data)}: turn the module through all directions",
        Cause.TILT_TOO_SMALL: f"the readings lie in a plane (extents below {100.0 * FLAT:.0f} %): "
        "tilt the module, or use min_max on a level turn",
        Cause.SATURATED: f"axis {saturated_axis(data.field_mg)} {STOPPED}",
        Cause.FIELD_DISTURBED: f"{seen} and lie on no ellipsoid: the field around the module "
        "changed, as with a magnet or iron nearby",
        Cause.DEGENERATE: "the readings lie on no ellipsoid: turn the module through more "
        "directions",
        Cause.NOT_CONVERGED: "the ellipsoid fit did not settle: cover more directions",
        Cause.RESIDUAL_TOO_LARGE: _residual(data, fits),
        Cause.NOT_OBSERVABLE: _unobservable(fits, seen),
    }
    extra = {}
    if cause == Cause.DEGENERATE:
        strength_mg = None if strength_free else float(fits.field_mg)
        extra = witness(data.field_mg, data.field_sd_mg, strength_mg)
    return refusal(
        METHOD,
        cause,
        sentences[cause],
        data,
        rank=int(fits.rank),
        condition=float(fits.condition),
        coverage=coverage,
        residual_rms_mg=float(fits.residual_rms_mg),
        chi2_reduced=float(fits.chi2_reduced),
        extra=extra,
    )


def _residual(data: CalibrationData, fits: SphereFits) -> str:
    residual_mg = float(fits.residual_rms_mg)
    limit = f"exceeds {100.0 * LARGEST_RESIDUAL:.0f} % of the field"
    if data.noise_known:
        limit = f"is {float(fits.chi2_reduced) ** 0.5:.1f} times what the noise explains"
    return f"the residual of {residual_mg:.2g} mG {limit}: the field around the module changed"


def _beyond(data: CalibrationData) -> str:
    return f", or beyond {LARGEST_MG:.0e} mG" if np.abs(data.field_mg).max() > LARGEST_MG else ""


def _unobservable(fits: SphereFits, seen: str) -> str:
    if int(fits.rank) < UNKNOWNS:
        found = int(fits.rank)
        return f"the readings determine {found} of {UNKNOWNS} parameters: tilt in pitch and in roll"
    return (
        f"{seen} and could leave a heading error of more than {LARGEST_PREDICTED_DEG:.0f} deg RMS: "
        "turn through more"
    )


def _mirrored(data: CalibrationData, fits: SphereFits) -> bool:
    """Return whether the corrected field is a mirror image, as force and station tell.

    Of the 24 ways to mount the sensor square on the body the one counts whose vertical field is
    most constant: a mirror image has it with the dip negated. A force near zero tells nothing.
    """
    station = data.station_field_mg
    if station is None or data.accel_g is None:
        return False
    lengths = np.linalg.norm(data.accel_g, axis=1, keepdims=True)
    sine_station = float(station[2]) / float(np.linalg.norm(station))
    if lengths.min() < SMALLEST_FORCE_G or abs(sine_station) < SMALLEST_SINE:
        return False
    corrected = (data.field_mg - fits.offset_mg) @ fits.matrix / fits.field_mg
    start = mounted(
        np.eye(3)[None], np.zeros((1, 3)), corrected[None], -(data.accel_g / lengths)[None]
    )
    return bool(float(start[0, 12]) * np.sign(sine_station) < -SMALLEST_SINE)


def _dip_deg(data: CalibrationData, fits: SphereFits) -> float | None:
    if data.accel_g is None:
        return None
    corrected = (data.field_mg - fits.offset_mg) @ fits.matrix
    pitch_deg, roll_deg = attitude_deg(data.accel_g)
    pitch_rad, roll_rad = np.deg2rad(pitch_deg), np.deg2rad(roll_deg)
    lateral = corrected[:, 1] * np.sin(roll_rad) + corrected[:, 2] * np.cos(roll_rad)
    down = lateral * np.cos(pitch_rad) - corrected[:, 0] * np.sin(pitch_rad)
    ratio = np.clip(down / np.linalg.norm(corrected, axis=1), -1.0, 1.0)
    return float(np.rad2deg(np.median(np.arcsin(ratio))))


def _predicted(
    data: CalibrationData, fits: SphereFits, dip_deg: float | None
) -> tuple[float, float]:
    """Return RMS and maximum, at the dip of the accelerometer where the station's is not given."""
    station = data.station_field_mg
    if station is not None:
        dip_deg = float(np.rad2deg(np.arctan2(station[2], np.hypot(station[0], station[1]))))
    if dip_deg is None:
        return float(fits.predicted_rms_deg), float(fits.predicted_max_deg)
    limited_deg = np.clip(dip_deg, -LARGEST_DIP_DEG, LARGEST_DIP_DEG)
    sine: NDArray[np.float64] = np.sin(np.deg2rad(np.array([limited_deg])))
    rms_deg, max_deg = predicted_at(
        fits.field_mg[None], sine, fits.matrix[None], fits.covariance[None]
    )
    return float(rms_deg[0]), float(max_deg[0])
