"""What surrounds the module: the field where it stands and how the rig holds it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from devices.rotation import Matrix, Vector, about_vertical, apply, apply_inverse

if TYPE_CHECKING:
    from devices.field import EarthField
    from devices.rig import RigMechanics

_NS_PER_S = 1e9
_DRIFT_PERIOD_S = 1.0
_LONGEST_STEP_S = 0.02
"""Longer steps, as after a hiccup of a free-running host, are divided for the mechanics."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowDrift:
    """The Earth's field over minutes: two sinusoids along a fixed direction.

    Quiet-day variation and station noise are of this size over a quarter of an hour;
    amplitudes in mG, periods in seconds, phases in radians.
    """

    direction_ned: Vector = (0.6, 0.6, 0.529)
    amplitudes_mg: tuple[float, float] = (0.06, 0.03)
    periods_s: tuple[float, float] = (1100.0, 170.0)
    phases_rad: tuple[float, float] = (0.0, 1.0)

    def field_ned_mg(self, t_s: float) -> Vector:
        """Return the deviation from the site's field at a time."""
        size_mg = 0.0
        for index in (0, 1):
            turns_rad = 2.0 * math.pi * t_s / self.periods_s[index]
            size_mg += self.amplitudes_mg[index] * math.sin(turns_rad + self.phases_rad[index])
        north, east, down = self.direction_ned
        return (size_mg * north, size_mg * east, size_mg * down)


@dataclass(frozen=True, slots=True, kw_only=True)
class MainsHum:
    """Field of the mains' currents, sinusoidal."""

    amplitude_ned_mg: Vector
    frequency_hz: float = 50.0

    def field_ned_mg(self, t_s: float) -> Vector:
        """Return the hum at a time."""
        phase = math.sin(2.0 * math.pi * self.frequency_hz * t_s)
        north, east, down = self.amplitude_ned_mg
        return (phase * north, phase * east, phase * down)


@dataclass(frozen=True, slots=True, kw_only=True)
class Forklift:
    """A steel vehicle that drives past: a moving dipole.

    Attributes
    ----------
    moment_ned_am2 : (float, float, float)
        Magnetic moment in A m2; a forklift has a few hundred.
    start_ned_m, velocity_ned_mps : (float, float, float)
        Place at time 0 from the module, and velocity.
    """

    moment_ned_am2: Vector = (0.0, 0.0, 300.0)
    start_ned_m: Vector = (-20.0, 4.0, 0.0)
    velocity_ned_mps: Vector = (1.5, 0.0, 0.0)

    def field_ned_mg(self, t_s: float) -> Vector:
        """Return the dipole's field at the module: mu0/4pi (3 (m.r) r/r^5 - m/r^3)."""
        north, east, down = (
            -(start + velocity * t_s)
            for start, velocity in zip(self.start_ned_m, self.velocity_ned_mps, strict=True)
        )
        mn, me, md = self.moment_ned_am2
        distance_m = math.sqrt(north * north + east * east + down * down)
        along = 3.0 * (mn * north + me * east + md * down) / distance_m**2
        scale = 1.0 / distance_m**3  # mu0/4pi = 1e-7 T m/A and 1 mG = 1e-7 T
        return (
            scale * (along * north - mn),
            scale * (along * east - me),
            scale * (along * down - md),
        )


