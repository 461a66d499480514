"""What fitted coefficients are claimed to be worth: their largest heading error at 95 %.

The claim holds for all attitudes of the verification grid at once: with a probability of 95 % the
coefficients err by no more at any of them. It is the quantile of the largest error that their
covariance makes, drawn from a multivariate t distribution on fixed Sobol points.

The variance of the readings is pooled from what was stated before and what the residuals show
(GUM G.4.2: a standard deviation known to a part R has 1/(2 R^2) degrees of freedom). A run that
goes on until the claim is small enough would otherwise stop where its few residuals happen to be
small, and claim too much.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.consistency import growth
from bench.calibration.cross_axis import corrected, cross_axis_of
from bench.calibration.methods import fit_named
from bench.calibration.prediction import heading_grid, model_jacobian
from bench.calibration.truth_aided import (
    ACCELEROMETER_PARAMETERS,
    MAGNETOMETER_PARAMETERS,
    METHOD,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit

CONFIDENCE: Final = 0.95
STATED_DOF: Final = 100.0
"""The stated noise counts as known to 7 %. Residuals of good units are smaller than that, as the
coefficients take up a part of the encoders' error: they are not a better measure of the noise."""
POINTS: Final = 2048
SEED: Final = 1
SENSOR: Final = 12
"""Coefficients of one sensor: matrix and offset."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingClaim:
    """What one fit is claimed to be worth.

    Attributes
    ----------
    largest_deg : float
        Largest heading error over the verification grid, at 95 %.
    stated_deg : float
        The same if the readings were no noisier than stated, by the poses alone.
    sigma : float
        Pooled standard deviation of the readings over that stated; where the residuals are more
        than noise, that at which the fit takes them for systematic (`consistency.growth`).
    """

    largest_deg: float
    stated_deg: float
    sigma: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClaimedFit:
    """A truth-aided fit, what it claims if it was accepted, and the rows it left out."""

    fit: Fit
    claim: HeadingClaim | None
    left_out: frozenset[int]


def claimed(data: CalibrationData) -> ClaimedFit:
    """Fit a calibration's readings, without their cross-axis term, and say what that is worth."""
    fit = fit_named(METHOD, corrected(data, cross_axis_of(data)))
    names = (name.split("_") for name in fit.extra if name.startswith("disturbed_"))
    rows = frozenset(int(parts[1]) for parts in names if parts[-1] == "sigmas")
    return ClaimedFit(fit=fit, claim=None if fit.refused else claim_of(fit), left_out=rows)


def claim_of(fit: Fit) -> HeadingClaim:
    """Return what an accepted truth-aided fit of both sensors, of known noise, is worth.

    Seat, fixture and field, which calibration and verification share, are not in it.

    Raises
    ------
    ValueError
        If the fit was refused or has no accelerometer.
    """
    if (
        fit.covariance is None
        or fit.matrix is None
        or fit.accel_matrix is None
        or fit.chi2_reduced is None
        or fit.dof is None
    ):
        message = f"fit must have both sensors and a covariance; instead received {fit.method}"
        raise ValueError(message)
    names = MAGNETOMETER_PARAMETERS[:SENSOR] + ACCELEROMETER_PARAMETERS[:SENSOR]
    columns = [fit.parameters.index(name) for name in names]
    chi2 = np.asarray(fit.chi2_reduced)
    grown = growth(chi2, fit.dof)
    stated = fit.covariance[np.ix_(columns, columns)] / grown
    variance, dof = pooled_variance(chi2, fit.dof)
    systematic = grown > np.maximum(chi2, 1.0)
    sigma = float(np.sqrt(grown if systematic else variance))
    stated_deg = float(largest_error_deg(_heading_rows(fit), stated, dof))
    return HeadingClaim(largest_deg=sigma * stated_deg, stated_deg=stated_deg, sigma=sigma)


def pooled_variance(
    chi2_reduced: NDArray[np.float64], dof: int
) -> tuple[NDArray[np.float64], float]:
    """Return the variance over that stated, shape (...), and its degrees of freedom.

    >>> variance, dof = pooled_variance(np.array([0.5, 2.0]), 100)
    >>> variance.tolist(), dof
    ([0.75, 1.5], 200.0)
    """
    pooled = STATED_DOF + dof
    return np.asarray((STATED_DOF + dof * chi2_reduced) / pooled), pooled


def largest_error_deg(
    rows: NDArray[np.float64], covariance: NDArray[np.float64], dof: float
) -> NDArray[np.float64]:
    """Return the 95 % quantile of the largest absolute heading error, shape (...), in deg.

    Parameters
    ----------
    rows : ndarray, shape (..., k, p)
        Derivative of the heading by the coefficients at the attitudes of the grid, deg.
    covariance : ndarray, shape (..., p, p)
        Of the coefficients.
    dof : float
        Degrees of freedom of its scale.

    Examples
    --------
    One attitude has the interval of Student's t, 1.984 at 100 degrees of freedom:

    >>> largest_error_deg(np.ones((1, 1)), np.ones((1, 1)), 100.0).round(2).item()
    1.98
    """
    found = [
        _quantile_deg(row, one, dof)
        for row, one in zip(
            rows.reshape(-1, *rows.shape[-2:]),
            covariance.reshape(-1, *covariance.shape[-2:]),
            strict=True,
        )
    ]
    return np.array(found).reshape(covariance.shape[:-2])


def _quantile_deg(rows: NDArray[np.float64], covariance: NDArray[np.float64], dof: float) -> float:
    scale = np.sqrt(np.maximum(np.diagonal(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / (scale[:, None] * scale))
    spread = rows @ (scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
    normal, stretch = _points(covariance.shape[0], dof)
    largest = np.abs(spread @ normal).max(axis=0) * stretch
    return float(np.quantile(largest, CONFIDENCE))


@cache
def _points(count: int, dof: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return normal numbers, shape (count, m), and factors, (m,), that make t numbers of them."""
    from scipy.special import gammaincinv, ndtri
    from scipy.stats.qmc import Sobol

    uniform = Sobol(count + 1, rng=np.random.default_rng(SEED)).random(POINTS).T
    chi2 = 2.0 * gammaincinv(dof / 2.0, uniform[-1])
    return np.asarray(ndtri(uniform[:-1])), np.sqrt(dof / chi2)


def _heading_rows(fit: Fit) -> NDArray[np.float64]:
    """Return the heading's derivative, shape (k, 24), by both sensors' coefficients."""
    assert fit.matrix is not None  # noqa: S101
    assert fit.accel_matrix is not None  # noqa: S101
    assert fit.field_mg is not None  # noqa: S101
    assert fit.dip_deg is not None  # noqa: S101
    dip_rad = np.deg2rad(fit.dip_deg)
    grid = heading_grid(fit.field_mg * np.array([np.cos(dip_rad), 0.0, np.sin(dip_rad)]))
    gain, accel_gain = (
        np.asarray(np.linalg.inv(matrix), dtype=float) for matrix in (fit.matrix, fit.accel_matrix)
    )
    return np.concatenate(
        [
            model_jacobian(grid.field_gradient_deg, grid.field_mg, gain),
            model_jacobian(grid.force_gradient_deg, grid.force_g, accel_gain),
        ],
        axis=1,
    )
