"""What surrounds the module: the field where it stands and how the rig holds it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from devices.rotation import Matrix, Vector, about_vertical, apply, apply_inverse, product
from devices.seat import Seat

if TYPE_CHECKING:
    from devices.field import EarthField
    from devices.rig import RigMechanics

NO_GRADIENT: Final[Matrix] = (0.0,) * 9
_CROSSING: Final[Vector] = (0.0, 0.0, 0.0)
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
    """A steel vehicle that drives past, or stands: a dipole.

    Attributes
    ----------
    moment_ned_am2 : (float, float, float)
        Magnetic moment in A m2; a forklift has a few hundred.
    start_ned_m, velocity_ned_mps : (float, float, float)
        Place at `starts_s` from the module, and velocity; without one it stands there.
    starts_s : float
        World time at which it is at its start, s.
    stands_s : float
        How long it stands where it comes nearest to the module, s.
    """

    moment_ned_am2: Vector = (0.0, 0.0, 300.0)
    start_ned_m: Vector = (-20.0, 4.0, 0.0)
    velocity_ned_mps: Vector = (1.5, 0.0, 0.0)
    starts_s: float = 0.0
    stands_s: float = 0.0

    def place_ned_m(self, t_s: float) -> Vector:
        """Return where it is at a time, from the module, m."""
        driven_s = t_s - self.starts_s
        vn, ve, vd = self.velocity_ned_mps
        north, east, down = self.start_ned_m
        speed_squared = vn * vn + ve * ve + vd * vd
        if self.stands_s and speed_squared:
            nearest_s = -(north * vn + east * ve + down * vd) / speed_squared
            if driven_s > nearest_s:
                driven_s = max(nearest_s, driven_s - self.stands_s)
        return (north + vn * driven_s, east + ve * driven_s, down + vd * driven_s)

    def field_ned_mg(self, t_s: float, place_ned_m: Vector = (0.0, 0.0, 0.0)) -> Vector:
        """Return the dipole's field at a place from the module: mu0/4pi (3 (m.r) r/r^5 - m/r^3)."""
        north, east, down = (
            place - own for place, own in zip(place_ned_m, self.place_ned_m(t_s), strict=True)
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
    """The field and gravity in the frame of the unit in its seat.

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
    vehicle_g : (float, float, float)
        Acceleration of a vehicle that carries rig and module, along forward, right and down of
        its levelled frame, which turns with the azimuth.
    gradient_ned_mg_per_m : nine floats
        Change of the site's field over a metre, d field_i / d place_k row by row; symmetric and
        without trace, as a field without sources has it (rot B = 0, div B = 0).
    sensor_body_m : (float, float, float)
        Where the sensor sits from the axes' crossing, in the unit's frame, m.
    seat : Seat
        How the unit is held; square on the rig's inner axis by default.

    Raises
    ------
    ValueError
        If the gradient is not symmetric or has a trace.
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
        vehicle_g: Vector = (0.0, 0.0, 0.0),
        gradient_ned_mg_per_m: Matrix = NO_GRADIENT,
        sensor_body_m: Vector = (0.0, 0.0, 0.0),
        seat: Seat | None = None,
    ) -> None:
        self.rig = rig
        self.earth = field
        self.drift = drift
        self.hum = hum
        self.vehicles = () if forklift is None else (forklift,)
        self.anomaly_ned_mg = anomaly_ned_mg
        self.vehicle_g = vehicle_g
        self.gradient_ned_mg_per_m = _possible_gradient(gradient_ned_mg_per_m)
        self.sensor_body_m = sensor_body_m
        self._t_ns = 0
        self._next_drift_s = 0.0
        self._even_ned_mg: Vector = field.ned_mg
        self._at_places: dict[Vector, Vector] = {}
        self._field_ned_mg: Vector = field.ned_mg
        self._matrix: Matrix | None = None
        self._field_body_mg: Vector = (0.0, 0.0, 0.0)
        self._force_body_g: Vector = (0.0, 0.0, -1.0)
        self.seat = seat or Seat()
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
        if t_s >= self._next_drift_s or self.hum is not None or self.vehicles:
            self._renew_field(t_s)

    @property
    def t_s(self) -> float:
        """Time of the world in seconds."""
        return self._t_ns / _NS_PER_S

    @property
    def field_ned_mg(self) -> Vector:
        """Field at the module in NED, mG."""
        return self._field_ned_mg

    @property
    def seat(self) -> Seat:
        """How the unit is held."""
        return self._seat

    @seat.setter
    def seat(self, seat: Seat) -> None:
        self._seat = seat
        self._inner_from_unit = None if seat.square else seat.inner_from_unit()
        self._iron_mg = seat.iron_unit_mg()
        self._matrix = None

    def drive_up(self, vehicle: Forklift) -> None:
        """Let a vehicle add its field from now on."""
        self.vehicles = (*self.vehicles, vehicle)
        self._renew_field(self.t_s)

    def field_at_ned_mg(self, place_ned_m: Vector) -> Vector:
        """Return the field at a place from the axes' crossing, in NED, mG.

        The site's field with its gradient, and each vehicle's as it is there.
        """
        found = self._at_places.get(place_ned_m)
        if found is None:
            bent = apply(self.gradient_ned_mg_per_m, place_ned_m)
            found = _sum(self._even_ned_mg, bent, self._of_vehicles(place_ned_m))
            self._at_places[place_ned_m] = found
        return found

    def field_body_mg(self) -> Vector:
        """Return the field in the unit's frame, mG; the same object while nothing changes."""
        if self._matrix is not self.rig.ned_from_body():
            self._turn()
        return self._field_body_mg

    def force_body_g(self) -> Vector:
        """Return the specific force in the unit's frame, g: (0, 0, -1) level at rest.

        Accelerations of the rig's motion are left out: the module sits in the axes' crossing,
        and only settled poses are judged. Those of a vehicle count.
        """
        if self._matrix is not self.rig.ned_from_body():
            self._turn()
        return self._force_body_g

    def _renew_field(self, t_s: float) -> None:
        even = _sum(self.earth.ned_mg, self.anomaly_ned_mg)
        for source in (self.drift, self.hum):
            if source is not None:
                even = _sum(even, source.field_ned_mg(t_s))
        self._next_drift_s = t_s + _DRIFT_PERIOD_S
        self._even_ned_mg = even
        self._at_places.clear()
        field = _sum(even, self._of_vehicles(_CROSSING)) if self.vehicles else even
        if field != self._field_ned_mg:
            self._field_ned_mg = field
            self._matrix = None

    def _of_vehicles(self, place_ned_m: Vector) -> Vector:
        total = (0.0, 0.0, 0.0)
        for vehicle in self.vehicles:
            total = _sum(total, vehicle.field_ned_mg(self.t_s, place_ned_m))
        return total

    def _turn(self) -> None:
        turned = self.rig.ned_from_body()
        held = self._inner_from_unit
        matrix = turned if held is None else product(turned, held)
        field = self._field_ned_mg
        if self.gradient_ned_mg_per_m is not NO_GRADIENT:
            place = apply(matrix, self.sensor_body_m)
            field = _sum(field, apply(self.gradient_ned_mg_per_m, place))
        x, y, z = apply_inverse(matrix, field)
        iron = self._iron_mg
        self._field_body_mg = (x + iron[0], y + iron[1], z + iron[2])
        forward, right, down = self.vehicle_g
        north_g, east_g, down_g = apply(
            about_vertical(self.rig.azimuth.angle_deg), (forward, right, down - 1.0)
        )
        self._force_body_g = apply_inverse(matrix, (north_g, east_g, down_g))
        self._matrix = turned


def _sum(first: Vector, *others: Vector) -> Vector:
    x, y, z = first
    for dx, dy, dz in others:
        x, y, z = x + dx, y + dy, z + dz
    return (x, y, z)


def _possible_gradient(gradient: Matrix) -> Matrix:
    nn, ne, nd, en, ee, ed, dn, de, dd = gradient
    size = max(abs(element) for element in gradient)
    odd = (ne - en, nd - dn, ed - de, nn + ee + dd)
    if any(abs(difference) > 1e-9 * size for difference in odd):
        message = (
            "gradient_ned_mg_per_m must be symmetric and without trace; "
            f"instead received {gradient} mG/m"
        )
        raise ValueError(message)
    return gradient
