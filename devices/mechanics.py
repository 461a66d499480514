"""One axis of the rig: motor, load and encoder.

The profile is trapezoidal in time and exact in steps of the tick: the axis brakes so that
it stands on its target after a whole number of ticks. The servo closes on the encoder, so
the encoder shows the target and the true angle carries the encoder's error. Jerk is not
limited; what it would do to the load is modelled by a damped ring-down after the stop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import numpy as np

ENCODER_STEP_DEG: Final = 0.001
LAG_S: Final = 0.004
"""Following error over velocity of the servo."""
RING_AMPLITUDE_DEG: Final = 0.03
RING_FREQUENCY_HZ: Final = 14.0
RING_DECAY_S: Final = 0.04
RING_END_S: Final = 0.28
"""The ring-down has fallen to a thousandth: the load rests."""
_ARRIVED_DEG: Final = 1e-9
TORQUE_RESERVE: Final = 1.25
"""Speed that a free axis can reach, over its rated speed."""

_REST: Final = "rest"
_POSITION: Final = "position"
_VELOCITY: Final = "velocity"


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderMap:
    """Static error of an encoder: shown angle minus true angle.

    `harmonics` are (order, cosine, sine) with amplitudes in degrees: one and two cycles a
    turn from eccentricity and ellipticity of the disc, and one order of its graduation.
    """

    harmonics: tuple[tuple[int, float, float], ...] = ()

    def error_deg(self, angle_deg: float) -> float:
        """Return the error at a shown angle, in degrees."""
        angle_rad = math.radians(angle_deg)
        error_deg = 0.0
        for order, cosine_deg, sine_deg in self.harmonics:
            phase_rad = order * angle_rad
            error_deg += cosine_deg * math.cos(phase_rad) + sine_deg * math.sin(phase_rad)
        return error_deg


def draw_encoder(rng: np.random.Generator, sd_deg: float = 0.02) -> EncoderMap:
    """Return a random map whose error has the standard deviation `sd_deg` over units and angles."""
    amplitude_deg = sd_deg / math.sqrt(3.0)
    draws = rng.standard_normal(6) * amplitude_deg
    orders = (1, 2, 37)
    return EncoderMap(
        harmonics=tuple(
            (order, float(draws[2 * index]), float(draws[2 * index + 1]))
            for index, order in enumerate(orders)
        )
    )


class AxisMechanics:
    """A motor-driven axis with its encoder.

    Parameters
    ----------
    name : str
        Name of the axis, for messages.
    max_velocity_dps, max_acceleration_dps2 : float
        Ratings; commands above them are held to them.
    encoder : EncoderMap
        Static error of the encoder; perfect by default.
    backlash_deg : float
        Play between encoder and load, its whole width.
    travel_deg : (float, float)
        Mechanical end stops.
    start_deg : float
        Where the axis stands at power-on; the encoder's index pulse is its own zero.

    Attributes
    ----------
    angle_deg : float
        True angle of the load.
    stall : float
        0 free to 1 stuck: the part of its speed that the axis has lost.
    """

    def __init__(
        self,
        name: str,
        *,
        max_velocity_dps: float,
        max_acceleration_dps2: float,
        encoder: EncoderMap | None = None,
        backlash_deg: float = 0.0,
        travel_deg: tuple[float, float] = (-720.0, 720.0),
        start_deg: float = 0.0,
    ) -> None:
        self.name = name
        self.max_velocity_dps = max_velocity_dps
        self.max_acceleration_dps2 = max_acceleration_dps2
        self.travel_deg = travel_deg
        self.stall = 0.0
        self._encoder = encoder or EncoderMap()
        self._half_backlash_deg = backlash_deg / 2.0
        self._mode = _REST
        self._target_deg = start_deg
        self._velocity_limit_dps = max_velocity_dps
        self._acceleration_dps2 = max_acceleration_dps2
        self._demand_deg = start_deg
        self._velocity_dps = 0.0
        self._motor_deg = start_deg
        self._side = 1.0
        self._ring_deg = 0.0
        self._ring_amplitude_deg = 0.0
        self._ring_s = RING_END_S
        self.angle_deg = 0.0
        self._place_load()

    @property
    def encoder_deg(self) -> float:
        """Angle that the encoder shows, in whole encoder steps."""
        steps = round((self._motor_deg + self._ring_deg) / ENCODER_STEP_DEG)
        return steps * ENCODER_STEP_DEG

    @property
    def moving(self) -> bool:
        """Whether the demand moves or the load still rings."""
        return self._mode != _REST

    @property
    def velocity_dps(self) -> float:
        """Velocity of the demand."""
        return self._velocity_dps

    @property
    def following_error_deg(self) -> float:
        """Demanded minus measured angle."""
        return self._demand_deg - self._motor_deg

    def command(
        self, target_deg: float, velocity: float | None = None, acceleration: float | None = None
    ) -> None:
        """Go to an angle of the encoder, at once and from the present motion.

        Parameters
        ----------
        target_deg : float
            Angle that the encoder shall show.
        velocity, acceleration : float, optional
            In deg/s and deg/s2; above the rating, or left out, the rating.
        """
        self._limit(velocity, acceleration)
        self._target_deg = target_deg
        self._mode = _POSITION

    def command_velocity(self, velocity_dps: float, acceleration: float | None = None) -> None:
        """Turn at a velocity until told otherwise."""
        self._limit(abs(velocity_dps), acceleration)
        self._target_deg = math.copysign(self._velocity_limit_dps, velocity_dps)
        self._mode = _VELOCITY

    def quick_stop(self) -> None:
        """Brake with the rated acceleration and stay where that ends."""
        self._acceleration_dps2 = self.max_acceleration_dps2
        self._target_deg = 0.0
        self._mode = _VELOCITY

    def step(self, dt_s: float) -> None:
        """Let `dt_s` seconds pass."""
        if self._mode == _REST or dt_s <= 0.0:
            return
        before_dps = self._velocity_dps
        self._velocity_dps = velocity_dps = self._next_velocity_dps(dt_s)
        self._demand_deg += velocity_dps * dt_s
        self._follow(dt_s)
        if self._mode == _VELOCITY and not velocity_dps:
            self._demand_deg = self._motor_deg  # the brake holds what the motor has reached
        if velocity_dps:
            self._side = 1.0 if velocity_dps > 0.0 else -1.0
            self._ring_s = RING_END_S
            self._ring_deg = 0.0
        elif before_dps:
            self._ring_s = 0.0
            share = min(1.0, self._acceleration_dps2 / self.max_acceleration_dps2)
            self._ring_amplitude_deg = self._side * RING_AMPLITUDE_DEG * share
        self._ring(dt_s)
        self._place_load()
        arrived = self._mode == _VELOCITY or self._demand_deg == self._target_deg
        follows = self._motor_deg == self._demand_deg
        if not velocity_dps and arrived and follows and self._ring_s >= RING_END_S:
            self._mode = _REST

    def _limit(self, velocity: float | None, acceleration: float | None) -> None:
        rated = self.max_velocity_dps
        self._velocity_limit_dps = min(velocity, rated) if velocity is not None else rated
        rated = self.max_acceleration_dps2
        self._acceleration_dps2 = min(acceleration, rated) if acceleration else rated

    def _next_velocity_dps(self, dt_s: float) -> float:
        change_dps = self._acceleration_dps2 * dt_s
        if self._mode == _VELOCITY:
            wanted_dps = self._target_deg
        else:
            away_deg = self._target_deg - self._demand_deg
            distance_deg = abs(away_deg)
            if distance_deg < _ARRIVED_DEG and abs(self._velocity_dps) <= change_dps:
                self._demand_deg = self._target_deg
                return 0.0
            # n steps, each slower by one change, cover n v - n (n - 1)/2 changes: the least
            # n for the distance, and the v that ends on the target
            lengths = distance_deg / (change_dps * dt_s)
            steps = math.ceil((math.sqrt(1.0 + 8.0 * lengths) - 1.0) / 2.0 - 1e-9) or 1
            speed_dps = change_dps * (lengths / steps + (steps - 1) / 2.0)
            wanted_dps = math.copysign(min(self._velocity_limit_dps, speed_dps), away_deg)
        low_dps = self._velocity_dps - change_dps
        return min(max(wanted_dps, low_dps), low_dps + 2.0 * change_dps)

    def _follow(self, dt_s: float) -> None:
        low_deg, high_deg = self.travel_deg
        wanted_deg = self._demand_deg - LAG_S * self._velocity_dps
        wanted_deg = min(max(wanted_deg, low_deg), high_deg)
        if self.stall:
            reach_deg = (1.0 - self.stall) * TORQUE_RESERVE * self.max_velocity_dps * dt_s
            wanted_deg = min(
                max(wanted_deg, self._motor_deg - reach_deg), self._motor_deg + reach_deg
            )
        self._motor_deg = wanted_deg

    def _ring(self, dt_s: float) -> None:
        if self._ring_s >= RING_END_S:
            return
        self._ring_s += dt_s
        if self._ring_s >= RING_END_S:
            self._ring_deg = 0.0
            return
        phase_rad = 2.0 * math.pi * RING_FREQUENCY_HZ * self._ring_s
        decay = math.exp(-self._ring_s / RING_DECAY_S)
        self._ring_deg = self._ring_amplitude_deg * decay * math.sin(phase_rad)

    def _place_load(self) -> None:
        shown_deg = self._motor_deg + self._ring_deg
        error_deg = self._encoder.error_deg(shown_deg)
        self.angle_deg = shown_deg - error_deg - self._side * self._half_backlash_deg
