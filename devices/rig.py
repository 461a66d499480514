"""The three axes of the rig and what stands between them and the module's seat.

The azimuth axis carries the pitch axis, which carries the roll axis and the seat. A
perfect rig has ned_from_body = Rz(azimuth) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from devices.mechanics import AxisMechanics, draw_encoder
from devices.rotation import Matrix, Vector, about_axis, about_vertical, product

if TYPE_CHECKING:
    from devices.faults import ActiveFault

AZIMUTH_RATING: Final = (90.0, 180.0)
"""Velocity (deg/s) and acceleration (deg/s2) of the azimuth axis."""
TILT_RATING: Final = (45.0, 90.0)
TILT_TRAVEL_DEG: Final = (-92.0, 92.0)
BACKLASH_DEG: Final = 0.004

_STREAM: Final = 0x516


@dataclass(frozen=True, slots=True, kw_only=True)
class RigGeometry:
    """What is not perfect about a rig; all angles in degrees, all zero on a perfect one.

    Attributes
    ----------
    base_level_north_deg, base_level_east_deg : float
        Rotation of the base about the north and the east axis.
    azimuth_pitch_squareness_deg : float
        Tilt of the pitch axis out of the plane square to the azimuth axis.
    pitch_roll_squareness_deg : float
        Turn of the roll axis out of the plane square to the pitch axis.
    wobble_deg : float
        Tilt of the azimuth axis that turns with it.
    """

    base_level_north_deg: float = 0.0
    base_level_east_deg: float = 0.0
    azimuth_pitch_squareness_deg: float = 0.0
    pitch_roll_squareness_deg: float = 0.0
    wobble_deg: float = 0.0


class RigMechanics:
    """Three axes and the geometry between them.

    Parameters
    ----------
    axes : (AxisMechanics, AxisMechanics, AxisMechanics)
        Azimuth, pitch, roll.
    geometry : RigGeometry
        Imperfections; a perfect rig by default.
    """

    def __init__(
        self,
        axes: tuple[AxisMechanics, AxisMechanics, AxisMechanics],
        geometry: RigGeometry | None = None,
    ) -> None:
        self.axes = axes
        self.azimuth, self.pitch, self.roll = axes
        self.geometry = geometry = geometry or RigGeometry()
        self._base = product(
            about_axis((1.0, 0.0, 0.0), geometry.base_level_north_deg),
            about_axis((0.0, 1.0, 0.0), geometry.base_level_east_deg),
        )
        skew_rad = math.radians(geometry.azimuth_pitch_squareness_deg)
        self._pitch_axis: Vector = (0.0, math.cos(skew_rad), math.sin(skew_rad))
        skew_rad = math.radians(geometry.pitch_roll_squareness_deg)
        self._roll_axis: Vector = (math.cos(skew_rad), math.sin(skew_rad), 0.0)
        self._wobble = about_axis((1.0, 0.0, 0.0), geometry.wobble_deg)
        self._turned = (math.nan, math.nan, math.nan)
        self._tilted = (math.nan, math.nan)
        self._tilt_matrix: Matrix = self._base
        self._matrix: Matrix = self._base

    def step(self, dt_s: float) -> None:
        """Let `dt_s` seconds pass on every axis."""
        self.azimuth.step(dt_s)
        self.pitch.step(dt_s)
        self.roll.step(dt_s)

    @property
    def attitude_deg(self) -> Vector:
        """True azimuth, pitch and roll of the three axes, degrees."""
        return (self.azimuth.angle_deg, self.pitch.angle_deg, self.roll.angle_deg)

    def ned_from_body(self) -> Matrix:
        """Return the seat's rotation row by row; the same object while no axis has moved."""
        azimuth_deg = self.azimuth.angle_deg
        pitch_deg = self.pitch.angle_deg
        roll_deg = self.roll.angle_deg
        turned = (azimuth_deg, pitch_deg, roll_deg)
        if turned == self._turned:
            return self._matrix
        if (pitch_deg, roll_deg) != self._tilted:
            pitched = about_axis(self._pitch_axis, pitch_deg)
            rolled = about_axis(self._roll_axis, roll_deg)
            self._tilt_matrix = product(product(self._wobble, pitched), rolled)
            self._tilted = (pitch_deg, roll_deg)
        turntable = product(self._base, about_vertical(azimuth_deg))
        self._matrix = product(turntable, self._tilt_matrix)
        self._turned = turned
        return self._matrix

    def apply(self, active: ActiveFault) -> bool:
        """Take a fault of the rig; return whether it was one."""
        name = active.fault.name
        for axis in self.axes:
            if name == f"axis_stalled_{axis.name}":
                axis.stall = active.strength
                return True
        return False


def draw_rig(seed: int) -> RigMechanics:
    """Return a rig within its specification, drawn from a seed.

    Standard deviations: encoder 0.02 deg, base level and squareness 0.01 deg, wobble
    0.003 deg; backlash 0.004 deg; the axes wake up off their index by up to 2 deg.
    """
    rng = np.random.default_rng((_STREAM, seed))
    geometry = RigGeometry(
        base_level_north_deg=float(rng.normal(0.0, 0.01)),
        base_level_east_deg=float(rng.normal(0.0, 0.01)),
        azimuth_pitch_squareness_deg=float(rng.normal(0.0, 0.01)),
        pitch_roll_squareness_deg=float(rng.normal(0.0, 0.01)),
        wobble_deg=float(rng.normal(0.0, 0.003)),
    )
    return RigMechanics(
        (
            _draw_axis("azimuth", AZIMUTH_RATING, (-720.0, 720.0), rng),
            _draw_axis("pitch", TILT_RATING, TILT_TRAVEL_DEG, rng),
            _draw_axis("roll", TILT_RATING, TILT_TRAVEL_DEG, rng),
        ),
        geometry,
    )


def perfect_rig() -> RigMechanics:
    """Return a rig without any error, for tests of the physics behind it."""
    return RigMechanics(
        (
            _perfect_axis("azimuth", AZIMUTH_RATING),
            _perfect_axis("pitch", TILT_RATING),
            _perfect_axis("roll", TILT_RATING),
        )
    )


def _perfect_axis(name: str, rating: tuple[float, float]) -> AxisMechanics:
    return AxisMechanics(name, max_velocity_dps=rating[0], max_acceleration_dps2=rating[1])


def _draw_axis(
    name: str,
    rating: tuple[float, float],
    travel_deg: tuple[float, float],
    rng: np.random.Generator,
) -> AxisMechanics:
    return AxisMechanics(
        name,
        max_velocity_dps=rating[0],
        max_acceleration_dps2=rating[1],
        encoder=draw_encoder(rng),
        backlash_deg=BACKLASH_DEG,
        travel_deg=travel_deg,
        start_deg=float(np.round(rng.uniform(-2.0, 2.0), 3)),
    )
