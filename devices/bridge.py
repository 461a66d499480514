"""Three anisotropic magnetoresistive (AMR) bridges with set/reset straps.

One bridge gives V = p S H/(1 + p Ha/Hk) + b, where H is the field along its axis, Ha the
field across it, Hk the anisotropy field of the film, p = +1 after a set pulse and -1 after
a reset pulse, S the sensitivity and b the bridge offset. So (set - reset)/2 holds
H/(1 - (Ha/Hk)^2), and (set + reset)/2 holds b - H Ha/Hk. The field across is y for the
x bridge and x for the y and the z bridge (the z chip stands upright with its hard axis
along x).

Figures: Honeywell HMC1001/1002/1021/1022 data sheets (sensitivity, offset, noise, tempco,
strap), Caruso (PLANS 2000) Table 1 (85 uG, 0.05 % linearity, 0.08 % hysteresis and
repeatability), all at a full scale of +-400 mG.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable

    from devices.rotation import Vector

REFERENCE_C: Final = 25.0
RANGE_MG: Final = 800.0
"""End of scale of the converter."""
ACROSS: Final = (1, 0, 0)
"""Index of the field across the x, y and z bridge."""
DISTURBING_FIELD_MG: Final = 4000.0
"""Field from which the film breaks into domains: 4 to 20 G in the data sheets."""
REPEATABILITY_PATH_MG: Final = 15.0
"""Way through the field over which the repeatability error is forgotten."""
REPEATABILITY_STEP_MG: Final = 5.0
FLIP_SHARE: Final = 0.6
"""Current that flips an ordered film, over the current that restores a disordered one."""
_FLIP_WIDTH: Final = 0.03
_ORDER_WIDTH: Final = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeParameters:
    """One bridge.

    Attributes
    ----------
    sensitivity : float
        Gain against the nominal one (HMC5883L and MMC5983MA: 1 +- 5 %).
    sensitivity_tempco_per_c : float
        -0.3 %/C with voltage supply (HMC1001/1002), common to the three to a tenth.
    offset_mg, offset_tempco_mg_per_c : float
        Bridge offset, trimmed to +-50 mG.
    hk_mg : float
        Anisotropy field of the film, 8 G.
    cubic_per_mg2 : float
        Cubic nonlinearity: 0.2 mG at 400 mG (0.05 % of full scale).
    hysteresis_mg : float
        Half width of the play between rising and falling field.
    repeatability_mg : float
        Standard deviation of the field read at a pose reached anew (0.08 % of full scale).
    """

    sensitivity: float = 1.0
    sensitivity_tempco_per_c: float = 0.0
    offset_mg: float = 0.0
    offset_tempco_mg_per_c: float = 0.0
    hk_mg: float = 8000.0
    cubic_per_mg2: float = 0.0
    hysteresis_mg: float = 0.0
    repeatability_mg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Strap:
    """The set/reset strap and its driver.

    Attributes
    ----------
    minimum_ma : float
        Current that restores a disordered film (HMC1021: 0.5 A).
    nominal_ma : float
        Current of the module's own pulses.
    undershoot : float
        Swing of the driver to the other side after a pulse, over the pulse: it un-sets.
    """

    minimum_ma: float = 500.0
    nominal_ma: float = 1000.0
    undershoot: float = 0.05

    def flipped(self, current_ma: float) -> float:
        """Return the part of an ordered film that a pulse flips, 0 to 1."""
        return _sigmoid((current_ma / self.minimum_ma - FLIP_SHARE) / _FLIP_WIDTH)

    def ceiling(self, current_ma: float) -> float:
        """Return the most order that a pulse leaves: its undershoot un-sets the rest."""
        return 1.0 - self.flipped(self.undershoot * current_ma)

    def restored(self, current_ma: float) -> float:
        """Return the least order that a pulse leaves, whatever was before."""
        order = _sigmoid((current_ma / self.minimum_ma - 1.0) / _ORDER_WIDTH)
        return order * self.ceiling(current_ma)


def _sigmoid(value: float) -> float:
    return 1.0 / (1.0 + math.exp(-min(max(value, -40.0), 40.0)))


class Bridge:
    """State of one bridge: order, hysteresis and repeatability."""

    __slots__ = (
        "_error_mg", "_lagging_mg", "dead", "order", "parameters", "stuck",
    )  # fmt: skip

    def __init__(self, parameters: BridgeParameters) -> None:
        self.parameters = parameters
        self.order = 1.0
        self.dead = 0.0
        self.stuck = 0.0
        self._lagging_mg: float | None = None
        self._error_mg = 0.0

    def expose(self, strength_mg: float) -> None:
        """Break the film's order by a strong field; 60 % of it is lost in the end."""
        excess = strength_mg - DISTURBING_FIELD_MG
        if excess > 0.0:
            broken = 1.0 - 0.6 * (1.0 - math.exp(-excess / DISTURBING_FIELD_MG))
            self.order = min(self.order, broken)

    def pulse(self, restored: float, ceiling: float) -> None:
        """Order the film as far as a pulse does; a dead strap carries no current."""
        ordered = min(max(self.order, restored), ceiling)
        self.order += (ordered - self.order) * (1.0 - self.dead)

    def redraw(self, kept: float, normal: float) -> None:
        """Forget the repeatability error but for `kept` of it, and draw the rest."""
        spread_mg = self.parameters.repeatability_mg * math.sqrt(1.0 - kept * kept)
        self._error_mg = kept * self._error_mg + spread_mg * normal

    def levels_mg(
        self, along_mg: float, across_mg: float, flipped: float, warm_c: float
    ) -> tuple[float, float]:
        """Return the noiseless set and reset levels.

        Parameters
        ----------
        along_mg, across_mg : float
            Field along and across the bridge.
        flipped : float
            Part of the film that each pulse flips.
        warm_c : float
            Temperature above 25 C.
        """
        p = self.parameters
        play_mg = p.hysteresis_mg * (1.0 + 4.0 * (1.0 - self.order))
        lagging_mg = self._lagging_mg
        if lagging_mg is None:
            lagging_mg = along_mg
        elif along_mg > lagging_mg + play_mg:
            lagging_mg = along_mg - play_mg
        elif along_mg < lagging_mg - play_mg:
            lagging_mg = along_mg + play_mg
        self._lagging_mg = lagging_mg
        h = lagging_mg + self._error_mg
        h += p.cubic_per_mg2 * h * h * h
        h *= p.sensitivity * (1.0 + p.sensitivity_tempco_per_c * warm_c) * self.order
        offset_mg = p.offset_mg + p.offset_tempco_mg_per_c * warm_c
        plus_mg = h / (1.0 + across_mg / p.hk_mg)
        minus_mg = -h / (1.0 - across_mg / p.hk_mg)
        # Each pulse flips the part f of the film: after many of them the set state holds
        # the polarity +f/(2 - f) and the reset state its opposite; with f = 0 it stays set.
        f = flipped * (1.0 - self.dead)
        mixed = f / (2.0 - f) if f > 1e-6 else None
        high = 1.0 if mixed is None else (1.0 + mixed) / 2.0
        low = 1.0 if mixed is None else (1.0 - mixed) / 2.0
        signal = 1.0 - self.stuck
        return (
            offset_mg + signal * (high * plus_mg + (1.0 - high) * minus_mg),
            offset_mg + signal * (low * plus_mg + (1.0 - low) * minus_mg),
        )


