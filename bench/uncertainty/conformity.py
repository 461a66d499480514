"""Probability that the true errors lie inside a limit, given the measured ones (JCGM 106).

The bench's draws that several poses share are covered by fixed, evenly spread points (a scrambled
Sobol set of a fixed seed), and what one pose has for itself is integrated by the normal
distribution: the same numbers always give the same probability.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

POINTS: Final = 4096
"""Points of the set, a power of two."""
_SEED: Final = 106
_SMALLEST_SD_DEG: Final = 1e-9
_EDGE: Final = 1e-12


def probability_within(
    error_deg: ArrayLike, columns_deg: NDArray[np.float64], limit_deg: float
) -> NDArray[np.float64]:
    """Return the probability, shape (...), that all true errors of a unit lie within +-limit.

    True error = measured error - columns_deg z, with z ~ N(0, I): nothing is assumed about the
    unit beforehand.

    Parameters
    ----------
    error_deg : array-like, shape (..., n)
        Measured errors at n poses; leading axes are units.
    columns_deg : ndarray, shape (n, f)
        Standard contributions of the bench by independent draw.
    limit_deg : float

    References
    ----------
    .. [1] JCGM 106:2012, 7.2 and 7.5: conformity probability.

    Examples
    --------
    >>> round(float(probability_within([0.5], np.array([[0.1]]), 0.5)), 6)
    0.5
    """
    from scipy.special import ndtr

    errors = np.asarray(error_deg, dtype=float)
    shared, own_sd = _shared_and_own(columns_deg)
    shift = _normal_points(shared.shape[1]) @ shared.T
    flat = errors.reshape(-1, errors.shape[-1])
    found = np.empty(len(flat))
    for row, one in enumerate(flat):
        true = one - shift
        inside = ndtr((limit_deg - true) / own_sd) - ndtr((-limit_deg - true) / own_sd)
        found[row] = inside.prod(axis=1).mean()
    return found.reshape(errors.shape[:-1])


def simulated_rms_deg(
    error_deg: NDArray[np.float64], columns_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the RMS over n poses of the true errors at each point of the set, shape (POINTS,).

    The root of a mean square is not linear where the errors are as small as their uncertainty,
    so that its distribution is propagated (JCGM 101).

    Parameters
    ----------
    error_deg : ndarray, shape (n,)
        Measured errors.
    columns_deg : ndarray, shape (n, f)
        Standard contributions of the bench by independent draw.
    """
    columns = _largest_first(columns_deg)
    true = error_deg - _normal_points(columns.shape[1]) @ columns.T
    return np.asarray(np.sqrt(np.mean(true**2, axis=1)))


def _shared_and_own(
    columns_deg: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the columns that move several poses, and the standard deviation of each pose's own."""
    moves = np.abs(columns_deg) > _EDGE
    own = moves.sum(axis=0) == 1
    own_sd = np.sqrt(np.sum(columns_deg[:, own] ** 2, axis=1))
    shared = columns_deg[:, moves.sum(axis=0) > 1]
    return _largest_first(shared), np.maximum(own_sd, _SMALLEST_SD_DEG)


def _largest_first(columns_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Order columns by size: the first dimensions of the set are spread most evenly."""
    size = np.round(np.linalg.norm(columns_deg, axis=0), 9)
    return np.asarray(columns_deg[:, np.argsort(-size, kind="stable")])


@lru_cache(maxsize=32)
def _normal_points(dimensions: int) -> NDArray[np.float64]:
    """Return POINTS evenly spread standard normal points, shape (POINTS, dimensions)."""
    if dimensions == 0:
        return np.zeros((1, 0))
    from scipy.special import ndtri
    from scipy.stats import qmc

    uniform = qmc.Sobol(dimensions, scramble=True, rng=_SEED).random(POINTS)
    return np.asarray(ndtri(np.clip(uniform, _EDGE, 1.0 - _EDGE)))
