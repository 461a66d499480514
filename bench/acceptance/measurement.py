"""A measurement: name, value, unit, limits, uncertainty and the outcome that follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from bench.acceptance.outcome import Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """Limits of one measurement.

    Attributes
    ----------
    low, high : float or None
        Tolerance limits in `unit`; at least one is given unless the measurement only informs.
    uncertainty : float
        Expanded uncertainty U (k = 2) of the measured value, in `unit`.
    guard_band : float
        Width w by which the acceptance limits lie inside the tolerance limits (ISO 14253-1,
        JCGM 106); between them the outcome is MARGINAL.
    missed : Outcome
        Outcome outside the limits: FAIL where the unit is at fault, ERROR where the bench is.
    description : str
        What the measurement is, in one sentence.
    action : str
        What the operator does when it is missed.
    """

    name: str
    unit: str
    low: float | None = None
    high: float | None = None
    uncertainty: float = 0.0
    guard_band: float = 0.0
    missed: Outcome = Outcome.FAIL
    description: str = ""
    action: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One measured value and its outcome; `outcome` is None until it is judged."""

    name: str
    value: float
    step: str
    unit: str = ""
    limit: Limit | None = None
    outcome: Outcome | None = None
    attempt: int = 1
    from_samples: bool = True
    note: str = ""

    def judged(self, limit: Limit | None) -> Measurement:
        """Return this measurement with its limit and outcome; without a limit it informs."""
        unit = limit.unit if limit else self.unit
        return replace(self, limit=limit, unit=unit, outcome=_outcome(self.value, limit))


def _outcome(value: float, limit: Limit | None) -> Outcome:
    if limit is None or (limit.low is None and limit.high is None):
        return Outcome.PASS
    if not math.isfinite(value):
        return Outcome.ERROR
    low = -math.inf if limit.low is None else limit.low
    high = math.inf if limit.high is None else limit.high
    if not low <= value <= high:
        return limit.missed
    inside = low + limit.guard_band <= value <= high - limit.guard_band
    return Outcome.PASS if inside else Outcome.MARGINAL
