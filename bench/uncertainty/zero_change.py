"""How far the accelerometer's zero moves from the calibration to the verification.

The coefficients hold the zero that it had on average in the calibration. What it moves on to the
verification is the same at all poses there, and no residual of the calibration shows it: it is
known from the part's data, the times of the poses and the module's thermometer.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.temperature import WANDER_S

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.uncertainty.unit_data import UnitData


def zero_change_g(before: NDArray[np.void], after: NDArray[np.void], unit: UnitData) -> float:
    """Return the standard deviation, each axis, of the change of the zero's mean, in g.

    Parameters
    ----------
    before, after : ndarray of READING, shape (m,) and (n,)
        Poses of the calibration and of the verification; times and temperatures count. Without
        either 0.
    unit : UnitData
        Random walk of the zero, and its largest tempco (rectangular, limit/sqrt(3)).
    """
    if not len(before) or not len(after):
        return 0.0
    warmer_c = float(after["temperature_c"].mean() - before["temperature_c"].mean())
    tempco_g = unit.accel_tempco_g_per_c / math.sqrt(3.0) * warmer_c
    return math.hypot(tempco_g, unit.accel_wander_g * _walked(before["t_s"], after["t_s"]))


def _walked(before_s: NDArray[np.float64], after_s: NDArray[np.float64]) -> float:
    """Return the standard deviation of the difference of two means of a walk of 1 in 100 s.

    Each step of the walk counts with the weight of all the poses that come after it.
    """
    t_s = np.concatenate([before_s, after_s])
    weight = np.repeat([-1.0 / len(before_s), 1.0 / len(after_s)], [len(before_s), len(after_s)])
    order = np.argsort(t_s, kind="stable")
    later = np.cumsum(weight[order][::-1])[::-1][1:]
    return float(np.sqrt(np.sum(later**2 * np.diff(t_s[order])) / WANDER_S))
