"""What a fit makes of raw readings: the heading, in the order of compensation that is chosen.

The product's order is `Order.BODY`: hard iron, then soft iron and misalignment, both in the
body's frame because the iron turns with the body; then tilt; then heading. The others are here
to show what they cost. In every order the bridges' cross-axis term is taken out first, where the
fit knows it: it is the sensor's own.

References
----------
.. [1] C. Konvalin, "Compensating for Tilt, Hard-Iron, and Soft-Iron Effects", 2009: tilt first,
   then hard iron, then soft iron; right for one fixed tilt only.
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.tilt import attitude_deg, heading_deg, ned_from_body, two_axis_attitude_deg
from bench.calibration.two_axis import estimated_z_mg
from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bench.calibration.fit import Fit


class Order(StrEnum):
    """Order in which the errors are taken out."""

    BODY = "body"
    """Hard iron, soft iron, tilt: right at every attitude."""
    SOFT_FIRST = "soft_first"
    """Soft iron, hard iron, tilt: the offset is that of uncorrected axes."""
    TILT_FIRST = "tilt_first"
    """Tilt, hard iron, soft iron: Konvalin's order [1]_."""
    TILT_REVERSED = "tilt_reversed"
    """Hard iron, soft iron, then elevation before bank: Konvalin's 'reverse sequence' [1]_."""


def compensated_heading_deg(
    fit: Fit | None,
    field_mg: NDArray[np.float64],
    accel_g: NDArray[np.float64] | None = None,
    *,
    pitch_deg: ArrayLike = 0.0,
    roll_deg: ArrayLike = 0.0,
    tilt: Fit | None = None,
    order: Order = Order.BODY,
) -> NDArray[np.float64]:
    """Return magnetic headings in [0, 360), shape (...), of raw readings.

    Parameters
    ----------
    fit : Fit or None
        Its coefficients are applied; None leaves the readings raw.
    field_mg : ndarray, shape (..., 3)
        Raw field; of a fit for two axes z is not used.
    accel_g : ndarray, shape (..., 3), or None
        Raw specific force; the attitude comes from it.
    pitch_deg, roll_deg : array-like, shape (...)
        Attitude where there is no specific force.
    tilt : Fit, optional
        Its accelerometer coefficients are used where `fit` has none.
    order : Order
        Order of compensation; a fit for two axes knows the first only.

    Raises
    ------
    ValueError
        If the fit was refused, or there is no such order.
    """
    order = Order(order)
    if accel_g is not None:
        pitch_deg, roll_deg = _attitude_deg(fit, tilt, accel_g)
    if fit is None:
        return heading_deg(field_mg, pitch_deg, roll_deg)
    if fit.two_axis:
        return heading_deg(
            completed_field_mg(fit, field_mg, pitch_deg, roll_deg), pitch_deg, roll_deg
        )
    field_mg = fit.bridge_mg(field_mg)
    if order is Order.TILT_FIRST:
        level = fit.body_mg(_levelled(field_mg, pitch_deg, roll_deg))
        return wrap_360_deg(np.rad2deg(np.arctan2(-level[..., 1], level[..., 0])))
    if order is Order.TILT_REVERSED:
        back = ned_from_body(0.0, 0.0, roll_deg) @ ned_from_body(0.0, pitch_deg, 0.0)
        level = np.einsum("...ij,...j->...i", back, fit.body_mg(field_mg))
        return wrap_360_deg(np.rad2deg(np.arctan2(-level[..., 1], level[..., 0])))
    if order is Order.SOFT_FIRST and fit.offset_mg is not None:
        corrected = fit.body_mg(field_mg + fit.offset_mg) - fit.offset_mg
        return heading_deg(corrected, pitch_deg, roll_deg)
    return heading_deg(fit.body_mg(field_mg), pitch_deg, roll_deg)


def completed_field_mg(
    fit: Fit, field_mg: NDArray[np.float64], pitch_deg: ArrayLike, roll_deg: ArrayLike
) -> NDArray[np.float64]:
    """Return the corrected field, shape (..., 3), with z estimated where a fit is for two axes.

    Parameters
    ----------
    field_mg : ndarray, shape (..., 3)
        Raw field; of a fit for two axes z is not used.
    pitch_deg, roll_deg : array-like, shape (...)
        Attitude; of a fit for three axes it is not used.
    """
    corrected = fit.corrected_mg(field_mg)
    if fit.extended_dip_deg is not None:
        corrected[..., 2] = estimated_z_mg(
            corrected,
            pitch_deg,
            roll_deg,
            horizontal_mg=fit.extra["horizontal_mg"],
            dip_deg=fit.extended_dip_deg,
        )
    return corrected


def _attitude_deg(
    fit: Fit | None, tilt: Fit | None, accel_g: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    source = fit if fit is not None and fit.accel_matrix is not None else tilt
    force_g = accel_g if source is None else source.corrected_g(accel_g)
    if fit is not None and fit.two_axis:
        return two_axis_attitude_deg(force_g)
    return attitude_deg(force_g)


def _levelled(
    field_mg: NDArray[np.float64], pitch_deg: ArrayLike, roll_deg: ArrayLike
) -> NDArray[np.float64]:
    back = ned_from_body(0.0, pitch_deg, roll_deg)
    return np.asarray(np.einsum("...ij,...j->...i", back, field_mg))
