"""Heading error to expect of a module with two magnetic axes, from its fit's covariance.

As `prediction`, with what two axes add: an error of x or y returns through the estimated z, and so
do the extended dip angle and the tilt, which comes from two axes of force.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.prediction import heading_grid, model_jacobian
from bench.calibration.tilt import heading_deg, two_axis_attitude_deg
from bench.calibration.two_axis import estimated_z_mg
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import Fit
    from bench.calibration.level_kernel import LevelFits

STEP: Final = 1e-5


def two_axis_heading_deg(
    field_mg: NDArray[np.float64],
    accel_g: NDArray[np.float64],
    *,
    horizontal_mg: float,
    dip_deg: NDArray[np.float64] | float,
) -> NDArray[np.float64]:
    """Return headings in [0, 360), shape (...), of corrected x, y of field and force (Theorem 2).

    Parameters
    ----------
    field_mg, accel_g : ndarray, shape (..., 2 or more)
        Corrected; only x and y count.
    horizontal_mg, dip_deg : float
        Horizontal field and extended dip angle.
    """
    pitch_deg, roll_deg = two_axis_attitude_deg(accel_g)
    z_mg = estimated_z_mg(
        field_mg, pitch_deg, roll_deg, horizontal_mg=horizontal_mg, dip_deg=dip_deg
    )
    field = np.concatenate([field_mg[..., :2], z_mg[..., None]], axis=-1)
    return heading_deg(field, pitch_deg, roll_deg)


def two_axis_jacobians(
    turn: LevelFits, slopes: NDArray[np.float64], dip_deg: float, tilt: Fit
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the heading's derivatives by the turn and the dip, and by the accelerometer.

    Over 24 headings level and at +-30 deg of pitch and of roll.

    Parameters
    ----------
    turn : LevelFits
        Of one unit.
    slopes : ndarray, shape (p, 2, 2)
        Derivative of its matrix by its parameters, of which the first two are the offset's.
    dip_deg : float
        Extended dip angle.
    tilt : Fit
        Accelerometer's; where it was refused its part is not in the result.

    Returns
    -------
    tuple of ndarray, shapes (120, p + 1) and (120, 12 or 0)
        In degrees by each parameter; the dip, last of the first, in degrees per degree.
    """
    horizontal_mg = float(turn.horizontal_mg)
    down_mg = horizontal_mg * np.tan(np.deg2rad(dip_deg))
    grid = heading_grid(np.array([horizontal_mg, 0.0, down_mg]))
    gradient = _gradients_deg(grid.field_mg, grid.force_g, horizontal_mg, dip_deg)
    centred = np.linalg.solve(turn.matrix, grid.field_mg[:, :2].T).T
    by_turn = np.einsum("ni,pij,nj->np", gradient[:, :2], slopes, centred)
    by_turn[:, :2] -= gradient[:, :2] @ turn.matrix
    own = np.column_stack([by_turn, gradient[:, 4]])
    if tilt.accel_matrix is None:
        return own, np.zeros((len(own), 0))
    by_force = np.column_stack([gradient[:, 2:4], np.zeros(len(own))])
    gain = np.array(np.linalg.inv(tilt.accel_matrix), dtype=float)
    return own, model_jacobian(by_force, grid.force_g, gain)


def _gradients_deg(
    field_mg: NDArray[np.float64],
    force_g: NDArray[np.float64],
    horizontal_mg: float,
    dip_deg: float,
) -> NDArray[np.float64]:
    """Return the heading's derivative, shape (n, 5), by x, y, force x, force y and the dip."""
    inputs = np.column_stack([field_mg[:, :2], force_g[:, :2], np.full(len(field_mg), dip_deg)])
    columns = []
    for column, scale in enumerate((horizontal_mg, horizontal_mg, 1.0, 1.0, 1.0)):
        headings = []
        for sign in (1.0, -1.0):
            moved = inputs.copy()
            moved[:, column] += sign * STEP * scale
            headings.append(
                two_axis_heading_deg(
                    moved[:, :2], moved[:, 2:4], horizontal_mg=horizontal_mg, dip_deg=moved[:, 4]
                )
            )
        columns.append(wrap_180_deg(headings[0] - headings[1]) / (2.0 * STEP * scale))
    return np.stack(columns, axis=-1)
