"""Uncertainty budget of the heading errors of one verification (JCGM 100, "GUM").

Two measurands are told from one measured error e_k = heading sent - reference heading:

- certificate: the unit's own systematic heading error at the pose. All lines count.
- test: the error that the unit showed, its noise and repeatability included, against the true
  reference heading. The bench's lines alone count (ISO 14253-5).

The covariance of the fit is in neither: whatever the coefficients are, the unit has them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bench.uncertainty.bench_contributions import COVERAGE_FACTOR, bench_contributions
from bench.uncertainty.sensitivities import heading_sensitivities
from bench.uncertainty.unit_contributions import unit_contributions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import Fit
    from bench.station import Station
    from bench.uncertainty.contribution import Contribution
    from bench.uncertainty.unit_data import UnitData


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadingBudget:
    """Lines of the budget and what they come to at n poses.

    Attributes
    ----------
    contributions : tuple of Contribution
        First the unit's, then the bench's.
    """

    contributions: tuple[Contribution, ...]

    @cached_property
    def covariance_certificate(self) -> NDArray[np.float64]:
        """Covariance of e - the unit's own error, shape (n, n), deg^2."""
        return np.asarray(np.sum([line.covariance for line in self.contributions], axis=0))

    @cached_property
    def test_columns_deg(self) -> NDArray[np.float64]:
        """Standard contributions of the bench by independent draw, shape (n, f)."""
        columns = [line.columns_deg for line in self.contributions if line.group == "bench"]
        return np.concatenate(columns, axis=1)

    @cached_property
    def covariance_test(self) -> NDArray[np.float64]:
        """Covariance of e - the error shown against the true reference, shape (n, n), deg^2."""
        return np.asarray(self.test_columns_deg @ self.test_columns_deg.T)

    @property
    def u_deg(self) -> NDArray[np.float64]:
        """Expanded uncertainty (k = 2) of the unit's own error at each pose, shape (n,)."""
        return COVERAGE_FACTOR * np.sqrt(np.diag(self.covariance_certificate))

    @property
    def u_test_deg(self) -> NDArray[np.float64]:
        """Expanded uncertainty (k = 2) of the test at each pose, shape (n,)."""
        return COVERAGE_FACTOR * np.sqrt(np.diag(self.covariance_test))


def heading_budget(
    readings: NDArray[np.void],
    fit: Fit,
    station: Station,
    unit: UnitData,
    *,
    baseline_mg: NDArray[np.float64] | None = None,
) -> HeadingBudget:
    """Return the budget of the heading errors at verification poses.

    Parameters
    ----------
    readings : ndarray of READING, shape (n,), n >= 1
        Their times tell the order of visit, on which hysteresis and wander depend.
    fit : Fit
        The coefficients that the module uses.
    station : Station
        Its expanded uncertainties, k = 2.
    unit : UnitData
        Type B data of the part.
    baseline_mg : ndarray, shape (3,), optional
        What the reference magnetometer read when the run began; without it only the field's
        changes among these readings are seen.

    References
    ----------
    .. [1] JCGM 100:2008, 5.1.2 and 5.2.2 (combined variance of correlated inputs), 4.3 (type B).
    .. [2] ISO 14253-5:2015: the test value uncertainty of indicating measuring instruments.
    """
    by = heading_sensitivities(readings, fit, station.seat.index_deg)
    return HeadingBudget(
        contributions=(
            *unit_contributions(readings, by, unit),
            *bench_contributions(readings, by, station, baseline_mg),
        )
    )
