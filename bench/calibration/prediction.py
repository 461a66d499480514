"""Heading error to expect from the covariance of coefficients, before any verification.

The mean square heading error over a set of attitudes is tr(A Cov), with A the mean of the
outer products of the heading's derivative by the coefficients (Cramer-Rao bound carried to
the heading). It holds what the coefficients' uncertainty costs: not the noise of the reading
that is corrected, nor drift between fit and use.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.tilt import ned_from_body, tilt_compensated_heading_deg
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

COVERAGE_FACTOR: Final = 2.0
"""Predicted maximum = this many standard deviations at the worst attitude of the grid."""
GRID_TILT_DEG: Final = 30.0
DEFAULT_FIELD_MG: Final = np.array([250.0, 0.0, 250.0 * np.tan(np.deg2rad(60.0))])
"""Field assumed where the station's is not given: horizontal 250 mG, dip 60 deg."""
DOWN: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeadingGrid:
    """Field and specific force in the body over the attitudes that acceptance covers.

    Attributes
    ----------
    field_mg, force_g : ndarray, shape (n, 3)
        In the body frame.
    field_gradient_deg, force_gradient_deg : ndarray, shape (n, 3)
        Derivative of the heading by corrected field (deg/mG) and corrected force (deg/g).
    """

    field_mg: NDArray[np.float64]
    force_g: NDArray[np.float64]
    field_gradient_deg: NDArray[np.float64]
    force_gradient_deg: NDArray[np.float64]


def grid_attitudes_deg(*, level_only: bool = False) -> NDArray[np.float64]:
    """Return attitudes, shape (n, 3), columns azimuth, pitch, roll in degrees.

    24 headings level, and 24 at each of pitch and roll of +-30 deg unless `level_only`.

    >>> grid_attitudes_deg().shape, grid_attitudes_deg(level_only=True).shape
    ((120, 3), (24, 3))
    """
    tilt = GRID_TILT_DEG
    level = ((0.0, 0.0),)
    tilts = level if level_only else (*level, (tilt, 0.0), (-tilt, 0.0), (0.0, tilt), (0.0, -tilt))
    headings = np.arange(0.0, 360.0, 15.0)
    return np.array([(heading, pitch, roll) for pitch, roll in tilts for heading in headings])


def heading_gradients_deg(
    field_mg: NDArray[np.float64], force_g: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the heading's derivative by field (deg/mG) and by force (deg/g), each (n, 3).

    Central differences of the tilt-compensated heading, which is smooth at all tilts used.
    """
    step = 1e-5
    gradients = []
    for which, scale in ((0, float(np.linalg.norm(field_mg, axis=-1).mean())), (1, 1.0)):
        columns = []
        for axis in range(3):
            change = np.zeros(3)
            change[axis] = step * scale
            high = [field_mg, force_g]
            low = [field_mg, force_g]
            high[which] = high[which] + change
            low[which] = low[which] - change
            higher_deg, lower_deg = (tilt_compensated_heading_deg(*pair) for pair in (high, low))
            difference = wrap_180_deg(higher_deg - lower_deg)
            columns.append(difference / (2.0 * step * scale))
        gradients.append(np.stack(columns, axis=-1))
    return gradients[0], gradients[1]


def heading_grid(field_ned_mg: NDArray[np.float64] | None = None) -> HeadingGrid:
    """Return the acceptance grid in a field given in NED, shape (3,)."""
    ned_mg = DEFAULT_FIELD_MG if field_ned_mg is None else np.asarray(field_ned_mg, dtype=float)
    rotations = ned_from_body(*grid_attitudes_deg().T)
    field_mg = np.einsum("nji,j->ni", rotations, ned_mg)
    force_g = np.einsum("nji,j->ni", rotations, -DOWN)
    field_gradient, force_gradient = heading_gradients_deg(field_mg, force_g)
    return HeadingGrid(
        field_mg=field_mg,
        force_g=force_g,
        field_gradient_deg=field_gradient,
        force_gradient_deg=force_gradient,
    )


def model_jacobian(
    gradient: NDArray[np.float64], vectors: NDArray[np.float64], sensor: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the heading's derivative, shape (n, 12), by the coefficients of raw = W v + b.

    With corrected = W^-1 (raw - b) and raw held, d(corrected) = -W^-1 (dW v + db).

    Parameters
    ----------
    gradient : ndarray, shape (n, 3)
        Heading's derivative by the corrected vector.
    vectors : ndarray, shape (n, 3)
        True vectors v in the body.
    sensor : ndarray, shape (3, 3)
        W; the 12 columns are W row by row, then b.
    """
    back = -np.linalg.solve(sensor.T, gradient.T).T
    by_matrix = back[:, :, None] * vectors[:, None, :]
    return np.concatenate([by_matrix.reshape(len(vectors), 9), back], axis=1)


def predicted_heading_deg(
    jacobian: NDArray[np.float64], covariance: NDArray[np.float64]
) -> tuple[float, float]:
    """Return (RMS, maximum) of the heading error in degrees that the covariance predicts.

    RMS = sqrt(tr(A Cov)) over the grid; the maximum is two standard deviations at the worst
    attitude.

    >>> predicted_heading_deg(np.array([[1.0], [2.0]]), np.array([[0.01]]))
    (0.15811388300841897, 0.4)
    """
    variance = np.maximum(np.einsum("ni,ij,nj->n", jacobian, covariance, jacobian), 0.0)
    return float(np.sqrt(variance.mean())), COVERAGE_FACTOR * float(np.sqrt(variance.max()))
