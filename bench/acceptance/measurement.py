"""A measurement: name, value, unit, limits, uncertainty and the outcome that follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from bench.acceptance.outcome import Outcome

if TYPE_CHECKING:
    from bench.uncertainty.decision import Spread


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """Limits of one measurement.

    Attributes
    ----------
    low, high : float or None
        Tolerance limits in `unit`; at least one is given unless the measurement only informs.
    uncertainty : float
        Expanded uncertainty U (k = 2) of the measured value, in `unit`; of a judged measurement
        the one that was computed for it, where there is one.
    guard_band : float
        Width w by which the acceptance limits lie inside the tolerance limits (ISO 14253-1,
        JCGM 106); between them the outcome is MARGINAL.
    guard_factor : float or None
        Where given, w is this many U and follows the U of each measurement.
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
    guard_factor: float | None = None
    missed: Outcome = Outcome.FAIL
    description: str = ""
    action: str = ""

    def with_uncertainty(self, expanded: float) -> Limit:
        """Return the limit as it holds for a value of that expanded uncertainty."""
        if self.guard_factor is None:
            return replace(self, uncertainty=expanded)
        return replace(self, uncertainty=expanded, guard_band=self.guard_factor * expanded)

    @property
    def rule(self) -> str:
        """The decision rule in short: how the guard band w follows from U."""
        if self.guard_factor is not None:
            return f"guarded, w = {self.guard_factor:g} U"
        if self.guard_band > 0.0:
            return f"guarded, w = {self.guard_band:g} {self.unit}".rstrip()
        return "simple acceptance, w = 0"

    @property
    def tur(self) -> float | None:
        """Test uncertainty ratio: half the width of the tolerance over U; None where it has none.

        An upper limit alone counts from zero, as that of an absolute error does.
        """
        if self.high is None or self.uncertainty <= 0.0:
            return None
        half = self.high if self.low is None else (self.high - self.low) / 2.0
        return half / self.uncertainty if half > 0.0 else None

    def conformity(self, value: float) -> float | None:
        """Return the probability that the true value lies inside the limits (JCGM 106, 7.3).

        The true value is taken as normal about the measured one with U/2; None where U is 0.
        """
        if self.uncertainty <= 0.0 or not math.isfinite(value):
            return None
        sd = self.uncertainty / 2.0
        above = 0.0 if self.low is None else _normal((self.low - value) / sd)
        below = 1.0 if self.high is None else _normal((self.high - value) / sd)
        return below - above


def _normal(value: float) -> float:
    return 0.5 * math.erfc(-value / math.sqrt(2.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One measured value and its outcome; `outcome` is None until it is judged.

    Attributes
    ----------
    uncertainty, tur, conformity : float or None
        Expanded uncertainty (k = 2), test uncertainty ratio and conformity probability; None
        where they are not known. Judging fills them in.
    rule : str
        Decision rule in short; empty without a limit.
    spread : Spread or None
        Where the uncertainty was computed for this very value; otherwise the limit's holds.
    """

    name: str
    value: float
    step: str
    unit: str = ""
    limit: Limit | None = None
    outcome: Outcome | None = None
    attempt: int = 1
    from_samples: bool = True
    note: str = ""
    uncertainty: float | None = None
    tur: float | None = None
    conformity: float | None = None
    rule: str = ""
    spread: Spread | None = field(default=None, compare=False, repr=False)

    def judged(self, limit: Limit | None) -> Measurement:
        """Return this measurement with its limit and outcome; without a limit it informs."""
        spread = self.spread
        computed = spread.expanded if spread is not None else None
        if limit is None:
            return replace(self, limit=None, outcome=Outcome.PASS, uncertainty=computed)
        held = limit.with_uncertainty(limit.uncertainty if computed is None else computed)
        probability = held.conformity(self.value)
        if spread is not None:
            probability = spread.conformity(held.low, held.high)
        return replace(
            self,
            limit=held,
            unit=held.unit,
            outcome=_outcome(self.value, held),
            uncertainty=held.uncertainty or None,
            tur=held.tur,
            conformity=probability,
            rule=held.rule,
        )


def _outcome(value: float, limit: Limit) -> Outcome:
    if limit.low is None and limit.high is None:
        return Outcome.PASS
    if not math.isfinite(value):
        return Outcome.ERROR
    low = -math.inf if limit.low is None else limit.low
    high = math.inf if limit.high is None else limit.high
    if not low <= value <= high:
        return limit.missed
    inside = low + limit.guard_band <= value <= high - limit.guard_band
    return Outcome.PASS if inside else Outcome.MARGINAL
