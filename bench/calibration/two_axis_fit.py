"""Cho & Park's calibration of a module with two magnetic axes: level turn, then tilts.

First the readings of a level turn are normalised, then the extended dip angle is found from
tilts at known magnetic azimuths (Theorem 3), away from the blind ones. `two_axis` normalises by the
half-ranges of the turn as the paper does (27)-(28), `two_axis_aided` by the affine map from the
rig's azimuths.

Limits of the method, none of which its residual or its prediction shows:

- Vertical soft iron: a share of 0.02 or 0.05 of the vertical field along x is an offset when
  level, which the turn takes out, and another one when tilted. It leaves 0.75 or 1.9 deg at a roll
  of 30 deg and dip 48.72, and tan(dip) as much elsewhere.
- The tilt of the turn: 0.1 deg reads as hard iron worth 0.17 deg at dip 60.
- An azimuth error that all rows share (the seat, the field's azimuth) moves the dip, unless the
  tilts are taken on both sides. ``extra["field_azimuth_deg"]`` of `two_axis_aided` shows it.
- Dip and horizontal field are those of the calibration: elsewhere they must be found again.

References
----------
.. [1] S. Y. Cho and C. G. Park, "A Calibration Technique for a Two-Axis Magnetic Compass in
   Telematics Devices", ETRI Journal 27(3), 2005.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.accelerometer import fit_accelerometer
from bench.calibration.affine_turn import PARAMETERS as AFFINE
from bench.calibration.coverage import sphere_coverage
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.level_kernel import saturated_units
from bench.calibration.level_turn import (
    level_rows,
    refused_fit,
    refused_rows,
    station_horizontal_mg,
)
from bench.calibration.min_max import PARAMETERS as EXTREMES
from bench.calibration.min_max import SMALLEST
from bench.calibration.prediction import predicted_heading_deg
from bench.calibration.tilt import two_axis_attitude_deg
from bench.calibration.two_axis import BLIND, CAUSES, ExtendedDip, estimated_z_mg
from bench.calibration.two_axis_azimuth import azimuth_error_batch
from bench.calibration.two_axis_batch import TwoAxisFits, two_axis_batch
from bench.calibration.two_axis_prediction import two_axis_jacobians

if TYPE_CHECKING:
    from numpy.typing import NDArray


PAPER: Final = "two_axis"
AIDED: Final = "two_axis_aided"
LEVEL_BY_RIG_DEG: Final = 1.0
"""Rows that the rig tilts by more are no part of the turn, nor of the dip below 5 deg."""
LARGEST_AZIMUTH_SD_DEG: Final = 0.1
"""Above it the tilts say nothing of the field's azimuth that a limit could judge."""
LARGEST_RESIDUAL: Final = 0.2
"""RMS of the dip's residual, as a part of the horizontal field, in one undisturbed field."""


def fit_two_axis(data: CalibrationData) -> Fit:
    """Fit x and y by the half-ranges of a level turn, and the extended dip angle [1]_.

    Parameters
    ----------
    data : CalibrationData
        A level turn, and rows tilted by 5 deg or more at known azimuths. Tilt comes from the rig,
        else from the raw x and y force. z of the field is not used.

    Returns
    -------
    Fit
        z row of the matrix (0, 0, 1); `extended_dip_deg`, ``extra["horizontal_mg"]``;
        accelerometer coefficients where `fit_accelerometer` accepts the readings. The prediction
        holds the noise of all of these, not the limits named at the head of this module. Refused
        with NO_TRUTH, BLIND_AZIMUTH, TILT_TOO_SMALL, SATURATED, RESIDUAL_TOO_LARGE or the turn's
        own causes.
    """
    return _fit(PAPER, data)


def fit_two_axis_aided(data: CalibrationData) -> Fit:
    """Fit x and y by the affine map of a level turn of known azimuths, and the extended dip angle.

    Parameters and refusals are those of `fit_two_axis`; the matrix has all four elements of x
    and y, and takes soft iron between the axes and the sensors' rotation about z besides.
    """
    return _fit(AIDED, data)


