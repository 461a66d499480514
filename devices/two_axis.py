"""Heading of the module with two magnetic axes and two accelerometers, in single precision.

Written from the paper, in its symbols: theta is pitch, phi roll, lambda_e the extended dip angle,
X and Y the corrected field along x and y, Z the estimate of the third.

References
----------
.. [1] S. Y. Cho and C. G. Park, "A Calibration Technique for a Two-Axis Magnetic Compass in
   Telematics Devices", ETRI Journal 27(3), 2005: tilt (17), Theorem 1 (10), Theorem 2 (24).
   There the field has length 1, here it is in mG: sin(lambda_e) becomes H tan(lambda_e), the
   field downwards. (24) has a one-argument arctangent; the quadrant is that of atan2(b, a).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from devices.crossed_field import CrossedField

if TYPE_CHECKING:
    from devices.firmware import Converters, Counts
    from protocols.uds import Coefficients

_F32 = np.float32
_ONE: Final = _F32(1.0)
_DEG: Final = _F32(180.0 / math.pi)


class TwoAxisFormula:
    """Coefficients folded with the converters' scales, and the field downwards.

    Without a horizontal field in the coefficients the dip is taken as 0: the heading is right
    for a level module only.
    """

    def __init__(self, coefficients: Coefficients, converters: Converters) -> None:
        self._crossed = CrossedField(coefficients, converters)
        mag_matrix = np.reshape(coefficients.mag_matrix, (3, 3)).copy()
        mag_matrix[:2, 2] = 0.0  # z of the field is no part of the heading
        accel_matrix = np.reshape(coefficients.accel_matrix, (3, 3))
        matrix = np.zeros((4, 6))
        matrix[:2, :3] = mag_matrix[:2]
        matrix[2:, 3:] = accel_matrix[:2]
        offset = np.array((*coefficients.mag_offset_mg, *coefficients.accel_offset_g))
        scale = np.repeat((converters.mag_mg_per_count / 2.0, converters.accel_g_per_count), 3)
        self._bias = (matrix @ offset).astype(_F32)
        self._matrix = (matrix * scale).astype(_F32)
        dip_rad = math.radians(coefficients.extended_dip_deg)
        self._down_mg = _F32(coefficients.horizontal_mg * math.tan(dip_rad))

    def solve(
        self, difference_counts: Counts, accel_counts: Counts
    ) -> tuple[float, float, float] | None:
        """Return heading, pitch and roll in degrees, or None beyond the formula's tilts.

        Parameters
        ----------
        difference_counts : tuple of int
            Set minus reset, three axes, in counts; z does not count.
        accel_counts : tuple of int
            Specific force in counts, z completed. Gravity's alone, or the tilt is wrong: with two
            axes no other force shows.
        """
        raw = self._crossed.taken_out(np.array(difference_counts + accel_counts, dtype=_F32))
        X, Y, ax, ay = self._matrix @ raw - self._bias  # noqa: N806 - the paper's symbols
        if not ax * ax + ay * ay < _ONE:
            return None
        theta = np.arcsin(ax)  # (17a)
        sin_theta, cos_theta = ax, np.cos(theta)
        sin_phi = -ay / cos_theta  # (17b)
        if not abs(sin_phi) < _ONE:
            return None
        phi = np.arcsin(sin_phi)
        cos_phi = np.cos(phi)
        down = self._down_mg
        Z = (down + X * sin_theta - Y * cos_theta * sin_phi) / (cos_theta * cos_phi)  # noqa: N806  (10)
        b = Z * sin_phi - Y * cos_phi
        a = X * cos_theta + (Y * sin_phi + Z * cos_phi) * sin_theta
        heading = float(np.arctan2(b, a) * _DEG)  # (24)
        return heading % 360.0, float(theta * _DEG), float(phi * _DEG)


def completed(accel_counts: Counts, g_per_count: float) -> Counts:
    """Return the force with z as x and y and 1 g leave it: -sqrt(1 - ax^2 - ay^2), in counts."""
    x, y, _ = accel_counts
    one_g = 1.0 / g_per_count
    return (x, y, -round(math.sqrt(max(one_g * one_g - x * x - y * y, 0.0))))
