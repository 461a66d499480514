"""The iron of the module's own housing and board: what the bridges see of the field.

field at the bridges = soft_iron @ field in the body's frame + hard_iron. The matrix holds
soft iron and the bridges' misalignment.
"""

from __future__ import annotations

from dataclasses import dataclass

from devices.rotation import IDENTITY, Matrix, Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Magnetics:
    """Hard and soft iron that turn with the module.

    Attributes
    ----------
    soft_iron : nine floats
        Row by row; dimensionless.
    hard_iron_mg : (float, float, float)
        Field of the magnetised parts at the bridges, mG.
    """

    soft_iron: Matrix = IDENTITY
    hard_iron_mg: Vector = (0.0, 0.0, 0.0)

    def sensor_field_mg(self, field_body_mg: Vector) -> Vector:
        """Return the field at the bridges, mG."""
        a, b, c, d, e, f, g, h, i = self.soft_iron
        x, y, z = field_body_mg
        iron_x, iron_y, iron_z = self.hard_iron_mg
        return (
            a * x + b * y + c * z + iron_x,
            d * x + e * y + f * z + iron_y,
            g * x + h * y + i * z + iron_z,
        )
