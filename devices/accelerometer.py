"""A three-axis accelerometer of the class of the ADXL202E (data sheet, front page).

2 mg rms in 60 Hz, zero-g drift 2 mg/C, nonlinearity 0.2 % of full scale (+-2 g),
alignment 1 deg; 30 mg of zero-g offset after trimming.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from devices.rotation import IDENTITY, Matrix, Vector, apply

REFERENCE_C: Final = 25.0
NOISE_G: Final = 0.002


@dataclass(frozen=True, slots=True, kw_only=True)
class Accelerometer:
    """Parameters of one accelerometer.

    Attributes
    ----------
    matrix : nine floats
        Scale and misalignment: sensor from body.
    bias_g, drift_g_per_c : (float, float, float)
        Zero-g offset at 25 C and its tempco.
    quadratic_per_g, cubic_per_g2 : (float, float, float)
        Nonlinearity of each axis; together at most 0.2 % of full scale.
    noise_g : float
        Standard deviation of one reading.
    """

    matrix: Matrix = IDENTITY
    bias_g: Vector = (0.0, 0.0, 0.0)
    drift_g_per_c: Vector = (0.0, 0.0, 0.0)
    quadratic_per_g: Vector = (0.0, 0.0, 0.0)
    cubic_per_g2: Vector = (0.0, 0.0, 0.0)
    noise_g: float = NOISE_G

    def level_g(self, force_body_g: Vector, temperature_c: float) -> Vector:
        """Return the noiseless reading, g, of a specific force in the body's frame."""
        warm_c = temperature_c - REFERENCE_C
        x, y, z = apply(self.matrix, force_body_g)
        bias, drift, quadratic, cubic = (
            self.bias_g,
            self.drift_g_per_c,
            self.quadratic_per_g,
            self.cubic_per_g2,
        )
        return (
            x + bias[0] + drift[0] * warm_c + x * x * (quadratic[0] + cubic[0] * x),
            y + bias[1] + drift[1] * warm_c + y * y * (quadratic[1] + cubic[1] * y),
            z + bias[2] + drift[2] * warm_c + z * z * (quadratic[2] + cubic[2] * z),
        )
