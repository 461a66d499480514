"""Where the Sampson likelihood of many units is largest, and what that determines.

From Taubin's ellipsoid, which is nearly efficient, two Gauss-Newton steps reach the minimum
wherever readings are regular. They are taken for all units at once and count only where the
second is far below the unit's own standard deviation; the other units go on alone, at last
damped.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from bench.calibration.least_squares import (
    NOISE_FLOOR,
    RANK,
    SMALLEST_STEP,
    Minimum,
    Rows,
    inverted,
    minimised,
)
from bench.calibration.sphere_model import (
    SYMMETRIC_COLUMNS,
    SYMMETRIC_ROWS,
    symmetric,
    symmetric_sphere_rows,
)

if TYPE_CHECKING:
    from bench.calibration.taubin import TaubinStarts

UNKNOWNS: Final = 9
RIDGED: Final = np.ones((9, 9)) + 1e-14 * np.eye(9)
"""Keeps a normal matrix without full rank solvable; what it then gives is not used."""
FIRST_STEP: Final = 0.25
"""Squared length of a first step, in standard deviations, after which no second is needed."""
SECOND_STEP: Final = 1e-3
"""The same of a second step and a third."""
LARGEST_TRACE: Final = 0.5 / (UNKNOWNS * RANK**2)
"""Of the inverse of a normal matrix of unit diagonal, whose rank below it is surely full."""

Weighed = tuple[Minimum, NDArray[np.float64], NDArray[np.bool_]]
"""Parameters and what is known of them, covariance (b, 9, 9), and where its rank is full, (b,)."""


def sphere_rows_of(points: NDArray[np.float64], sd: NDArray[np.float64]) -> Rows:
    """Return the Sampson residuals of normalised points (b, n, 3) of noise `sd` (b,) as rows."""

    def rows(
        parameters: NDArray[np.float64], units: NDArray[np.intp]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        found = _rows(parameters, points[units], sd[units])
        return found[9], np.moveaxis(found[:9], 0, -1)

    return rows


def sphere_minimum(
    points: NDArray[np.float64], starts: TaubinStarts, sd: NDArray[np.float64]
) -> Minimum:
    """Return the Sampson minimum of normalised points (b, n, 3) of noise `sd` (b,).

    The parameters are the six elements of M, as in `symmetric`, and the centre.
    """
    return weighed_minimum(points, starts, sd)[0]


def weighed_minimum(
    points: NDArray[np.float64], starts: TaubinStarts, sd: NDArray[np.float64]
) -> Weighed:
    """Return `sphere_minimum` with its covariance and where its rank is full."""
    start = _elements(starts)
    with np.errstate(all="ignore"):  # a step too far does not count
        best, seen = _two_steps(points, start, sd)
        if not best.converged.all():
            rest = np.flatnonzero(~best.converged)
            more, seen = _two_steps(points[rest], seen[rest], sd[rest])
            _keep(best, rest, more)
            rest, seen = rest[~more.converged], seen[~more.converged]
            if len(rest):
                _keep(best, rest, minimised(sphere_rows_of(points[rest], sd[rest]), seen))
    covariance = _inverse(best.normal)
    return best, covariance, _full(best.normal, covariance)


def one_step(points: NDArray[np.float64], starts: TaubinStarts, sd: NDArray[np.float64]) -> Weighed:
    """Return what one step from Taubin's ellipsoid reaches, as `weighed_minimum`.

    From a start within the noise one step is as efficient as the minimum itself, wherever the
    readings determine the parameters well [1]_, which the covariance tells. A unit has converged
    where its start was within half a standard deviation; elsewhere it stays at its start.

    References
    ----------
    .. [1] E. L. Lehmann and G. Casella, Theory of Point Estimation, 2nd ed., theorem 6.4.3.
    """
    start = _elements(starts)
    with np.errstate(all="ignore"):
        step = _Step(points, start, sd)
        near = step.drop < FIRST_STEP * step.unit
    if not near.all():
        step.end = np.where(near[:, None], step.end, start)
        step.drop = np.where(near, step.drop, 0.0)
    chi2 = np.maximum(step.chi2 - step.drop, 0.0)
    best = Minimum(parameters=step.end, normal=step.normal, chi2=chi2, converged=near)
    return best, step.covariance, _full(step.normal, step.covariance)


def _keep(best: Minimum, units: NDArray[np.intp], found: Minimum) -> None:
    best.parameters[units], best.normal[units] = found.parameters, found.normal
    best.chi2[units], best.converged[units] = found.chi2, found.converged


def covariance_of(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of normal matrices (b, 9, 9), as `least_squares.inverted`."""
    covariance = _inverse(normal)
    _full(normal, covariance)
    return covariance


