"""Generalised least squares of the seat's model, with every shared effect in the covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.reversal_effects import Effects, effects
from bench.calibration.reversal_model import SEAT, UNKNOWNS, SeatRows, SeatState, seat_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.reversal_effects import BenchDoubts
    from bench.calibration.reversal_model import Mounted

ITERATIONS: Final = 12
CONVERGED: Final = 1e-3
"""Largest last step of any parameter, in standard uncertainties."""
UNSEEN: Final = 1e-7
"""Singular value of the scaled design, over its largest, below which a direction is not seen."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeatSolution:
    """The end of the iteration.

    Attributes
    ----------
    free : ndarray of int, shape (p,)
        Columns of the 34 that were solved for.
    covariance : ndarray, shape (p, p)
        The weights' own.
    estimator : ndarray, shape (p, 6 n)
        From residuals to the parameters.
    weighted : ndarray, shape (6 n,)
        Residual times the inverse of the readings' covariance.
    """

    state: SeatState
    rows: SeatRows
    effect: Effects
    free: NDArray[np.intp]
    covariance: NDArray[np.float64]
    estimator: NDArray[np.float64]
    weighted: NDArray[np.float64]
    chi2_reduced: float
    dof: int
    converged: bool


def solved_seat(state: SeatState, data: Mounted, doubts: BenchDoubts) -> SeatSolution:
    """Return the solution by Gauss-Newton from a start; what is not seen keeps its start.

    The covariance of all readings is that of their noise plus every effect's column times itself,
    renewed at each step.
    """
    noise = np.tile(data.noise, len(data.raw))
    free = _seen(seat_rows(state, data), noise)
    converged = False
    for _ in range(ITERATIONS):
        rows = seat_rows(state, data)
        effect = effects(state, rows, data, doubts)
        residual = (data.raw - rows.modelled).ravel()
        design = rows.jacobian.reshape(-1, UNKNOWNS)[:, free]
        spread = np.diag(noise**2) + effect.columns @ effect.columns.T
        weighted = np.linalg.solve(spread, np.column_stack([design, residual]))
        scale = np.sqrt(np.einsum("mi,mi->i", design, weighted[:, :-1]))
        normal = (design.T @ weighted[:, :-1]) / scale[:, None] / scale
        covariance = np.linalg.inv(normal) / scale[:, None] / scale
        estimator = covariance @ weighted[:, :-1].T
        step = estimator @ residual
        whole = np.zeros(UNKNOWNS)
        whole[free] = step
        converged = bool(np.all(np.abs(step) < CONVERGED * np.sqrt(np.diag(covariance))))
        if converged:
            break
        state = state.stepped(whole)
    dof = len(residual) - len(free)
    return SeatSolution(
        state=state, rows=rows, effect=effect, free=free, covariance=covariance,
        estimator=estimator, weighted=weighted[:, -1] - weighted[:, :-1] @ step,
        chi2_reduced=float(residual @ weighted[:, -1] - step @ (design.T @ weighted[:, -1])) / dof,
        dof=dof, converged=converged,
    )  # fmt: skip


def _seen(rows: SeatRows, noise: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the columns that the poses determine: all but the seat's that take no part."""
    design = rows.jacobian.reshape(-1, UNKNOWNS) / noise[:, None]
    length = np.linalg.norm(design, axis=0)
    _, values, right = np.linalg.svd(design / length, full_matrices=False)
    unseen = right[values < UNSEEN * values[0]]
    share = np.abs(unseen).max(axis=0) if len(unseen) else np.zeros(UNKNOWNS)
    kept = np.ones(UNKNOWNS, dtype=bool)
    kept[SEAT] = share[SEAT] < 1e-3
    return np.flatnonzero(kept)