def _fit(method: str, data: CalibrationData) -> Fit:
    if data.azimuth_deg is None:
        message = (
            "the extended dip angle needs the rig's azimuth of every reading; instead received none"
        )
        return refusal(method, Cause.NO_TRUTH, message, data)
    attitude = _attitude_deg(data)
    if attitude is None:
        message = (
            "the extended dip angle needs pitch and roll or the specific force of each reading"
        )
        return refusal(method, Cause.NO_TRUTH, message, data)
    by_rig = data.pitch_deg is not None and data.roll_deg is not None
    level = level_rows(data, LEVEL_BY_RIG_DEG) if by_rig else level_rows(data)
    refused = refused_rows(method, data, level, SMALLEST)
    if refused is not None:
        return refused
    if saturated_units(data.field_mg[:, :2]):
        message = "x or y stops at one value when tilted: the sensor is saturated; degauss it"
        return refusal(method, Cause.SATURATED, message, data)
    pitch_deg, roll_deg = attitude
    magnetic_deg = data.azimuth_deg - data.field_azimuth_deg
    fits = two_axis_batch(
        data.field_mg[level, :2],
        magnetic_deg[level] if method == AIDED else None,
        data.field_mg[~level, :2],
        magnetic_deg[~level],
        pitch_deg[~level],
        roll_deg[~level],
        horizontal_mg=station_horizontal_mg(data),
        field_sd_mg=data.field_sd_mg,
        rig_sd_deg=data.rig_sd_deg,
    )
    refused = refused_fit(method, data, fits.turn) or _refused_dip(method, data, fits.dip)
    if refused is not None:
        return refused
    return _accepted(method, data, fits, _seen(data, fits, attitude), level)