class World:
    """The field and gravity in the frame of the seat.

    Parameters
    ----------
    field : EarthField
        The site's field; its declination counts from the rig's zero.
    rig : RigMechanics
        Holds the module.
    drift, hum, forklift
        Disturbances; None switches one off.
    anomaly_ned_mg : (float, float, float)
        Constant local addition to the site's field, from the rig's base and the building.
    stage_body_mg : (float, float, float)
        Stray field of the rig's inner stage, which turns with the seat.
    vehicle_g : (float, float, float)
        Acceleration of a vehicle that carries rig and module, along forward, right and down of
        its levelled frame, which turns with the azimuth.
    """

    def __init__(
        self,
        field: EarthField,
        rig: RigMechanics,
        *,
        drift: SlowDrift | None = None,
        hum: MainsHum | None = None,
        forklift: Forklift | None = None,
        anomaly_ned_mg: Vector = (0.0, 0.0, 0.0),
        stage_body_mg: Vector = (0.0, 0.0, 0.0),
        vehicle_g: Vector = (0.0, 0.0, 0.0),
    ) -> None:
        self.rig = rig
        self.earth = field
        self.drift = drift
        self.hum = hum
        self.forklift = forklift
        self.anomaly_ned_mg = anomaly_ned_mg
        self.stage_body_mg = stage_body_mg
        self.vehicle_g = vehicle_g
        self._t_ns = 0
        self._next_drift_s = 0.0
        self._field_ned_mg: Vector = field.ned_mg
        self._matrix: Matrix | None = None
        self._field_body_mg: Vector = (0.0, 0.0, 0.0)
        self._force_body_g: Vector = (0.0, 0.0, -1.0)
        self._renew_field(0.0)

    def step(self, t_ns: int) -> None:
        """Go on to a time in nanoseconds: move the rig's axes, then change the field.

        Raises
        ------
        ValueError
            If the time lies before the present one.
        """
        if t_ns < self._t_ns:
            message = f"t_ns must not go back; instead received {t_ns} ns after {self._t_ns} ns"
            raise ValueError(message)
        dt_s = (t_ns - self._t_ns) / _NS_PER_S
        while dt_s > _LONGEST_STEP_S:
            self.rig.step(_LONGEST_STEP_S)
            dt_s -= _LONGEST_STEP_S
        self.rig.step(dt_s)
        self._t_ns = t_ns
        t_s = t_ns / _NS_PER_S
        if t_s >= self._next_drift_s or self.hum is not None or self.forklift is not None:
            self._renew_field(t_s)

    @property
    def t_s(self) -> float:
        """Time of the world in seconds."""
        return self._t_ns / _NS_PER_S

    @property
    def field_ned_mg(self) -> Vector:
        """Field at the module in NED, mG."""
        return self._field_ned_mg

    def field_body_mg(self) -> Vector:
        """Return the field in the seat's frame, mG; the same object while nothing changes."""
        if self._matrix is not self.rig.ned_from_body():
            self._turn()
        return self._field_body_mg

    def force_body_g(self) -> Vector:
        """Return the specific force in the seat's frame, g: (0, 0, -1) level at rest.

        Accelerations of the rig's motion are left out: the module sits in the axes' crossing,
        and only settled poses are judged. Those of a vehicle count.
        """
        if self._matrix is not self.rig.ned_from_body():
            self._turn()
        return self._force_body_g

    def _renew_field(self, t_s: float) -> None:
        north, east, down = self.earth.ned_mg
        anomaly = self.anomaly_ned_mg
        north, east, down = north + anomaly[0], east + anomaly[1], down + anomaly[2]
        for source in (self.drift, self.hum, self.forklift):
            if source is not None:
                extra = source.field_ned_mg(t_s)
                north, east, down = north + extra[0], east + extra[1], down + extra[2]
        self._next_drift_s = t_s + _DRIFT_PERIOD_S
        field = (north, east, down)
        if field != self._field_ned_mg:
            self._field_ned_mg = field
            self._matrix = None

    def _turn(self) -> None:
        matrix = self.rig.ned_from_body()
        x, y, z = apply_inverse(matrix, self._field_ned_mg)
        stage = self.stage_body_mg
        self._field_body_mg = (x + stage[0], y + stage[1], z + stage[2])
        forward, right, down = self.vehicle_g
        north_g, east_g, down_g = apply(
            about_vertical(self.rig.azimuth.angle_deg), (forward, right, down - 1.0)
        )
        self._force_body_g = apply_inverse(matrix, (north_g, east_g, down_g))
        self._matrix = matrix
