"""Which poses were disturbed: found by what they contradict, and named.

A pose is disturbed if its own residuals, under the fit of the others, are larger than the
others' scatter can explain. Poses are left out one after the other, the worst first, since two
disturbed poses hide each other in a common scatter; how many count is decided at the end, and
each that is named must contradict the undisturbed ones by itself.

References
----------
.. [1] B. Rosner, "Percentage Points for a Generalized ESD Many-Outlier Procedure",
   Technometrics 25(2), 1983, with the F statistic of a pose's several residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

LEVEL: Final = 0.001
"""Chance to name any pose of an undisturbed run."""
LARGEST_SHARE: Final = 0.25
LARGEST_COUNT: Final = 12
LARGEST_LEFT_OUT: Final = 6
"""One disturbed pose in so many can be left out; more were not of one field."""
SMALLEST_DOF: Final = 3
"""Degrees of freedom that the undisturbed poses must keep."""
MOST_POSES: Final = 500
"""Longer recordings are not of poses: single rows are then not tested."""
ROUNDS: Final = 5
SMALLEST_FREEDOM: Final = 1e-6
"""Part of a pose's residuals that the fit must leave free: else nothing contradicts the pose."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """One disturbed pose.

    Attributes
    ----------
    pose : int
        Its row.
    sigmas : float
        Length of its residual under the fit of the undisturbed poses, in standard deviations.
    significance : float
        Chance that any pose of an undisturbed run would lie so far off.
    """

    pose: int
    sigmas: float
    significance: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Refit:
    """Linearised fit of the kept poses: its inverse, shift, mean square and degrees of freedom."""

    covariance: NDArray[np.float64]
    residual: NDArray[np.float64]
    chi2: float
    dof: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Search:
    """Poses that were found disturbed, which are left, shape (n,), and if these are no use.

    They are where too many were found, or the rest has no fit.
    """

    found: tuple[Disturbance, ...]
    kept: NDArray[np.bool_]
    hopeless: bool


def search(
    count: int, contradicting: Callable[[NDArray[np.bool_]], tuple[Disturbance, ...] | None]
) -> Search:
    """Return the disturbed ones of `count` poses, none of more than MOST_POSES.

    Every round searches all poses under the fit of those that are left, until the same are found
    again. How many are too many is asked then: a grossly disturbed pose spoils the first fit so
    much that others seem to contradict it. If the rounds do not settle, too many in any is enough.

    Parameters
    ----------
    count : int
    contradicting : callable
        Returns the poses, of all, that contradict the others under the fit of the kept ones;
        None where these have no fit.
    """
    kept = np.ones(count, dtype=bool)
    found: tuple[Disturbance, ...] = ()
    many = False
    for _ in range(ROUNDS if count <= MOST_POSES else 0):
        seen = contradicting(kept)
        if seen is None:
            return Search(found=found, kept=kept, hopeless=bool(found))
        found = seen
        poses = [one.pose for one in found]
        if set(poses) == set(np.flatnonzero(~kept)):
            return Search(found=found, kept=kept, hopeless=too_many(found, count))
        many |= too_many(found, count)
        kept = ~np.isin(np.arange(count), poses)
    return Search(found=found, kept=kept, hopeless=many)


def disturbed_poses(
    residual: NDArray[np.float64], jacobian: NDArray[np.float64], *, level: float = LEVEL
) -> tuple[Disturbance, ...]:
    """Return the disturbed poses in the order of their rows.

    Parameters
    ----------
    residual : ndarray, shape (n, k)
        Whitened residuals of each pose near the minimum; their scatter need not be one.
    jacobian : ndarray, shape (n, k, p)
        Their derivatives by the parameters.
    level : float
        Chance to name any pose of an undisturbed run.

    Returns
    -------
    tuple of Disturbance
        At most a quarter of the poses and 12; none where too few degrees of freedom are left.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> residual = rng.normal(size=(20, 2))
    >>> residual[7] += 9.0
    >>> [one.pose for one in disturbed_poses(residual, np.ones((20, 2, 1)))]
    [7]
    """
    count, equations = residual.shape
    kept = np.ones(count, dtype=bool)
    candidates: list[int] = []
    named = 0
    for _ in range(min(int(LARGEST_SHARE * count), LARGEST_COUNT)):
        refit = _refit(residual, jacobian, kept)
        if refit.dof - equations < SMALLEST_DOF:
            break
        worst, chance = _worst(refit, jacobian, kept)
        candidates.append(worst)
        kept[worst] = False
        if chance * (kept.sum() + 1) < level:
            named = len(candidates)
    return _confirmed(residual, jacobian, candidates[:named], level)


def too_many(found: Sequence[Disturbance], count: int) -> bool:
    """Return whether so many of `count` poses are disturbed that the rest cannot be trusted.

    More than one in six, or as many as the search names at most: there may be others.
    """
    return len(found) * LARGEST_LEFT_OUT > count or len(found) >= LARGEST_COUNT


def contradiction(found: Sequence[Disturbance], count: int) -> str:
    """Return what is to be said of too many disturbed poses out of `count`."""
    return f"{len(found)} of {count} poses contradict the others ({named(found)})"


def named(found: Sequence[Disturbance]) -> str:
    """Return the first eight poses by row and size, for a message.

    >>> named([Disturbance(pose=3, sigmas=9.2, significance=0.0)])
    '3 by 9 sigma'
    """
    words = [f"{one.pose} by {one.sigmas:.0f} sigma" for one in found[:8]]
    return ", ".join(words) + (", ..." if len(found) > len(words) else "")


def left_out(found: Sequence[Disturbance]) -> dict[str, float]:
    """Return the number of disturbed poses and the size of each, as a fit's `extra` holds them."""
    sizes = {f"disturbed_{one.pose}_sigmas": one.sigmas for one in found}
    return {"disturbed_poses": float(len(found)), **sizes}