class Bridge3:
    """The three bridges of a module, on one strap and one converter.

    Parameters
    ----------
    parameters : three BridgeParameters
        The x, y and z bridge.
    strap : Strap
        Their common strap.
    draw : callable
        Gives the next standard normal number.
    bits, range_mg : int, float
        Resolution of the converter over +-range_mg, 8 to 16.
    """

    def __init__(
        self,
        parameters: tuple[BridgeParameters, BridgeParameters, BridgeParameters],
        strap: Strap,
        draw: Callable[[], float],
        bits: int = 14,
        range_mg: float = RANGE_MG,
    ) -> None:
        if not 8 <= bits <= 16:
            message = f"bits must be within 8 and 16; instead received {bits}"
            raise ValueError(message)
        x, y, z = (Bridge(one) for one in parameters)
        self.bridges = (x, y, z)
        self.strap = strap
        self.mg_per_count = 2.0 * range_mg / 2.0**bits
        self.count_limit = (1 << bits - 1) - 1
        self._draw = draw
        self._flipped = strap.flipped(strap.nominal_ma)
        self._own = (strap.restored(strap.nominal_ma), strap.ceiling(strap.nominal_ma))
        self._last_mg: Vector | None = None
        self._path_mg = 0.0

    def drive(self, current_ma: float) -> None:
        """Use pulses of a current from now on."""
        self._flipped = self.strap.flipped(current_ma)
        self._own = (self.strap.restored(current_ma), self.strap.ceiling(current_ma))

    def pulse(self, current_ma: float) -> None:
        """Give one set and one reset pulse: restores the order as far as they can."""
        restored, ceiling = self.strap.restored(current_ma), self.strap.ceiling(current_ma)
        for bridge in self.bridges:
            bridge.pulse(restored, ceiling)

    def levels_mg(
        self, field_mg: Vector, temperature_c: float
    ) -> tuple[float, float, float, float, float, float]:
        """Return the noiseless set (x, y, z) and reset (x, y, z) levels in mG, unlimited.

        The film remembers: the call moves hysteresis, repeatability and order.
        """
        self._remember(field_mg)
        warm_c = temperature_c - REFERENCE_C
        x_mg, y_mg, z_mg = field_mg
        x, y, z = self.bridges
        flipped = self._flipped
        x_set, x_reset = x.levels_mg(x_mg, y_mg, flipped, warm_c)
        y_set, y_reset = y.levels_mg(y_mg, x_mg, flipped, warm_c)
        z_set, z_reset = z.levels_mg(z_mg, x_mg, flipped, warm_c)
        return (x_set, y_set, z_set, x_reset, y_reset, z_reset)

    def read(
        self, field_mg: Vector, polarity: int, temperature_c: float = REFERENCE_C
    ) -> tuple[int, int, int]:
        """Return the noiseless counts after a set (+1) or a reset (-1) pulse.

        The converter holds them at its ends of scale.
        """
        levels = self.levels_mg(field_mg, temperature_c)
        x_mg, y_mg, z_mg = levels[:3] if polarity > 0 else levels[3:]
        return (self.counts(x_mg), self.counts(y_mg), self.counts(z_mg))

    def counts(self, level_mg: float) -> int:
        """Return the converter's counts of a level."""
        limit = self.count_limit
        return min(max(round(level_mg / self.mg_per_count), -limit - 1), limit)

    def _remember(self, field_mg: Vector) -> None:
        x_mg, y_mg, z_mg = field_mg
        strength2 = x_mg * x_mg + y_mg * y_mg + z_mg * z_mg
        if strength2 > DISTURBING_FIELD_MG * DISTURBING_FIELD_MG:
            for bridge in self.bridges:
                bridge.expose(math.sqrt(strength2))
        else:
            restored, ceiling = self._own
            for bridge in self.bridges:
                bridge.pulse(restored, ceiling)
        last = self._last_mg
        self._last_mg = field_mg
        if last is None:
            self._redraw(0.0)
            return
        dx, dy, dz = x_mg - last[0], y_mg - last[1], z_mg - last[2]
        self._path_mg += math.sqrt(dx * dx + dy * dy + dz * dz)
        if self._path_mg > REPEATABILITY_STEP_MG:
            self._redraw(math.exp(-self._path_mg / REPEATABILITY_PATH_MG))
            self._path_mg = 0.0

    def _redraw(self, kept: float) -> None:
        for bridge in self.bridges:
            bridge.redraw(kept, self._draw())
