"""What the module's microcontroller computes and remembers, in single precision.

Heading as in Cho & Park (21): level the field with the attitude that the accelerometer
shows, then atan2. Written from the paper and apart from the bench's own computation, which
uses double precision and another form; each checks the other. The module with two axes has
a formula of its own in `devices.two_axis`.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

import numpy as np

from devices.crossed_field import CrossedField
from devices.two_axis import TwoAxisFormula, completed
from protocols import compass, uds
from protocols.errors import FrameError

if TYPE_CHECKING:
    from devices.coefficient_store import CoefficientStore
    from devices.replay import ReplaySensors
    from protocols.uds import Coefficients

logger = logging.getLogger(f"compassbench.{__name__}")

Counts = tuple[int, int, int]

LEAST_FORCE_G: Final = 0.5
"""Below this specific force there is no attitude to level with."""
LEAST_PULSE_MA: Final = 50
"""Below this strap current the firmware reports the strap (DTC_STRAP)."""

_F32 = np.float32
_DEG: Final = _F32(180.0 / math.pi)
_LEAST_SQUARED: Final = _F32(LEAST_FORCE_G**2)


class SensorSource(Protocol):
    """What the firmware reads: a sensor model or a recording."""

    pulse_current_ma: float
    temperature_c: float
    supply_v: float

    def sample(self, t_s: float) -> tuple[Counts, Counts, Counts] | None:
        """Return set, reset and acceleration readings in counts; None when there are no more."""
        ...

    def pulse(self, current_ma: float) -> None:
        """Send one set and one reset pulse through the straps."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Converters:
    """Scales and range of the module's converters."""

    mag_mg_per_count: float = compass.MAG_MG_PER_COUNT
    accel_g_per_count: float = compass.ACCEL_G_PER_COUNT
    mag_count_limit: int = compass.MAG_COUNT_LIMIT


_BEYOND: Final[Any] = {"over": "ignore", "invalid": "ignore"}
"""Finite coefficients whose products are none leave no heading; the module goes on."""


class Cycle(NamedTuple):
    """One measuring cycle: readings in counts, attitude and heading in degrees."""

    set_counts: Counts
    reset_counts: Counts
    accel_counts: Counts
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    quality: int


class HeadingFormula:
    """Coefficients folded with the converters' scales: float32, one product a cycle."""

    def __init__(self, coefficients: Coefficients, converters: Converters) -> None:
        self._crossed = CrossedField(coefficients, converters)
        matrix = np.zeros((6, 6))
        matrix[:3, :3] = np.reshape(coefficients.mag_matrix, (3, 3))
        matrix[3:, 3:] = np.reshape(coefficients.accel_matrix, (3, 3))
        offset = np.array((*coefficients.mag_offset_mg, *coefficients.accel_offset_g))
        scale = np.repeat((converters.mag_mg_per_count / 2.0, converters.accel_g_per_count), 3)
        self._bias = (matrix @ offset).astype(_F32)
        self._matrix = (matrix * scale).astype(_F32)

    def solve(
        self, difference_counts: Counts, accel_counts: Counts
    ) -> tuple[float, float, float] | None:
        """Return heading, pitch and roll in degrees, or None without an attitude.

        Parameters
        ----------
        difference_counts : tuple of int
            Set minus reset, three axes, in counts.
        accel_counts : tuple of int
            Specific force in counts.
        """
        raw = self._crossed.taken_out(np.array(difference_counts + accel_counts, dtype=_F32))
        mx, my, mz, fx, fy, fz = self._matrix @ raw - self._bias
        across = fy * fy + fz * fz
        squared = fx * fx + across
        if squared < _LEAST_SQUARED or across == 0.0:
            return None
        east = np.sqrt(squared) * (my * fz - mz * fy)
        north = mx * across - fx * (my * fy + mz * fz)
        above = np.array((east, fx, -fy))
        below = np.array((north, np.sqrt(across), -fz))
        heading, pitch, roll = (np.arctan2(above, below) * _DEG).tolist()
        return heading % 360.0, pitch, roll


