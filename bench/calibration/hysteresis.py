"""The play of a bridge from a turn that goes both ways.

A film follows the field with a play: after the field has risen it reads its half width h too low,
after it has fallen h too high. At one heading the clockwise reading less the counter-clockwise one
is therefore -2 h where the field on the axis rises clockwise and +2 h where it falls, and whatever
belongs to the heading alone (field, iron, encoder, cross-axis term) cancels in the difference.
A stop that rings down takes a part of the play back: what is found is the lag that readings have,
at most the width of the film's own.

The play is not taken out of the readings. With 24 headings each way it is known to 0.05 mG, and
only the calibration could use it: the module does not know from where it came. Taking it out makes
the residual of the fit smaller and the headings worse, because the estimate's own error goes into
the coefficients; `benchmarks/bridge.py` prints both. It stays in the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

SMALLEST_PAIRS: Final = 8
SAME_HEADING_DEG: Final = 1.0
SMALLEST_SWING_MG: Final = 10.0
"""Amplitude over the turn below which the field does not pull an axis through its play."""
NEAR_EXTREME: Final = 0.25
"""Headings with less than this part of the steepest change are left out: the field turned about
there, and the play is not passed yet."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hysteresis:
    """Half width of the play of the x, y and z axis, shape (3,); NaN where it cannot be seen."""

    half_width_mg: NDArray[np.float64]
    sd_mg: NDArray[np.float64]


def hysteresis_of(
    field_mg: NDArray[np.float64],
    azimuth_deg: NDArray[np.float64],
    direction: NDArray[np.int_],
) -> Hysteresis:
    """Return the play by the readings of a turn at one tilt, taken clockwise and back.

    Parameters
    ----------
    field_mg : ndarray, shape (n, 3)
        (set - reset)/2.
    azimuth_deg : ndarray, shape (n,)
    direction : ndarray, shape (n,)
        From which side each heading was approached: 1 clockwise, -1 counter-clockwise.
    """
    up, down = _pairs(azimuth_deg, direction)
    half_width_mg, sd_mg = np.full(3, np.nan), np.full(3, np.nan)
    if len(up) < SMALLEST_PAIRS:
        return Hysteresis(half_width_mg=half_width_mg, sd_mg=sd_mg)
    rising = _rising(field_mg, azimuth_deg)
    for axis in range(3):
        passed = rising[up, axis] != 0.0
        difference_mg = (field_mg[up, axis] - field_mg[down, axis])[passed]
        sign = rising[up, axis][passed]
        if len(sign) >= SMALLEST_PAIRS and np.ptp(sign) > 0.0:
            half_width_mg[axis], sd_mg[axis] = _regressed(difference_mg, sign)
    return Hysteresis(half_width_mg=half_width_mg, sd_mg=sd_mg)


def _pairs(
    azimuth_deg: NDArray[np.float64], direction: NDArray[np.int_]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of clockwise readings and of their nearest counter-clockwise ones."""
    clockwise, counter = np.flatnonzero(direction > 0), np.flatnonzero(direction < 0)
    if not len(clockwise) or not len(counter):
        return clockwise[:0], counter[:0]
    apart_deg = np.abs(wrap_180_deg(azimuth_deg[clockwise][:, None] - azimuth_deg[counter]))
    nearest = np.argmin(apart_deg, axis=1)
    same = apart_deg[np.arange(len(clockwise)), nearest] < SAME_HEADING_DEG
    return clockwise[same], counter[nearest[same]]


def _rising(field_mg: NDArray[np.float64], azimuth_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return, shape (n, 3), whether the field rises (1) or falls (-1) clockwise; 0 near extremes.

    By the first harmonic of the readings themselves, so that soft iron shifts it as it should.
    """
    turn_rad = np.deg2rad(azimuth_deg)
    design = np.column_stack([np.ones_like(turn_rad), np.cos(turn_rad), np.sin(turn_rad)])
    _, cosine_mg, sine_mg = np.linalg.lstsq(design, field_mg, rcond=None)[0]
    slope_mg = np.outer(np.cos(turn_rad), sine_mg) - np.outer(np.sin(turn_rad), cosine_mg)
    amplitude_mg = np.hypot(cosine_mg, sine_mg)
    steep = np.abs(slope_mg) > NEAR_EXTREME * amplitude_mg
    return np.where(steep & (amplitude_mg > SMALLEST_SWING_MG), np.sign(slope_mg), 0.0)


def _regressed(
    difference_mg: NDArray[np.float64], sign: NDArray[np.float64]
) -> tuple[float, float]:
    """Return h and its standard deviation of differences -2 h sign + a drift between the turns."""
    design = np.column_stack([-2.0 * sign, np.ones_like(sign)])
    inverse = np.linalg.inv(design.T @ design)
    found = inverse @ design.T @ difference_mg
    residual_mg = difference_mg - design @ found
    variance = float(residual_mg @ residual_mg) / (len(sign) - 2)
    return float(found[0]), float(np.sqrt(variance * inverse[0, 0]))
