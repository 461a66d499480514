"""Heading from two magnetic axes: the third axis from the dip, the dip from known tilts.

In Cho & Park's symbols x and y are the normalised readings X, Y of the level turn times its
amplitude, theta is pitch, phi roll, psi the magnetic azimuth and lambda the (extended) dip.

References
----------
.. [1] S. Y. Cho and C. G. Park, "A Calibration Technique for a Two-Axis Magnetic Compass in
   Telematics Devices", ETRI Journal 27(3), 2005: Theorem 1 (10), Theorem 2 (24), Theorem 3 (26).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def estimated_z_mg(
    field_mg: ArrayLike,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
    *,
    horizontal_mg: ArrayLike,
    dip_deg: ArrayLike,
) -> NDArray[np.float64]:
    """Return the field along body z, shape (...), that x, y, attitude and dip leave (Theorem 1).

    z = (H tan(lambda) + x sin(theta) - y cos(theta) sin(phi)) / (cos(theta) cos(phi)): the
    vertical field is known, so one axis of three follows from the others [1]_ (10), (16).

    Parameters
    ----------
    field_mg : array-like, shape (..., 2 or more)
        Corrected field; only x and y count.
    pitch_deg, roll_deg : array-like, shape (...)
        Below 90 deg.
    horizontal_mg, dip_deg : array-like, shape (...)
        Horizontal field in the unit of `field_mg`, and dip.

    Examples
    --------
    >>> z_mg = estimated_z_mg([250.0, 0.0], 0.0, 0.0, horizontal_mg=250.0, dip_deg=60.0)
    >>> round(float(z_mg), 3)
    433.013
    """
    field = np.asarray(field_mg, dtype=float)
    pitch_rad, roll_rad = np.deg2rad(pitch_deg), np.deg2rad(roll_deg)
    down_mg = np.asarray(horizontal_mg, dtype=float) * np.tan(np.deg2rad(dip_deg))
    level = field[..., 0] * np.sin(pitch_rad) - field[..., 1] * np.cos(pitch_rad) * np.sin(roll_rad)
    return np.asarray((down_mg + level) / (np.cos(pitch_rad) * np.cos(roll_rad)))
