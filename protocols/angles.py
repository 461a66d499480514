"""Wrapping of angles. Headings are degrees clockwise from magnetic north in [0, 360)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def wrap_360_deg(angle_deg: ArrayLike) -> NDArray[np.float64]:
    """Return angles in [0, 360) degrees.

    >>> float(wrap_360_deg(-90.0))
    270.0
    >>> float(wrap_360_deg(-1e-15))
    0.0
    """
    wrapped = np.mod(np.asarray(angle_deg, dtype=float), 360.0)
    return np.where(wrapped >= 360.0, 0.0, wrapped)


def wrap_180_deg(angle_deg: ArrayLike) -> NDArray[np.float64]:
    """Return differences of angles in (-180, 180] degrees.

    >>> float(wrap_180_deg(190.0)), float(wrap_180_deg(-180.0))
    (-170.0, 180.0)
    """
    return 180.0 - np.mod(180.0 - np.asarray(angle_deg, dtype=float), 360.0)


def circular_mean_deg(angle_deg: ArrayLike) -> float:
    """Return the circular mean of headings in [0, 360) degrees.

    >>> circular_mean_deg([359.0, 1.0]) % 360.0 < 1e-9 or circular_mean_deg([359.0, 1.0]) > 359.999
    True
    """
    angle_rad = np.deg2rad(np.asarray(angle_deg, dtype=float))
    mean_rad = math.atan2(float(np.sin(angle_rad).mean()), float(np.cos(angle_rad).mean()))
    return float(wrap_360_deg(math.degrees(mean_rad)))
