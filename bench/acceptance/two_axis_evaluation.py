"""Numbers about a module of two axes: its estimate of the third, and its horizontal field."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.acceptance.measurement import Measurement
from bench.calibration.compensation import completed_field_mg
from bench.calibration.fit import Fit
from bench.calibration.tilt import ned_from_body, two_axis_attitude_deg
from bench.calibration.two_axis import checking_z_mg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from protocols.uds import Coefficients

SMALLEST_CHANGE_MG: Final = 50.0
"""Change of the checking axis below which its gain cannot be told."""


def fit_of(coefficients: Coefficients) -> Fit:
    """Return a module's coefficients as a fit, for two axes where they hold a horizontal field."""
    two_axis = coefficients.horizontal_mg > 0.0
    return Fit(
        method="coefficients",
        offset_mg=np.array(coefficients.mag_offset_mg),
        matrix=np.reshape(coefficients.mag_matrix, (3, 3)),
        accel_offset_g=np.array(coefficients.accel_offset_g),
        accel_matrix=np.reshape(coefficients.accel_matrix, (3, 3)),
        extended_dip_deg=coefficients.extended_dip_deg if two_axis else None,
        extra={"horizontal_mg": coefficients.horizontal_mg} if two_axis else {},
        hk_mg=np.array(coefficients.hk_mg) if any(coefficients.hk_mg) else None,
    )


def evaluate_z_estimate(
    step: str, readings: NDArray[np.void], coefficients: Coefficients
) -> list[Measurement]:
    """Return z_estimate_difference: RMS of estimated against measured z, in mG.

    The checking axis is not calibrated: its own offset and gain against the estimate are taken
    out by least squares. Nothing is returned where the poses do not change z.
    """
    fit = fit_of(coefficients)
    field_mg = _field_mg(readings, fit)
    measured_mg = fit.bridge_mg(readings["field_mg"])[:, 2]
    if len(measured_mg) < 3 or float(np.ptp(measured_mg)) < SMALLEST_CHANGE_MG:
        return []
    left_mg = field_mg[:, 2] - checking_z_mg(measured_mg, field_mg[:, 2])
    value_mg = float(np.sqrt(np.mean(left_mg**2)))
    return [Measurement(name="z_estimate_difference", value=value_mg, step=step, unit="mG")]


def horizontal_mg(readings: NDArray[np.void], coefficients: Coefficients) -> NDArray[np.float64]:
    """Return the horizontal strength, shape (n,), of the levelled field with its estimated z."""
    fit = fit_of(coefficients)
    pitch_deg, roll_deg = two_axis_attitude_deg(fit.corrected_g(readings["accel_g"]))
    field_mg = _field_mg(readings, fit)
    level_mg = np.einsum("nij,nj->ni", ned_from_body(0.0, pitch_deg, roll_deg), field_mg)
    return np.asarray(np.hypot(level_mg[:, 0], level_mg[:, 1]))


def _field_mg(readings: NDArray[np.void], fit: Fit) -> NDArray[np.float64]:
    """Return the corrected field, shape (n, 3), with the estimate as z."""
    pitch_deg, roll_deg = two_axis_attitude_deg(fit.corrected_g(readings["accel_g"]))
    return completed_field_mg(fit, readings["field_mg"], pitch_deg, roll_deg)
