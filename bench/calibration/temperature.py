"""What a run tells of temperature coefficients, from readings that warm up with the module.

A module warms by tenths of a degree in a run, and time passes meanwhile: whatever else changes
slowly looks like a temperature coefficient. So the standard deviations here are made of the
scatter of a few long blocks of readings, as 1/f noise demands, and of what is known to change
besides: the site's field, the wander of the accelerometer's zero.

- Bridge offset: cancels in half the difference of a pair.
- Sensitivity: common to the axes to a tenth (one chip, one supply), so that it cancels in the
  heading of three axes; the module has no coefficient for it.
- Accelerometer: does not cancel. Its wander over a run is of the size of its drift, so that a run
  cannot tell them apart, and the module has no coefficient for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.crossed_field import CROSS_AXIS

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCKS: Final = 6
SLOW_NOISE: Final = 2.0**0.5
"""1/f noise has as much power along a slow change as beside it, and only the latter is left in the
residual."""
SMALLEST_READINGS: Final = 24
SMALLEST_CHANGE_C: Final = 0.03
WANDER_G: Final = 0.0003
"""Standard deviation of the wander of an accelerometer's zero in 100 s."""
WANDER_S: Final = 100.0
"""Time over which the wander of a zero is stated, here and in the data of parts."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tempco:
    """Change by one degree and its standard deviation, shape (k,); NaN where it cannot be seen."""

    per_c: NDArray[np.float64]
    sd_per_c: NDArray[np.float64]


def offset_tempco_mg_per_c(
    field_mg: NDArray[np.float64],
    offset_mg: NDArray[np.float64],
    temperature_c: NDArray[np.float64],
) -> Tempco:
    """Return that of the bridge offsets x, y, z, beside the cross-axis term and the gains'.

    Parameters
    ----------
    field_mg, offset_mg : ndarray, shape (n, 3)
        Half the difference and half the sum of the pairs, in the order in which they were read.
    temperature_c : ndarray, shape (n,)
    """
    found = [
        _tempco(
            offset_mg[:, axis],
            temperature_c,
            (field_mg[:, axis] * field_mg[:, across], field_mg[:, axis]),
        )
        for axis, across in enumerate(CROSS_AXIS)
    ]
    return _joined(found)


def sensitivity_tempco_per_c(
    strength: NDArray[np.float64], temperature_c: NDArray[np.float64], drift_sd: float = 0.0
) -> Tempco:
    """Return the common one of the three axes, shape (1,), relative.

    Parameters
    ----------
    strength : ndarray, shape (n,)
        Strength of the corrected field over the station's.
    drift_sd : float
        Standard deviation of the station's field over the run, relative.
    """
    return _joined([_tempco(strength, temperature_c, changed_sd=drift_sd)])


def accel_drift_g_per_c(
    left_g: NDArray[np.float64], temperature_c: NDArray[np.float64], t_s: NDArray[np.float64]
) -> Tempco:
    """Return that of the accelerometer's zeros x, y, z.

    Parameters
    ----------
    left_g : ndarray, shape (n, 3)
        Corrected force less that of the rig's attitude.
    t_s : ndarray, shape (n,)
        Times, over which the zeros wander besides.
    """
    wander_g = WANDER_G * float(np.sqrt(np.ptp(t_s) / WANDER_S)) if len(t_s) else 0.0
    found = [_tempco(left_g[:, axis], temperature_c, changed_sd=wander_g) for axis in range(3)]
    return _joined(found)


def _joined(found: list[tuple[float, float]]) -> Tempco:
    per_c, sd_per_c = np.array(found).T
    return Tempco(per_c=per_c, sd_per_c=sd_per_c)


def _tempco(
    values: NDArray[np.float64],
    temperature_c: NDArray[np.float64],
    others: tuple[NDArray[np.float64], ...] = (),
    *,
    changed_sd: float = 0.0,
) -> tuple[float, float]:
    """Return slope and standard deviation of values, shape (n,), beside columns that explain them.

    Parameters
    ----------
    changed_sd : float
        What the values may have changed by from the first to the last for other reasons.
    """
    if len(values) < SMALLEST_READINGS or np.ptp(temperature_c) < SMALLEST_CHANGE_C:
        return float("nan"), float("nan")
    warm_c = temperature_c - temperature_c.mean()
    columns = np.column_stack([np.ones_like(warm_c), warm_c, *others])
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    found = np.linalg.lstsq(columns / scale, values, rcond=1e-9)[0] / scale
    left = values - columns @ found + warm_c * found[1]
    blocks = [np.array_split(column, BLOCKS) for column in (left, warm_c)]
    left_mean, warm_mean = (np.array([block.mean() for block in column]) for column in blocks)
    warm_mean = warm_mean - warm_mean.mean()
    power = float(warm_mean @ warm_mean)
    slope = float(warm_mean @ left_mean) / power
    scatter = left_mean - left_mean.mean() - slope * warm_mean
    variance = SLOW_NOISE**2 * float(scatter @ scatter) / (BLOCKS - 2) / power
    return slope, float(np.sqrt(variance + (changed_sd / np.ptp(temperature_c)) ** 2))
