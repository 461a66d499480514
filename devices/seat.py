"""The seat on the rig's inner axis, and how the unit sits in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from devices.rotation import IDENTITY, Matrix, Vector, about_axis, apply_inverse, product

FORWARD: Final[Vector] = (1.0, 0.0, 0.0)
RIGHT: Final[Vector] = (0.0, 1.0, 0.0)
DOWN: Final[Vector] = (0.0, 0.0, 1.0)
SEAT_FROM_UNIT: Final[tuple[Matrix, Matrix, Matrix]] = (
    IDENTITY,
    (-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0),
    (1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0),
)
"""As marked, turned by 180 deg about down, turned over by 180 deg about forward."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seat:
    """A seat that is turned against the rig's inner axis, with iron that turns with it.

    Attributes
    ----------
    index_deg, pitch_deg, roll_deg : float
        Turn of the seat: inner_from_seat = Rz(index) Ry(pitch) Rx(roll).
    iron_mg : (float, float, float)
        Field of the fixture's iron at the unit, forward, right and down of the seat.
    mounting : int
        How the unit was put in: index into `SEAT_FROM_UNIT`.
    seating_deg : (float, float, float)
        How far the unit does not sit square: a small rotation about its own three axes.
    """

    index_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    iron_mg: Vector = (0.0, 0.0, 0.0)
    mounting: int = 0
    seating_deg: Vector = (0.0, 0.0, 0.0)

    @property
    def square(self) -> bool:
        """Whether the unit's axes are the rig's inner ones."""
        return (
            self.mounting == 0
            and self.index_deg == self.pitch_deg == self.roll_deg == 0.0
            and self.seating_deg == (0.0, 0.0, 0.0)
        )

    def inner_from_unit(self) -> Matrix:
        """Return the rotation of the unit against the rig's inner axis."""
        turn = about_axis(DOWN, self.index_deg)
        turn = product(turn, about_axis(RIGHT, self.pitch_deg))
        turn = product(turn, about_axis(FORWARD, self.roll_deg))
        return product(turn, self._seat_from_unit())

    def iron_unit_mg(self) -> Vector:
        """Return the iron's field in the unit's frame."""
        return apply_inverse(self._seat_from_unit(), self.iron_mg)

    def _seat_from_unit(self) -> Matrix:
        turn = SEAT_FROM_UNIT[self.mounting]
        for axis, angle_deg in zip((FORWARD, RIGHT, DOWN), self.seating_deg, strict=True):
            turn = product(turn, about_axis(axis, angle_deg))
        return turn
