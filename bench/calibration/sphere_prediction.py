"""Heading error to expect of offset and symmetric matrix, many units at once.

The heading's variance at an attitude is a quadratic form of the covariance. Its mean over the
verification grid is that of one form whatever the unit: with dM M^-1 and M db for parameters,
what the heading sees of them does not depend on the unit.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.grid_error import correction_rows, grid_axes, grid_field, predicted_deg
from bench.calibration.sphere_minimum import covariance_of
from bench.calibration.sphere_model import folded, symmetric

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.least_squares import Minimum, Rows

DEFAULT_SINE: Final = float(np.sin(np.deg2rad(60.0)))
"""Sine of the dip that predictions assume where the station's is not given."""
PESSIMISM: Final = 5.0
"""Standard deviations by which the estimate may be off in `understatement`."""


def predicted_at(
    strength: NDArray[np.float64],
    sine: NDArray[np.float64],
    matrix: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return predicted RMS and maximum (deg), shape (b,), in a field of a strength and dip.

    Parameters
    ----------
    strength, sine : ndarray, shape (b,)
        Field strength and sine of the dip.
    matrix, covariance : ndarray, shape (b, 3, 3) and (b, 9, 9)
    """
    rows = correction_rows(*grid_field(grid_axes(), strength, sine), matrix)
    rows = np.concatenate([folded(rows[..., :9]), rows[..., 9:]], axis=-1)
    return predicted_deg(rows, covariance)


def predicted_rms_deg(
    sine: float,
    matrix: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the predicted RMS (deg), shape (b,), in a field of strength one, as `predicted_at`.

    Parameters
    ----------
    sine : float
        Of the dip.
    matrix, covariance : ndarray, shape (b, 3, 3) and (b, 9, 9)
    """
    both = np.concatenate([np.linalg.inv(matrix), matrix], axis=1).reshape(-1, 18)
    rows = (both @ _grid_form(sine)).reshape(-1, 12, 9)
    variance = np.einsum("bij,bij->b", rows @ covariance, rows)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


@lru_cache(maxsize=64)
def _grid_form(sine: float) -> NDArray[np.float64]:
    """Return what makes of M^-1 and M twelve rows that stand for those of all attitudes."""
    field, gradient = grid_field(grid_axes(), np.array(1.0), np.array(sine))
    by_turn = (gradient[:, :, None] * field[:, None, :]).reshape(-1, 9)
    rows = np.concatenate([by_turn, -gradient], axis=1) / np.sqrt(len(field))
    root = np.asarray(np.linalg.qr(rows)[1])
    turn, shift = root[:, :9].reshape(12, 3, 3), root[:, 9:]
    form = np.zeros((18, 12, 9))
    elements = symmetric(np.eye(6))
    form[:9, :, :6] = np.einsum("rij,eik->kjre", turn, elements).reshape(9, 12, 6)
    form[9:, :, 6:] = np.einsum("ri,jm->ijrm", shift, np.eye(3)).reshape(9, 12, 3)
    form.setflags(write=False)
    return form.reshape(18, 108)


def understatement(rows: Rows, best: Minimum, units: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return by which factor the prediction could be too small, shape (b,), for some units.

    Where the readings are weak the prediction depends on the estimate's own error: it is
    evaluated one standard deviation to either side along the weakest direction, and continued
    in equal ratios to five.
    """
    normal = best.normal[units]
    scale = np.sqrt(np.diagonal(normal, axis1=1, axis2=2))
    values, vectors = np.linalg.eigh(normal / (scale[:, :, None] * scale[:, None, :]))
    shift = vectors[:, :, 0] / np.sqrt(np.maximum(values[:, :1], 1e-12)) / scale

    def predicted(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        jacobian = rows(parameters, units)[1]
        covariance = covariance_of(np.swapaxes(jacobian, 1, 2) @ jacobian)
        strength, sine = np.ones(len(units)), np.full(len(units), DEFAULT_SINE)
        return predicted_at(strength, sine, symmetric(parameters[:, :6]), covariance)[0]

    here = predicted(best.parameters[units])
    beside = [predicted(best.parameters[units] + sign * shift) for sign in (1.0, -1.0)]
    return np.asarray((np.maximum(*beside) / here) ** PESSIMISM)
