"""Magnetometer alone: offset and symmetric matrix that put the readings on a sphere.

The numbers are those of `bench.calibration.ellipsoid_batch`: Taubin's ellipsoid as the start,
the Sampson likelihood as the end. Here are its sentences, and what an accelerometer tells besides.

The rotation between sensor and body is unobservable: the predicted heading error is that of
offset and symmetric matrix only, without rotation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import sphere_coverage
from bench.calibration.ellipsoid_batch import (
    CAUSES,
    FLAT,
    LARGEST_PREDICTED_DEG,
    LARGEST_RESIDUAL,
    SMALLEST,
    UNKNOWNS,
    ellipsoid_batch,
    predicted_at,
)
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.saturation import STOPPED, saturated_axis
from bench.calibration.taubin import LARGEST_MG
from bench.calibration.tilt import attitude_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.sphere_fits import SphereFits

METHOD: Final = "ellipsoid"
LARGEST_DIP_DEG: Final = 85.0
PARAMETERS: Final = (
    *(f"matrix_{element}" for element in ("xx", "yy", "zz", "xy", "xz", "yz")),
    *(f"offset_{axis}_mg" for axis in "xyz"),
)


def fit_ellipsoid(data: CalibrationData) -> Fit:
    """Fit offset and symmetric matrix (9 parameters) to readings in many directions.

    Parameters
    ----------
    data : CalibrationData
        Only `field_mg` is needed. The sphere's radius is held at the station's field strength;
        without one it is free, that of a matrix with determinant one. With `accel_g` the mean
        dip is given.

    Returns
    -------
    Fit
        Refused with TOO_FEW, NO_TURN, TILT_TOO_SMALL (readings in a plane), SATURATED,
        FIELD_DISTURBED, DEGENERATE (no ellipsoid), NOT_OBSERVABLE (predicted error too large, or
        not to be trusted), NOT_CONVERGED or RESIDUAL_TOO_LARGE. Never a hyperboloid.
    """
    if len(data) < SMALLEST:
        message = f"an ellipsoid needs at least {SMALLEST} readings; instead received {len(data)}"
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    fits = ellipsoid_batch(data.field_mg, data.field_sd_mg, station_field_mg=data.station_field_mg)
    cause = CAUSES[int(fits.cause)]
    if cause is not None:
        return _refused(data, fits, cause)
    dip_deg = _dip_deg(data, fits)
    rms_deg, max_deg = _predicted(data, fits, dip_deg)
    if rms_deg > LARGEST_PREDICTED_DEG:
        return _refused(data, fits, Cause.NOT_OBSERVABLE)
    return Fit(
        method=METHOD,
        message="the rotation between sensor and body is unobservable and not in the prediction",
        samples=len(data),
        offset_mg=fits.offset_mg,
        matrix=fits.matrix,
        field_mg=float(fits.field_mg),
        dip_deg=dip_deg,
        parameters=PARAMETERS,
        covariance=fits.covariance,
        residual_rms_mg=float(fits.residual_rms_mg),
        chi2_reduced=float(fits.chi2_reduced),
        dof=len(data) - UNKNOWNS,
        rank=int(fits.rank),
        condition=float(fits.condition),
        coverage=sphere_coverage((data.field_mg - fits.offset_mg) @ fits.matrix),
        predicted_heading_rms_deg=rms_deg,
        predicted_heading_max_deg=max_deg,
        extra={"residual_relative": _relative(fits)},
    )


def _relative(fits: SphereFits) -> float:
    """Return the residual as a part of the field, in the sensor's own scale."""
    scale = np.cbrt(np.linalg.det(fits.matrix))
    return float(fits.residual_rms_mg * scale / fits.field_mg)


def _refused(data: CalibrationData, fits: SphereFits, cause: Cause) -> Fit:
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
        Cause.RESIDUAL_TOO_LARGE: f"the residual of {float(fits.residual_rms_mg):.1f} mG exceeds "
        f"{100.0 * LARGEST_RESIDUAL:.0f} % of the field: the field around the module changed",
        Cause.NOT_OBSERVABLE: _unobservable(fits, seen),
    }
    return refusal(
        METHOD,
        cause,
        sentences[cause],
        data,
        rank=int(fits.rank),
        condition=float(fits.condition),
        coverage=coverage,
        residual_rms_mg=float(fits.residual_rms_mg),
    )


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
    if data.station_field_mg is not None or dip_deg is None:
        return float(fits.predicted_rms_deg), float(fits.predicted_max_deg)
    limited_deg = np.clip(dip_deg, -LARGEST_DIP_DEG, LARGEST_DIP_DEG)
    sine: NDArray[np.float64] = np.sin(np.deg2rad(np.array([limited_deg])))
    rms_deg, max_deg = predicted_at(
        fits.field_mg[None], sine, fits.matrix[None], fits.covariance[None]
    )
    return float(rms_deg[0]), float(max_deg[0])