def _refit(
    residual: NDArray[np.float64], jacobian: NDArray[np.float64], kept: NDArray[np.bool_]
) -> _Refit:
    rows = jacobian[kept].reshape(-1, jacobian.shape[2])
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    inverse = np.linalg.pinv(rows / scale, rcond=1e-9) / scale[:, None]
    moved = residual - jacobian @ (inverse @ residual[kept].reshape(-1))
    rank = int(np.linalg.matrix_rank(rows / scale, tol=1e-7))
    return _Refit(
        covariance=inverse @ inverse.T,
        residual=moved,
        chi2=float((moved[kept] ** 2).sum()),
        dof=len(rows) - rank,
    )


def _worst(
    refit: _Refit, jacobian: NDArray[np.float64], kept: NDArray[np.bool_]
) -> tuple[int, float]:
    """Return the kept pose that the others contradict most, and the chance of that."""
    equations = jacobian.shape[1]
    share = jacobian @ refit.covariance @ np.swapaxes(jacobian, 1, 2)
    values, vectors = np.linalg.eigh(np.eye(equations) - share)
    free = values > SMALLEST_FREEDOM
    turned = np.einsum("nij,ni->nj", vectors, refit.residual)
    drop = (np.where(free, turned**2, 0.0) / np.where(free, values, 1.0)).sum(axis=1)
    drop = np.where(kept, np.minimum(drop, refit.chi2), 0.0)
    worst = int(np.argmax(drop))
    rest = max(refit.chi2 - float(drop[worst]), 1e-300)
    return worst, _chance(float(drop[worst]), equations, rest, refit.dof - equations)


def _confirmed(
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    candidates: Sequence[int],
    level: float,
) -> tuple[Disturbance, ...]:
    """Return those candidates that contradict, each alone, the fit of all undisturbed poses."""
    count, equations = residual.shape
    kept = np.ones(count, dtype=bool)
    kept[list(candidates)] = False
    if not candidates:
        return ()
    refit = _refit(residual, jacobian, kept)
    found = []
    for pose in sorted(candidates):
        spread = np.eye(equations) + jacobian[pose] @ refit.covariance @ jacobian[pose].T
        off = refit.residual[pose]
        size = float(off @ np.linalg.solve(spread, off))
        significance = min(count * _chance(size, equations, refit.chi2, refit.dof), 1.0)
        if significance < level:
            sigmas = float(np.sqrt(size / max(refit.chi2 / refit.dof, 1e-300)))
            found.append(Disturbance(pose=pose, sigmas=sigmas, significance=significance))
    return tuple(found)


def _chance(size: float, equations: int, rest: float, dof: int) -> float:
    """Return the chance of a ratio of mean squares at least as large, by the F distribution."""
    from scipy.special import fdtrc

    ratio = (size / equations) / max(rest / dof, 1e-300)
    return float(fdtrc(equations, dof, min(ratio, 1e300)))