def _rows(
    parameters: NDArray[np.float64], points: NDArray[np.float64], sd: NDArray[np.float64]
) -> NDArray[np.float64]:
    return symmetric_sphere_rows(symmetric(parameters[:, :6]), parameters[:, 6:], points, sd)


def _elements(starts: TaubinStarts) -> NDArray[np.float64]:
    elements = starts.matrix[:, SYMMETRIC_ROWS, SYMMETRIC_COLUMNS]
    return np.concatenate([elements, starts.centre], axis=1)


class _Step:
    """A Gauss-Newton step of all units, and what they were before it.

    Attributes
    ----------
    normal, covariance : ndarray, shape (b, 9, 9)
    chi2, drop : ndarray, shape (b,)
        Sum of squares before, and by how much the step should lower it: its squared length in
        standard deviations.
    unit : ndarray, shape (b,)
        Mean square residual that a step refers to.
    end : ndarray, shape (b, 9)
    """

    def __init__(
        self, points: NDArray[np.float64], start: NDArray[np.float64], sd: NDArray[np.float64]
    ) -> None:
        rows = _rows(start, points, sd).transpose(1, 0, 2)
        every = rows @ rows.transpose(0, 2, 1)
        slope = every[:, :UNKNOWNS, UNKNOWNS:]
        self.normal = every[:, :UNKNOWNS, :UNKNOWNS]
        self.covariance = _inverse(self.normal)
        self.chi2 = every[:, UNKNOWNS, UNKNOWNS]
        self.unit = np.maximum(self.chi2 / points.shape[1], NOISE_FLOOR)
        step = self.covariance @ slope
        self.drop = (slope.transpose(0, 2, 1) @ step)[:, 0, 0]
        self.end = start - step[..., 0]


def _two_steps(
    points: NDArray[np.float64], start: NDArray[np.float64], sd: NDArray[np.float64]
) -> tuple[Minimum, NDArray[np.float64]]:
    """Return what two steps reach, and the better of what they started from.

    A unit has converged where the second step, and the third that would follow in equal ratio,
    are next to nothing.
    """
    first = _Step(points, start, sd)
    second = _Step(points, first.end, sd)
    better = second.chi2 <= first.chi2
    third = second.drop * (second.drop / first.drop)
    settled = better & (second.drop < SECOND_STEP * second.unit)
    best = Minimum(
        parameters=second.end,
        normal=second.normal,
        chi2=np.maximum(second.chi2 - second.drop, 0.0),
        converged=settled & (third < SMALLEST_STEP * second.unit),
    )
    return best, np.where(better[:, None], first.end, start)


def _inverse(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.inv(normal * RIDGED))


def _full(normal: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return where the rank is full; elsewhere cut what is not determined out of the covariance.

    The trace of the scaled inverse bounds the smallest eigenvalue: where it is small the rank is
    full, and the eigenvalues need not be known.
    """
    trace = np.einsum("bii,bii->b", covariance, normal)
    full = np.asarray((trace > 0.0) & (trace < LARGEST_TRACE))
    if not full.all():
        weak = np.flatnonzero(~full)
        found = inverted(normal[weak])
        covariance[weak], full[weak] = found.covariance, found.rank == UNKNOWNS
    return full