def _seen(
    data: CalibrationData,
    fits: TwoAxisFits,
    attitude_deg: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return the corrected field of all rows over its horizontal part, shape (n, 3)."""
    unit = fits.turn.corrected_mg(data.field_mg[:, :2]) / fits.turn.horizontal_mg
    z = estimated_z_mg(unit, *attitude_deg, horizontal_mg=1.0, dip_deg=fits.dip.dip_deg)
    return np.column_stack([unit, z])


def _attitude_deg(
    data: CalibrationData,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    if data.pitch_deg is not None and data.roll_deg is not None:
        return data.pitch_deg, data.roll_deg
    return None if data.accel_g is None else two_axis_attitude_deg(data.accel_g)


def _refused_dip(method: str, data: CalibrationData, dip: ExtendedDip) -> Fit | None:
    blind_deg = np.rad2deg(np.arcsin(BLIND))
    sentences = {
        Cause.TOO_FEW: "the extended dip angle needs at least 2 tilted readings; instead "
        f"received {dip.by_x_deg.shape[-1]}",
        Cause.TILT_TOO_SMALL: "the extended dip angle needs at least 2 readings tilted by 5 deg; "
        f"instead received {dip.rows}",
        Cause.BLIND_AZIMUTH: f"every tilt is within {blind_deg:.0f} deg of an azimuth at which it "
        "does not show the dip: pitch near 90 and 270 deg, roll near 0 and 180",
    }
    cause = CAUSES[int(dip.cause)]
    if cause is Cause.TOO_FEW and not dip.by_x_deg.shape[-1]:
        cause = Cause.TILT_TOO_SMALL
    if cause is not None:
        return refusal(method, cause, sentences[cause], data)
    if not float(dip.residual_rms) < LARGEST_RESIDUAL:
        message = (
            f"the tilted readings are {100.0 * float(dip.residual_rms):.0f} % of the horizontal "
            "field off any dip: wrong angles, or a field that changed"
        )
        return refusal(method, Cause.RESIDUAL_TOO_LARGE, message, data)
    return None


def _accepted(
    method: str,
    data: CalibrationData,
    fits: TwoAxisFits,
    seen: NDArray[np.float64],
    level: NDArray[np.bool_],
) -> Fit:
    turn, dip = fits.turn, fits.dip
    names = (*(AFFINE if method == AIDED else EXTREMES), "extended_dip_deg")
    tilt = fit_accelerometer(data)
    own, by_tilt = two_axis_jacobians(turn, fits.slopes, float(dip.dip_deg), tilt)
    covariance = fits.covariance
    if tilt.covariance is not None:
        names = (*names, *tilt.parameters[:12])
        covariance = _block_diagonal(covariance, tilt.covariance[:12, :12])
    rms_deg, max_deg = predicted_heading_deg(np.hstack([own, by_tilt]), covariance)
    matrix = np.eye(3)
    matrix[:2, :2] = turn.matrix
    return Fit(
        method=method,
        message=_message(tilt),
        samples=len(data),
        offset_mg=np.append(turn.offset_mg, 0.0),
        matrix=matrix,
        accel_offset_g=tilt.accel_offset_g,
        accel_matrix=tilt.accel_matrix,
        field_mg=float(turn.horizontal_mg),
        extended_dip_deg=float(dip.dip_deg),
        parameters=names,
        covariance=covariance,
        residual_rms_mg=float(turn.residual_rms_mg),
        accel_residual_rms_g=tilt.accel_residual_rms_g,
        chi2_reduced=float(turn.chi2_reduced),
        dof=2 * int(level.sum()) - len(AFFINE) if method == AIDED else int(level.sum()) - 4,
        rank=len(names),
        condition=float(np.linalg.cond(np.insert(seen[level, :2], 2, 1.0, axis=1))),
        coverage=sphere_coverage(seen),
        predicted_heading_rms_deg=rms_deg,
        predicted_heading_max_deg=max_deg,
        extra=_extra(fits, own[:, -1]) | _azimuth(method, data, fits, seen, level),
    )


def _azimuth(
    method: str,
    data: CalibrationData,
    fits: TwoAxisFits,
    seen: NDArray[np.float64],
    level: NDArray[np.bool_],
) -> dict[str, float]:
    """Return the field's azimuth by the rig's tilts; nothing where they do not show it."""
    if method != AIDED or data.azimuth_deg is None:
        return {}
    if data.pitch_deg is None or data.roll_deg is None:
        return {}
    by_angle = np.deg2rad(data.rig_sd_deg) / np.cos(np.deg2rad(fits.dip.dip_deg))
    error_deg, sd_deg = azimuth_error_batch(
        seen[~level, 0],
        seen[~level, 1],
        data.pitch_deg[~level],
        data.roll_deg[~level],
        data.azimuth_deg[~level] - data.field_azimuth_deg,
        dip_deg=fits.dip.dip_deg,
        field_sd=np.hypot(data.field_sd_mg / fits.turn.horizontal_mg, by_angle),
    )
    if sd_deg > LARGEST_AZIMUTH_SD_DEG:
        return {}
    return {
        "field_azimuth_deg": data.field_azimuth_deg - float(error_deg),
        "field_azimuth_deg_sd": float(sd_deg),
    }


def _extra(fits: TwoAxisFits, by_dip: NDArray[np.float64]) -> dict[str, float]:
    turn, dip = fits.turn, fits.dip
    sd_deg = float(np.sqrt(fits.covariance[-1, -1]))
    return {
        "horizontal_mg": float(turn.horizontal_mg),
        "extended_dip_deg_sd": sd_deg,
        "predicted_by_dip_rms_deg": sd_deg * float(np.sqrt((by_dip**2).mean())),
        "extended_dip_residual_mg": float(dip.residual_rms * turn.horizontal_mg),
        "extended_dip_chi2_reduced": float(dip.chi2_reduced),
        "largest_gap_deg": float(turn.gap_deg),
    }


def _message(tilt: Fit) -> str:
    left = "x and y alone; vertical soft iron is not in the prediction"
    if tilt.refused:
        return f"{left}, nor is the accelerometer: {tilt.message}"
    return left


def _block_diagonal(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    size = len(first)
    joined = np.zeros((size + len(second), size + len(second)))
    joined[:size, :size] = first
    joined[size:, size:] = second
    return joined
