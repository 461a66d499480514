"""Heading error over the verification grid from the covariance of matrix and offset, batched.

An error dv of the corrected field, in the body, turns the heading by -(e . dv)/H with e the unit
vector east in the body and H the horizontal field. An error df of the specific force moves down
by dd = -df, which turns the heading by

    (e . dd)(tan(dip) + tan(pitch) cos(heading)) - (n . dd) tan(pitch) sin(heading)

with n the unit vector north in the body: derivatives at any attitude, in closed form.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.prediction import COVERAGE_FACTOR, grid_attitudes_deg
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from numpy.typing import NDArray

SMALLEST_HORIZONTAL: Final = 0.02
"""Horizontal part of the field below which a heading means nothing."""


@cache
def grid_axes() -> NDArray[np.float64]:
    """Return ned_from_body, shape (k, 3, 3), of the attitudes of the verification grid."""
    axes = ned_from_body(*grid_attitudes_deg().T)
    axes.setflags(write=False)
    return axes


def grid_field(
    axes: NDArray[np.float64], strength: NDArray[np.float64], sine: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the field in the body and the heading's derivative by it, both (..., k, 3).

    Parameters
    ----------
    axes : ndarray, shape (k, 3, 3)
    strength, sine : ndarray, shape (...)
        Field strength and sine of the dip; the derivative is in degrees per unit of strength.
    """
    cosine = np.sqrt(np.maximum(1.0 - sine**2, SMALLEST_HORIZONTAL**2))
    north, east, down = np.moveaxis(axes, -2, 0)
    vectors = cosine[..., None, None] * north + sine[..., None, None] * down
    gradient = -np.rad2deg(1.0 / (strength * cosine))[..., None, None] * east
    return strength[..., None, None] * vectors, gradient


def grid_force(
    axes: NDArray[np.float64], sine: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the force in the body and the heading's derivative by it (deg/g), (..., k, 3).

    Parameters
    ----------
    axes : ndarray, shape (k, 3, 3)
    sine : ndarray, shape (...)
        Sine of the dip.
    """
    north, east, down = np.moveaxis(axes, -2, 0)
    tangent = sine / np.sqrt(np.maximum(1.0 - sine**2, SMALLEST_HORIZONTAL**2))
    lean = -down[:, :1] / (1.0 - down[:, :1] ** 2)
    across = lean * (north[:, :1] * east - east[:, :1] * north)
    gradient = -np.rad2deg(tangent[..., None, None] * east + across)
    return np.broadcast_to(-down, gradient.shape), gradient


def correction_rows(
    field: NDArray[np.float64], gradient: NDArray[np.float64], matrix: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the heading's derivative, shape (..., k, 12), by M row by row and b.

    corrected = M (raw - b) with raw held, so that d(corrected) = dM (raw - b) - M db.

    Parameters
    ----------
    field, gradient : ndarray, shape (..., k, 3)
    matrix : ndarray, shape (..., 3, 3)
    """
    raw = field @ np.swapaxes(np.linalg.inv(matrix), -1, -2)
    by_matrix = gradient[..., :, None] * raw[..., None, :]
    flat = by_matrix.reshape(*by_matrix.shape[:-2], 9)
    return np.concatenate([flat, -gradient @ matrix], axis=-1)


def error_deg(
    rows: NDArray[np.float64], covariance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return RMS and worst standard deviation of the heading, both shape (...), in degrees.

    Parameters
    ----------
    rows : ndarray, shape (..., k, p)
        Derivative of the heading by the parameters.
    covariance : ndarray, shape (..., p, p)
    """
    variance = np.maximum(((rows @ covariance) * rows).sum(axis=-1), 0.0)
    return np.sqrt(variance.mean(axis=-1)), np.sqrt(variance.max(axis=-1))


def predicted_deg(
    rows: NDArray[np.float64], covariance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return predicted RMS and maximum, as `prediction.predicted_heading_deg` for one unit."""
    rms_deg, worst_deg = error_deg(rows, covariance)
    return rms_deg, COVERAGE_FACTOR * worst_deg
