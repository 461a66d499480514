"""The module's sensors: from the seat's field and force to counts, once a tick."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from devices.bridge import Bridge3
from devices.magnetics import Magnetics
from devices.noise import BLOCK, NormalStream, pink_block
from devices.rotation import Matrix, Vector, apply, product
from devices.unit import PINK_SHARE

if TYPE_CHECKING:
    from devices.accelerometer import Accelerometer
    from devices.faults import ActiveFault
    from devices.unit import ModuleUnit
    from devices.world import World

Counts: TypeAlias = tuple[int, int, int]

_AGE_S: Final = 1.0
_WANDER_S: Final = 100.0
_ACCEL_LIMIT: Final = 32767
_EXCESS_NOISE: Final = 19.0
"""Noise that the full fault adds, over the data sheet's."""
_IRON_MG: Final = 900.0
"""Field of the magnetised part of the fault `saturated_axis`."""
_AXES: Final = "xyz"


class Sensors:
    """Magnetometer and accelerometer of one unit in the world.

    The set and the reset reading of a cycle are taken as of one instant: the module's
    pulses follow each other within 2 ms, in which a settled rig does not move.

    Parameters
    ----------
    unit : ModuleUnit
        The unit's parameters.
    world : World
        Where it sits.
    rng : numpy.random.Generator
        Source of its noise; streams for noise and memory are spawned from it.
    """

    def __init__(self, unit: ModuleUnit, world: World, rng: np.random.Generator) -> None:
        self.unit = unit
        self.temperature_c = unit.temperature_c(0.0)
        self.supply_v = unit.supply_v
        self._world = world
        self._noise_rng, memory_rng = rng.spawn(2)
        self._draw = NormalStream(memory_rng)
        self._bridges = Bridge3(unit.bridges, unit.strap, self._draw, unit.bits, unit.range_mg)
        self._magnetics: Magnetics = unit.magnetics
        self._accelerometer: Accelerometer = unit.accelerometer
        self._accel_gain: Vector = (1.0, 1.0, 1.0)
        self._wander_g = [0.0, 0.0, 0.0]
        self._pulse_current_ma = unit.strap.nominal_ma
        self._noise_scale = np.ones(3)
        self._next_age_s = -math.inf
        self._seen_mg: Vector | None = None
        self._levels = (0.0,) * 9
        self._clipped = False
        self._row = BLOCK
        self._rows: list[list[float]] = []
        self._block = np.empty((BLOCK, 9))

    @property
    def pulse_current_ma(self) -> float:
        """Current of the pulses of every cycle, mA."""
        return self._pulse_current_ma

    @pulse_current_ma.setter
    def pulse_current_ma(self, current_ma: float) -> None:
        self._pulse_current_ma = current_ma
        self._bridges.drive(current_ma)
        self._seen_mg = None

    @property
    def film_order(self) -> Vector:
        """Order of the x, y and z film, 1 for a single domain."""
        x, y, z = self._bridges.bridges
        return (x.order, y.order, z.order)

    def sample(self, t_s: float) -> tuple[Counts, Counts, Counts]:
        """Return the counts (x, y, z) of the set reading, the reset reading and the acceleration.

        Parameters
        ----------
        t_s : float
            Time since power-on; must not go back.
        """
        if t_s >= self._next_age_s:
            self._age(t_s)
        field_mg = self._world.field_body_mg()
        if field_mg is not self._seen_mg:
            self._look(field_mg)
        row = self._row
        if row >= BLOCK:
            self._draw_block()
            row = 0
        self._row = row + 1
        a, b, c, d, e, f, g, h, i = self._levels
        na, nb, nc, nd, ne, nf, ng, nh, ni = self._rows[row]
        if self._clipped:
            return self._held(row)
        return (
            (round(a + na), round(b + nb), round(c + nc)),
            (round(d + nd), round(e + ne), round(f + nf)),
            (round(g + ng), round(h + nh), round(i + ni)),
        )

    def pulse(self, current_ma: float) -> None:
        """Give one set and one reset pulse of a current on all axes."""
        self._bridges.pulse(current_ma)
        self._seen_mg = None

    def expose(self, field_body_mg: Vector) -> None:
        """Pass a strong field over the module, as a magnet that is brought near and taken away."""
        x, y, z = self._magnetics.sensor_field_mg(field_body_mg)
        for bridge in self._bridges.bridges:
            bridge.expose(math.sqrt(x * x + y * y + z * z))
        self._seen_mg = None

    def apply(self, active: ActiveFault) -> bool:
        """Take a fault of a sensor; return whether it was one."""
        name, strength = active.fault.name, active.strength
        kind, _, axis_name = name.rpartition("_")
        axis = _AXES.find(axis_name) if len(axis_name) == 1 else -1
        if name == "swapped_axes":
            mix_rad = strength * math.pi / 2.0
            c, s = math.cos(mix_rad), math.sin(mix_rad)
            self._rewire((c, s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0))
        elif name == "excess_noise":
            self._scale_noise((0, 1, 2), 1.0 + _EXCESS_NOISE * strength)
        elif name == "saturated_axis":
            x, y, z = self._magnetics.hard_iron_mg
            away_mg = math.copysign(_IRON_MG * strength, x)
            self._magnetics = Magnetics(
                soft_iron=self._magnetics.soft_iron, hard_iron_mg=(x + away_mg, y, z)
            )
        elif axis < 0 or not self._apply_to_axis(kind, axis, strength):
            return False
        self._seen_mg = None
        return True

    def _apply_to_axis(self, kind: str, axis: int, strength: float) -> bool:
        bridge = self._bridges.bridges[axis]
        if kind == "dead_strap":
            bridge.dead = strength
        elif kind == "stuck_axis":
            bridge.stuck = strength
            self._scale_noise((axis,), 1.0 - strength)
        elif kind == "inverted_axis":
            gains = [1.0, 1.0, 1.0]
            gains[axis] = 1.0 - 2.0 * strength
            self._rewire((gains[0], 0.0, 0.0, 0.0, gains[1], 0.0, 0.0, 0.0, gains[2]))
        elif kind == "accel_sign":
            x, y, z = (
                1.0 - 2.0 * strength if one == axis else old
                for one, old in enumerate(self._accel_gain)
            )
            self._accel_gain = (x, y, z)
        else:
            return False
        return True

    def _rewire(self, wiring: Matrix) -> None:
        iron = self._magnetics
        self._magnetics = Magnetics(
            soft_iron=product(wiring, iron.soft_iron), hard_iron_mg=apply(wiring, iron.hard_iron_mg)
        )

    def _scale_noise(self, axes: tuple[int, ...], factor: float) -> None:
        for axis in axes:
            self._noise_scale[axis] *= factor
        if self._rows:
            self._rows = self._scaled_rows()

    def _age(self, t_s: float) -> None:
        self._next_age_s = t_s + _AGE_S
        self.temperature_c = self.unit.temperature_c(t_s)
        step_g = self.unit.accel_wander_g * math.sqrt(_AGE_S / _WANDER_S)
        for axis in range(3):
            self._wander_g[axis] += step_g * self._draw()
        self._seen_mg = None

    def _look(self, field_mg: Vector) -> None:
        self._seen_mg = field_mg
        unit = self.unit
        per_mg = 1.0 / unit.mag_mg_per_count
        per_g = 1.0 / unit.accel_g_per_count
        sensor_mg = self._magnetics.sensor_field_mg(field_mg)
        xs, ys, zs, xr, yr, zr = self._bridges.levels_mg(sensor_mg, self.temperature_c)
        ax, ay, az = self._accelerometer.level_g(self._world.force_body_g(), self.temperature_c)
        wander = self._wander_g
        gain = self._accel_gain
        levels = (
            xs * per_mg, ys * per_mg, zs * per_mg, xr * per_mg, yr * per_mg, zr * per_mg,
            gain[0] * (ax + wander[0]) * per_g, gain[1] * (ay + wander[1]) * per_g,
            gain[2] * (az + wander[2]) * per_g,
        )  # fmt: skip
        self._levels = levels
        near = 0.95 * self._bridges.count_limit
        high, low = max(levels[:6]), min(levels[:6])
        force_high, force_low = max(levels[6:]), min(levels[6:])
        near_force = 0.9 * _ACCEL_LIMIT
        self._clipped = (
            high > near or low < -near or force_high > near_force or force_low < -near_force
        )

    def _held(self, row: int) -> tuple[Counts, Counts, Counts]:
        limit = self._bridges.count_limit
        counts = [
            round(level + noise) for level, noise in zip(self._levels, self._rows[row], strict=True)
        ]
        a, b, c, d, e, f = (min(max(count, -limit - 1), limit) for count in counts[:6])
        g, h, i = (min(max(count, -_ACCEL_LIMIT - 1), _ACCEL_LIMIT) for count in counts[6:])
        return (a, b, c), (d, e, f), (g, h, i)

    def _draw_block(self) -> None:
        unit = self.unit
        rng = self._noise_rng
        white = math.sqrt(1.0 - PINK_SHARE**2)
        block = rng.standard_normal((BLOCK, 9))
        block[:, :6] *= white
        pink = PINK_SHARE * pink_block(rng, 3)
        block[:, 0:3] += pink
        block[:, 3:6] += pink
        block[:, :6] *= unit.noise_mg / unit.mag_mg_per_count
        block[:, 6:] *= unit.accelerometer.noise_g / unit.accel_g_per_count
        self._block = block
        self._rows = self._scaled_rows()

    def _scaled_rows(self) -> list[list[float]]:
        scale = np.concatenate([self._noise_scale, self._noise_scale, np.ones(3)])
        rows: list[list[float]] = (self._block * scale).tolist()
        return rows
