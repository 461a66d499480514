"""What the uncertainty of a test means for its two numbers: largest and RMS heading error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from bench.uncertainty.bench_contributions import COVERAGE_FACTOR
from bench.uncertainty.conformity import probability_within, simulated_rms_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.uncertainty.heading_budget import HeadingBudget


class Spread(Protocol):
    """How far the true value of a measured number may lie from it."""

    @property
    def expanded(self) -> float:
        """Expanded uncertainty, k = 2, in the unit of the number."""
        ...

    def conformity(self, low: float | None, high: float | None) -> float | None:
        """Return the probability that the true value lies inside limits; None if it is unknown."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LargestError:
    """Spread of the largest absolute heading error over poses.

    Attributes
    ----------
    error_deg : ndarray, shape (n,)
        Measured errors.
    columns_deg : ndarray, shape (n, f)
        Standard contributions of the bench by independent draw.
    """

    error_deg: NDArray[np.float64]
    columns_deg: NDArray[np.float64]

    @property
    def expanded(self) -> float:
        """U of the pose where |error| + U is largest: all others are farther inside any limit."""
        u_deg = COVERAGE_FACTOR * np.linalg.norm(self.columns_deg, axis=1)
        return float(u_deg[np.argmax(np.abs(self.error_deg) + u_deg)])

    def conformity(self, low: float | None, high: float | None) -> float | None:
        """Return the probability that every pose's true error lies within +-high."""
        if high is None or low is not None:
            return None
        return float(probability_within(self.error_deg, self.columns_deg, high))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RmsError:
    """Spread of the root mean square heading error over poses; `LargestError`'s attributes."""

    error_deg: NDArray[np.float64]
    columns_deg: NDArray[np.float64]

    @property
    def expanded(self) -> float:
        """Twice the root mean square distance of the true RMS errors from the measured one."""
        measured_deg = math.sqrt(float(np.mean(self.error_deg**2)))
        away_deg = simulated_rms_deg(self.error_deg, self.columns_deg) - measured_deg
        return COVERAGE_FACTOR * float(np.sqrt(np.mean(away_deg**2)))

    def conformity(self, low: float | None, high: float | None) -> float | None:
        """Return the probability that the true RMS error is at most `high`."""
        if high is None or low is not None:
            return None
        return float(np.mean(simulated_rms_deg(self.error_deg, self.columns_deg) <= high))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeadingDecision:
    """Spread of both numbers of one group of poses."""

    maximum: LargestError
    rms: RmsError


def heading_decision(
    error_deg: NDArray[np.float64], budget: HeadingBudget, mask: NDArray[np.bool_]
) -> HeadingDecision:
    """Return the spread of the largest and of the RMS error over some poses.

    Parameters
    ----------
    error_deg : ndarray, shape (n,)
        Measured errors at all poses of the budget.
    budget : HeadingBudget
    mask : ndarray of bool, shape (n,)
        The poses that count; at least one.
    """
    columns_deg = budget.test_columns_deg[mask]
    return HeadingDecision(
        maximum=LargestError(error_deg=error_deg[mask], columns_deg=columns_deg),
        rms=RmsError(error_deg=error_deg[mask], columns_deg=columns_deg),
    )