class Firmware:
    """State of the module between two resets, and what survives them.

    Parameters
    ----------
    serial : str
        Serial number of the unit.
    sensors : SensorSource
        What is measured.
    store : CoefficientStore
        Non-volatile memory.
    converters : Converters
        Scales of the counts that `sensors` gives.
    replay : ReplaySensors, optional
        Given when `sensors` is a recording: its flags go into the status frame.
    part : str
        Part number: whether the heading takes three axes or two.

    Attributes
    ----------
    lost_write : float
        Probability that a bank reaches only the write buffer (fault `lost_write`).
    trouble_codes : set of int
        DTCs present; they survive a reset of the module, not a power cycle.
    """

    HARDWARE_VERSION: Final = "1.0"
    FIRMWARE_VERSION: Final = "1.0.0"

    def __init__(
        self,
        serial: str,
        sensors: SensorSource,
        store: CoefficientStore,
        rng: np.random.Generator,
        *,
        converters: Converters | None = None,
        replay: ReplaySensors | None = None,
        part: str = compass.PART_THREE_AXIS,
    ) -> None:
        self.serial = serial
        self.part = part
        self.two_axis = part == compass.PART_TWO_AXIS
        self.sensors = sensors
        self.store = store
        self.rng = rng
        self.converters = converters or Converters()
        self.lost_write = 0.0
        self.trouble_codes: set[int] = set()
        self._replay = replay
        self._level: Counts = (0, 0, -round(1.0 / self.converters.accel_g_per_count))

    def boot(self) -> None:
        """Read the non-volatile memory and start with the coefficients found there."""
        store = self.store
        try:
            store.boot()
        except OSError as error:
            logger.warning("the non-volatile memory cannot be written: %s", error)
            self.trouble_codes.add(uds.DTC_COEFFICIENTS_LOST)
        if store.lost:
            self.trouble_codes.add(uds.DTC_COEFFICIENTS_LOST)
        if self._replay is not None:
            self._replay.restart()
        self.coefficients = store.active
        self.sample_period_ticks = 1
        self.saturated = False
        self.last_cycle: Cycle | None = None
        self._buffered: bytes | None = None
        whole = store.calibrated and self.two_axis == (store.active.horizontal_mg > 0.0)
        self._quality = compass.QUALITY_CALIBRATED if whole else compass.QUALITY_UNCALIBRATED
        formula = TwoAxisFormula if self.two_axis else HeadingFormula
        with np.errstate(**_BEYOND):
            self._solve = formula(store.active, self.converters).solve

    @property
    def flags(self) -> int:
        """Flags of the status frame."""
        flags = 0 if self._replay is None else self._replay.flags
        if self.saturated:
            flags |= compass.FLAG_SATURATED
        if not self.store.calibrated:
            flags |= compass.FLAG_DEFAULT_COEFFICIENTS
        if self.two_axis:
            flags |= compass.FLAG_TWO_AXIS
        return flags

    def cycle(self, t_s: float) -> Cycle | None:
        """Measure once, set and reset, and compute the heading; None if nothing is measured."""
        readings = self.sensors.sample(t_s)
        if readings is None:
            return None
        set_counts, reset_counts, accel_counts = readings
        if self.two_axis:
            accel_counts = completed(accel_counts, self.converters.accel_g_per_count)
        sx, sy, sz = set_counts
        rx, ry, rz = reset_counts
        limit = self.converters.mag_count_limit
        self.saturated = saturated = (
            max(sx, sy, sz, rx, ry, rz) >= limit or min(sx, sy, sz, rx, ry, rz) <= -limit
        )
        force = accel_counts
        if self._replay is not None and self._replay.flags & compass.FLAG_NO_ACCELERATION:
            force = self._level
        quality = self._quality
        with np.errstate(**_BEYOND):
            solution = self._solve((sx - rx, sy - ry, sz - rz), force)
        if solution is not None and not all(map(math.isfinite, solution)):
            solution = None
        if saturated:
            self.trouble_codes.add(uds.DTC_SATURATED)
        if solution is None or saturated:
            quality = compass.QUALITY_UNUSABLE
        heading, pitch, roll = solution or (0.0, 0.0, 0.0)
        cycle = Cycle(set_counts, reset_counts, accel_counts, heading, pitch, roll, quality)
        self.last_cycle = cycle
        return cycle

    def stage(self, bank: bytes) -> None:
        """Write a bank beside the one in use; see `CoefficientStore.stage`.

        Raises
        ------
        FrameError
            If the bank is not sound, or is for two axes where the module has three.
        """
        coefficients = uds.unpack_coefficients(bank)
        if coefficients.horizontal_mg and not self.two_axis:
            sentence = f"{self.part} has three axes; the coefficient bank is for two"
            raise FrameError(sentence)
        if self.lost_write and self.rng.random() < self.lost_write:
            self._buffered = bank
            return
        self._buffered = None
        self.store.stage(bank)

    def staged(self) -> bytes | None:
        """Return the staged bank; a lost one is still seen in the write buffer."""
        return self._buffered or self.store.staged()

    def commit(self) -> bool:
        """Make the staged bank the one of the next boot; False if there is none."""
        if self._buffered is not None:
            return True
        return self.store.commit()

    def rollback(self) -> None:
        """Drop the staged bank and undo a commit that no reset has followed."""
        self._buffered = None
        self.store.rollback()

    def set_pulse_current(self, current_ma: float) -> None:
        """Use another strap current in every cycle."""
        self.sensors.pulse_current_ma = current_ma
        if current_ma < LEAST_PULSE_MA:
            self.trouble_codes.add(uds.DTC_STRAP)
