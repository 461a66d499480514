"""Nonlinear least squares of many units at once: Levenberg-Marquardt without a loop over units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

ITERATIONS: Final = 60
SMALLEST_STEP: Final = 1e-6
"""Squared length of a step in standard deviations below which the minimum is reached."""
NOISE_FLOOR: Final = 1e-8
"""The same for readings without noise: the least mean square residual that steps refer to."""
RIDGE: Final = 1e-14
FIRST_DAMPING: Final = 1e-3
LEAST_DAMPING: Final = 1e-6
LARGEST_DAMPING: Final = 1e9
RANK: Final = 1e-5
"""Smallest to largest singular value of the scaled Jacobian from which a direction counts."""


class Rows(Protocol):
    """Whitened residuals and their derivatives at given parameters of some of the units."""

    def __call__(
        self, parameters: NDArray[np.float64], units: NDArray[np.intp]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals (b, m) and Jacobian (b, m, p) at parameters (b, p) of units (b,)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Minimum:
    """Where the iteration ended, unit by unit.

    Attributes
    ----------
    parameters : ndarray, shape (b, p)
    normal : ndarray, shape (b, p, p)
        J^T J at the end: the inverse of the covariance where residuals are whitened.
    chi2 : ndarray, shape (b,)
        Sum of squared residuals.
    converged : ndarray of bool, shape (b,)
    """

    parameters: NDArray[np.float64]
    normal: NDArray[np.float64]
    chi2: NDArray[np.float64]
    converged: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inverse:
    """Inverse of normal matrices with rank and condition of the column-scaled Jacobian.

    Attributes
    ----------
    covariance : ndarray, shape (..., p, p)
        Without the directions that are not determined.
    rank : ndarray of int, shape (...)
    condition : ndarray, shape (...)
    """

    covariance: NDArray[np.float64]
    rank: NDArray[np.intp]
    condition: NDArray[np.float64]


def minimised(rows: Rows, start: NDArray[np.float64]) -> Minimum:
    """Return the least squares minimum of every unit from its start, shape (b, p).

    Steps are Gauss-Newton; a unit whose residual would grow is damped in the scaled parameters
    until it shrinks. A unit is done when its step is far below its own standard deviation.

    Examples
    --------
    >>> def rows(parameters, units):
    ...     return parameters**2 - np.array([4.0, 9.0]), parameters[:, :, None] * 2.0 * np.eye(2)
    >>> minimised(rows, np.array([[1.0, 1.0]])).parameters.round(9).tolist()
    [[2.0, 3.0]]
    """
    parameters = np.array(start, dtype=float)
    active = np.arange(len(parameters))
    normal, slope, chi2, equations = _normal(rows, parameters, active)
    damping = np.zeros(len(parameters))
    converged = np.zeros(len(parameters), dtype=bool)
    for _ in range(ITERATIONS):
        step, size = _step(normal[active], slope[active], damping[active])
        trial = parameters[active] + step
        new_normal, new_slope, new_chi2, _ = _normal(rows, trial, active)
        old_chi2 = chi2[active]
        better = new_chi2 <= old_chi2
        small = size < SMALLEST_STEP * np.maximum(old_chi2 / equations, NOISE_FLOOR)
        kept = active[better]
        parameters[kept], chi2[kept] = trial[better], new_chi2[better]
        normal[kept], slope[kept] = new_normal[better], new_slope[better]
        done = small & (damping[active] <= LEAST_DAMPING)
        converged[active[done]] = True
        damping[active] = _damped(damping[active], better)
        active = active[~done & (damping[active] <= LARGEST_DAMPING)]
        if not len(active):
            break
    return Minimum(parameters=parameters, normal=normal, chi2=chi2, converged=converged)


def _normal(
    rows: Rows, parameters: NDArray[np.float64], units: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], int]:
    with np.errstate(over="ignore", invalid="ignore"):  # a trial step too far is not taken
        residual, jacobian = rows(parameters, units)
        turned = np.swapaxes(jacobian, -1, -2)
        slope = (turned @ residual[..., None])[..., 0]
        chi2 = np.einsum("bm,bm->b", residual, residual)
        normal = turned @ jacobian
    chi2 = np.where(np.isfinite(chi2), chi2, np.inf)
    return normal, slope, chi2, residual.shape[1]


def _step(
    normal: NDArray[np.float64], slope: NDArray[np.float64], damping: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the step, shape (b, p), and its squared length in standard deviations, (b,)."""
    scale = _scale(normal)
    scaled = normal / (scale[:, :, None] * scale[:, None, :])
    ridge = np.eye(normal.shape[-1]) * (RIDGE + damping)[:, None, None]
    step = np.linalg.solve(scaled + ridge, -(slope / scale)[..., None])[..., 0]
    size = -np.einsum("bp,bp->b", step, slope / scale)
    return step / scale, np.abs(size)


def _damped(damping: NDArray[np.float64], better: NDArray[np.bool_]) -> NDArray[np.float64]:
    less = np.where(damping > LEAST_DAMPING, damping / 10.0, 0.0)
    return np.where(better, less, np.maximum(10.0 * damping, FIRST_DAMPING))


def _scale(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    diagonal = np.diagonal(normal, axis1=-2, axis2=-1)
    return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def inverted(normal: NDArray[np.float64], smallest: float = RANK) -> Inverse:
    """Return covariance, rank and condition of normal matrices, shape (..., p, p).

    Examples
    --------
    >>> found = inverted(np.array([[4.0, 0.0], [0.0, 0.0]]))
    >>> found.covariance.tolist(), found.rank.item()
    ([[0.25, 0.0], [0.0, 0.0]], 1)
    """
    scale = _scale(normal)
    values, vectors = np.linalg.eigh(normal / (scale[..., :, None] * scale[..., None, :]))
    largest = values[..., -1:]
    seen = values > smallest**2 * largest
    weights = np.where(seen, 1.0 / np.where(seen, values, 1.0), 0.0)
    spread = vectors * weights[..., None, :] @ np.swapaxes(vectors, -1, -2)
    least = np.maximum(values[..., 0], 1e-30 * largest[..., 0])
    return Inverse(
        covariance=spread / (scale[..., :, None] * scale[..., None, :]),
        rank=seen.sum(axis=-1),
        condition=np.sqrt(largest[..., 0] / least),
    )
