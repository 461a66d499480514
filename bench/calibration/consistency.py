"""Whether residuals are those of independent readings in one field, many units at once.

Where the noise is known, a chi-square tells whether it explains how large the residuals are. It
does not tell whether they mean harm: a field that changes over the run hides in the coefficients
and leaves residuals a third of the error. Two more questions are therefore asked of the residuals
in the order in which they were read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

CHANCE: Final = 1e-6
"""Chance that noise alone exceeds the largest chi-square."""
ALLOWANCE: Final = 1.5
"""Variance that a healthy unit's readings may have over that stated: hysteresis, repeatability
and linearity differ from unit to unit. Good virtual units on the shipped poses stay below three
quarters of the limit in all three estimators."""
NOTED_CHANCE: Final = 1e-3
"""Chance of a chi-square from which residuals count as more than noise."""
SYSTEMATIC: Final = 9.0
"""Variance of the error that is not noise over that of the residuals it leaves."""
CORRELATED: Final = 4.0
"""Standard deviations of noise's correlation from which residuals are not independent."""
LARGEST_CORRELATION: Final = 0.98
DRIFT_LEVEL: Final = 1e-6
"""Chance to see a drift in a field that does not."""
SMALLEST_DOF: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drift:
    """What changes if the conditions are let drift over the run.

    Attributes
    ----------
    chance : ndarray, shape (b,)
        That noise alone looks as much like a drift; 1 where too few readings are left to tell.
    shift : ndarray, shape (b, p)
        By how much the parameters move then; 0 unless `chance` is below DRIFT_LEVEL.
    """

    chance: NDArray[np.float64]
    shift: NDArray[np.float64]


def largest_chi2(dof: int) -> float:
    """Return the chi2_reduced beyond which residuals are not those of the noise stated.

    Infinite without degrees of freedom: nothing is left that could contradict.

    >>> [round(largest_chi2(dof), 2) for dof in (1, 3, 26, 400)]
    [35.89, 15.33, 4.36, 2.06]
    """
    from scipy.special import chdtri

    return ALLOWANCE * float(chdtri(dof, CHANCE)) / dof if dof > 0 else float("inf")


def growth(chi2_reduced: NDArray[np.float64], dof: int) -> NDArray[np.float64]:
    """Return the factor by which known noise must grow in the covariance to explain residuals.

    It is chi2_reduced where that exceeds one by chance. Beyond, part of it is not noise but
    systematic: the coefficients take up most of such an error and leave a third of it.

    >>> growth(np.array([0.8, 1.2, 2.0]), 60).tolist()
    [1.0, 1.2, 10.0]
    """
    from scipy.special import chdtri

    noted = float(chdtri(dof, NOTED_CHANCE)) / dof if dof > 0 else float("inf")
    systematic = 1.0 + SYSTEMATIC * (chi2_reduced - 1.0)
    return np.where(chi2_reduced > noted, systematic, np.maximum(chi2_reduced, 1.0))


def correlation(residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the correlation, shape (b,), of residuals (b, k, n) with those of the next reading.

    Readings that follow each other in error tell less than their number, (1 + r)/(1 - r) times
    less; 0 where noise alone explains the correlation.

    >>> noise = np.random.default_rng(1).normal(size=(1, 1, 400))
    >>> correlation(noise).item(), correlation(np.cumsum(noise, axis=2)).item() > 0.9
    (0.0, True)
    """
    count = residual.shape[1] * max(residual.shape[2] - 1, 1)
    power = np.maximum((residual**2).sum(axis=(1, 2)), 1e-300)
    found = (residual[..., 1:] * residual[..., :-1]).sum(axis=(1, 2)) / power
    significant = found * np.sqrt(count) > CORRELATED
    return np.where(significant, np.minimum(found, LARGEST_CORRELATION), 0.0)


def drift(
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    covariance: NDArray[np.float64],
    by_drift: NDArray[np.float64],
) -> Drift:
    """Return whether the conditions drifted over the run, and what that does to the parameters.

    Parameters
    ----------
    residual : ndarray, shape (b, m)
        Whitened, at the minimum.
    jacobian, covariance : ndarray, shape (b, m, p) and (b, p, p)
    by_drift : ndarray, shape (b, m, q)
        Derivative by the rates of what could drift.
    """
    from scipy.special import fdtrc

    count, rates = residual.shape[1], by_drift.shape[2]
    dof = count - jacobian.shape[2] - rates
    if dof < SMALLEST_DOF:
        none = np.zeros(jacobian.shape[::2])
        return Drift(chance=np.ones(len(none)), shift=none)
    moved = covariance @ (np.swapaxes(jacobian, 1, 2) @ by_drift)
    own = by_drift - jacobian @ moved
    turned = np.swapaxes(own, 1, 2)
    normal, slope = turned @ own, turned @ residual[..., None]
    scale = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-300))
    scaled = normal / (scale[:, :, None] * scale[:, None, :]) + 1e-9 * np.eye(rates)
    rate = -np.linalg.solve(scaled, slope / scale[..., None])[..., 0] / scale
    drop = -np.einsum("bq,bq->b", rate, slope[..., 0])
    chi2 = np.einsum("bm,bm->b", residual, residual)
    rest = np.maximum(chi2 - drop, 1e-12 * chi2 + 1e-300)
    chance = fdtrc(rates, dof, np.maximum(drop, 0.0) / rates / (rest / dof))
    shift = -np.einsum("bpq,bq->bp", moved, rate)
    return Drift(chance=chance, shift=np.where((chance < DRIFT_LEVEL)[:, None], shift, 0.0))
