"""Formulas exactly as the papers print them, for the study of what they leave: for no compass.

References
----------
.. [1] D. Skula, "New Method for Magnetometer Offset Compensation", 2010.
.. [2] C. Konvalin, "Compensating for Tilt, Hard-Iron, and Soft-Iron Effects", 2009.
.. [3] M. J. Caruso, "Applications of Magnetic Sensors for Low Cost Compass Systems", PLANS 2000.
.. [4] S. Y. Cho and C. G. Park, "A Calibration Technique for a Two-Axis Magnetic Compass in
   Telematics Devices", ETRI Journal 27(3), 2005.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.four_position import four_readings
from bench.calibration.level_kernel import corrected_mg, require_readings

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PrintedFormula:
    """Offset (..., 2) and matrix (..., 2, 2) by a formula as a paper prints it."""

    offset_mg: NDArray[np.float64]
    matrix: NDArray[np.float64]

    def corrected_mg(self, field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return corrected x and y, shape (..., n, 2), of raw readings of that shape."""
        return corrected_mg(field_mg, self.offset_mg, self.matrix)


def printed_four_position(field_mg: ArrayLike) -> PrintedFormula:
    """Return Skula (5)-(7) [1]_.

    alpha = arctan((H1 - H3)/(H2 - H4)), A = (H1 - H3)/(2 sin(alpha)), c = (H1 + H3)/2, and each
    axis is multiplied by the other's A over its own 'or 1, what is bigger'. A takes the sign of
    H2 - H4: where those of x and y differ, both ratios are negative and the scale is lost.

    Parameters
    ----------
    field_mg : array-like, shape (..., 4, 2)
        x and y at four positions a quarter turn apart.

    Returns
    -------
    PrintedFormula
        NaN where the formula divides 0 by 0: at an alpha of exactly 0 or 180 deg.
    """
    first, second, third, fourth = np.moveaxis(four_readings(field_mg), -2, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        alpha = np.arctan((first - third) / (second - fourth))
        amplitude = (first - third) / (2.0 * np.sin(alpha))
        scale = np.maximum(amplitude[..., ::-1] / amplitude, 1.0)
    return PrintedFormula(offset_mg=(first + third) / 2.0, matrix=np.eye(2) * scale[..., None, :])


def printed_soft_iron(field_mg: ArrayLike) -> PrintedFormula:
    """Return Konvalin (1)-(7) [2]_.

    Centre from the extremes (1)-(2); r and (x1, y1) from the reading farthest from it (3),
    theta = arcsin(y1/r) (4), q from the nearest; rotate (5)-(6), divide x by sigma = q/r (7),
    rotate back.

    Parameters
    ----------
    field_mg : array-like, shape (..., n, 2)
        x and y of a level turn.
    """
    offset, centred = _about_the_extremes(field_mg)
    length = np.hypot(centred[..., 0], centred[..., 1])
    r, q = length.max(axis=-1), length.min(axis=-1)
    y1 = np.take_along_axis(centred[..., 1], length.argmax(axis=-1)[..., None], axis=-1)[..., 0]
    theta = np.arcsin(np.clip(y1 / r, -1.0, 1.0))
    sigma = q / r
    return PrintedFormula(
        offset_mg=offset, matrix=_rotate_scale_rotate(theta, 1.0 / sigma, np.ones_like(r))
    )


def forty_five_soft_iron(field_mg: ArrayLike) -> PrintedFormula:
    """Return Caruso's rotation by 45 deg [3]_.

    Rotate by 45 deg, scale the larger half-range to the smaller one, rotate back: right only
    where the ellipse's axes lie at 45 and 135 deg.

    Parameters
    ----------
    field_mg : array-like, shape (..., n, 2)
        x and y of a level turn.
    """
    offset, centred = _about_the_extremes(field_mg)
    theta = np.full(offset.shape[:-1], np.pi / 4.0)
    turned = centred @ np.swapaxes(_rotation(theta), -1, -2)
    half = np.ptp(turned, axis=-2) / 2.0
    scale = half.min(axis=-1, keepdims=True) / half
    return PrintedFormula(
        offset_mg=offset, matrix=_rotate_scale_rotate(theta, scale[..., 0], scale[..., 1])
    )


def _about_the_extremes(
    field_mg: ArrayLike,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the middle of the extremes, Konvalin (1)-(2), and the readings about it."""
    readings = require_readings(field_mg, 2)
    offset = (readings.max(axis=-2) + readings.min(axis=-2)) / 2.0
    return offset, readings - offset[..., None, :]


def _rotation(theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return R of Konvalin (5), shape (..., 2, 2)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.stack([np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)], axis=-2)


def _rotate_scale_rotate(
    theta: NDArray[np.float64], along: NDArray[np.float64], across: NDArray[np.float64]
) -> NDArray[np.float64]:
    turned = _rotation(theta)
    scale = np.stack([along, across], axis=-1)
    return np.asarray(np.swapaxes(turned, -1, -2) @ (scale[..., :, None] * turned))


def printed_extended_dip_deg(
    x: ArrayLike,
    y: ArrayLike,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
    azimuth_deg: ArrayLike,
) -> NDArray[np.float64]:
    """Return Cho & Park's (26) [4]_ for each sample.

    It divides by zero at the blind azimuths and carries tan(psi), which diverges at 90 and
    270 deg; there it is what the floating-point numbers make of it, which may not be finite.

    Parameters
    ----------
    x, y, pitch_deg, roll_deg, azimuth_deg : array-like
        As in `two_axis.extended_dip_batch`, of one sample each.

    Examples
    --------
    >>> round(float(printed_extended_dip_deg(-0.2536529, -0.7071068, 30.0, 0.0, 45.0)), 4)
    60.0
    """
    along, right = np.asarray(x, float), np.asarray(y, float)
    th, ph, psi = (np.deg2rad(np.asarray(a, float)) for a in (pitch_deg, roll_deg, azimuth_deg))
    across = along * (np.sin(th) * np.sin(ph) - np.cos(ph) * np.tan(psi)) - right * np.cos(th)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = across / (np.sin(th) * np.cos(ph) * np.tan(psi) - np.sin(ph))
    return np.asarray(np.rad2deg(np.arctan(ratio)))
