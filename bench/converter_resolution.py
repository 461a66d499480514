"""Which step a recorded sensor's converter had, found from the printed values.

A module sends int16 counts and one scale. A recording can be replayed without loss if its values
are multiples of one step and none is more than 32767 steps. Printed values are rounded to a
decimal (1/1090 G is printed 0.000917), so the step is found by a fit, not by a greatest divisor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

COUNTS_MAX: Final = 32767
"""Largest count that an int16 holds on both sides of zero."""
STEP_PER_QUANTUM_MIN: Final = 8
"""A step must be this many printed decimals wide to be told apart from their rounding."""
MANTISSAS: Final = (1.0, 2.0, 5.0, 10.0)
DECIMALS_MAX: Final = 9
SHORT: Final = 10_000
"""A step of at most four digits is printed exactly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """The step of one count, and the largest change that rounding to it makes."""

    step: float
    rounding: float

    def counts(self, values: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return values in counts."""
        return np.rint(values / self.step).astype(np.int64)


def find_resolution(values: NDArray[np.float64], decimals: int) -> Resolution:
    """Return the finest step that holds the values in int16 counts, exactly if there is one.

    In order: the converter's own step; the last printed decimal; the finest of 1, 2, 5 times a
    power of ten for which the largest value fits, which rounds the values.

    Parameters
    ----------
    values : ndarray, any shape
        Printed values of one sensor, all axes.
    decimals : int
        Decimals that they are printed with.
    """
    quantum = 10.0**-decimals
    peak = float(np.max(np.abs(values), initial=0.0))
    own = _lattice_step(values, quantum)
    for step in (own, quantum):
        if step is not None and peak / step <= COUNTS_MAX:
            return _resolution(values, step)
    return _resolution(values, _round_step(peak / COUNTS_MAX))


def _resolution(values: NDArray[np.float64], step: float) -> Resolution:
    rounding = float(np.max(np.abs(values - step * np.rint(values / step)), initial=0.0))
    return Resolution(step=step, rounding=rounding)


def _round_step(least: float) -> float:
    power = math.floor(math.log10(least))
    # Written as a decimal, so that 2e-2 is the double that is printed 0.02.
    candidates = (float(f"{mantissa:.0f}e{power}") for mantissa in MANTISSAS)
    return next(step for step in candidates if step >= least)


def _lattice_step(values: NDArray[np.float64], quantum: float) -> float | None:
    """Return the step of which all values are multiples within their printing, or None."""
    levels = np.unique(np.abs(values))
    if len(levels) < 3:
        return None
    spread = levels - levels[0]
    step = float(np.min(np.diff(levels)))
    if step < STEP_PER_QUANTUM_MIN * quantum:
        return None
    reach = 2.0
    while reach * step < 2.0 * spread[-1]:
        # Widened by doubling, so that the error of the step never grows to half a count.
        near = spread[spread <= reach * step]
        counts = np.rint(near / step)
        if counts.any():
            step = float(near @ counts / (counts @ counts))
        reach *= 2.0
    counts = np.rint(levels / step)
    step = float(levels @ counts / (counts @ counts))
    fits = np.max(np.abs(levels - step * np.rint(levels / step))) <= 0.525 * quantum
    return step if fits else None


def printed_decimals(step: float) -> int:
    """Return the decimals that tell counts apart: exact where the step is a short decimal.

    >>> printed_decimals(0.02), printed_decimals(1.0), printed_decimals(1.0 / 1.09)
    (2, 0, 4)
    """
    for decimals in range(DECIMALS_MAX + 1):
        scaled = step * 10.0**decimals
        if 1 <= round(scaled) < SHORT and abs(scaled - round(scaled)) < 1e-9 * scaled:
            return decimals
    return min(DECIMALS_MAX, max(0, math.ceil(-math.log10(step * 2e-4))))
