"""The verdict of a run: the worst outcome wins, with a reason, a next action and the rule."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from bench.acceptance.catalogue import CHECKS
from bench.acceptance.outcome import Outcome, worst
from bench.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from bench.acceptance.measurement import Limit, Measurement

DECISION_RULE: Final = (
    "PASS where the value lies inside the limits by at least the guard band w, MARGINAL where "
    "it lies inside them by less, otherwise missed (ISO 14253-1, JCGM 106 acceptance limits "
    "TL - w). U is the expanded uncertainty, k = 2; that of the module's heading errors is of the "
    "test alone (ISO 14253-5) and computed at each pose (GUM), w = U at the worst one. TUR is the "
    "limit over U. The worst outcome of the last attempts is the verdict."
)

_NEXT_ACTIONS: Final = {
    Outcome.PASS: "Release the unit.",
    Outcome.MARGINAL: "Set the unit aside for the engineer: run it once more after a warm-up.",
    Outcome.FAIL: "Put the unit into the red bin with this record.",
    Outcome.ABORTED: "Check that the rig is parked, then start the run again.",
    Outcome.ERROR: "Do not judge the unit: correct the bench and run it again.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Outcome of a run in words.

    `first_failure` names the first measurement, in the order of the run, that was missed.
    """

    outcome: Outcome
    reason: str
    next_action: str
    rule: str = DECISION_RULE
    first_failure: str | None = None


def judge_measurement(measurement: Measurement, limits: Mapping[str, Limit]) -> Measurement:
    """Return the measurement with limit and outcome; without a limit of its name it informs.

    Raises
    ------
    ConfigError
        If the limit is in another unit than the measurement.
    """
    limit = limits.get(measurement.name)
    if limit is not None and limit.unit != measurement.unit:
        message = (
            f"limit {limit.name} must be in {measurement.unit or 'no unit'}; instead received "
            f"{limit.unit or 'no unit'}"
        )
        raise ConfigError(message)
    return measurement.judged(limit)


def last_attempts(measurements: Iterable[Measurement]) -> list[Measurement]:
    """Return, in the order of the run, the last attempt of each measurement of each step."""
    latest: dict[tuple[str, str], int] = {}
    rows = list(measurements)
    for row in rows:
        key = (row.step, row.name)
        latest[key] = max(latest.get(key, row.attempt), row.attempt)
    return [row for row in rows if row.attempt == latest[row.step, row.name]]


def verdict_of(
    measurements: Sequence[Measurement],
    *,
    error: str | None = None,
    aborted: str | None = None,
    required: Iterable[str] = (),
) -> Verdict:
    """Return the verdict of a run.

    Parameters
    ----------
    measurements : sequence of Measurement
        All that were judged, with all attempts, in the order of the run.
    error : str or None
        Sentence of what kept the bench from judging; the verdict is then ERROR, but a unit's
        missed limit that came first is still named as the first failure.
    aborted : str or None
        Sentence of who ended the run.
    required : iterable of str
        Measurements without which a unit is not judged; a missing one is an ERROR.
    """
    judged = last_attempts(m for m in measurements if m.outcome is not None)
    missed = [m for m in judged if m.outcome in (Outcome.FAIL, Outcome.ERROR)]
    first_failure = missed[0].name if missed else None
    if aborted is not None:
        outcome = Outcome.ERROR if error is not None else Outcome.ABORTED
        reason = aborted if error is None else f"{aborted}; {error}"
        return _verdict(outcome, reason, first_failure)
    if error is not None:
        return _verdict(Outcome.ERROR, error, first_failure)
    absent = sorted(set(required) - {m.name for m in judged})
    if absent and not missed:
        return _verdict(Outcome.ERROR, f"not measured: {', '.join(absent)}", None)
    outcome = worst([m.outcome for m in judged if m.outcome is not None])
    deciding = [m for m in judged if m.outcome is outcome]
    verdict = _verdict(outcome, _reason(outcome, deciding), first_failure)
    action = next((m.limit.action for m in deciding if m.limit and m.limit.action), "")
    return replace(verdict, next_action=action) if action and missed else verdict


def not_recorded(verdict: Verdict, fault: str) -> Verdict:
    """Return the verdict of a run whose record has a hole: never better than ERROR."""
    if verdict.outcome is Outcome.ERROR:
        return replace(verdict, reason=f"{verdict.reason}; {fault}")
    return replace(_verdict(Outcome.ERROR, fault, verdict.first_failure), rule=verdict.rule)


def _verdict(outcome: Outcome, reason: str, first_failure: str | None) -> Verdict:
    return Verdict(
        outcome=outcome,
        reason=reason,
        next_action=_NEXT_ACTIONS[outcome],
        first_failure=first_failure,
    )


def _reason(outcome: Outcome, deciding: Sequence[Measurement]) -> str:
    if outcome is Outcome.PASS:
        limited = sum(m.limit is not None for m in deciding)
        return f"all {limited} limited measurements are inside their limits"
    if not deciding:
        return "nothing was judged"
    rest = len(deciding) - 1
    more = f", and {rest} more" if rest else ""
    return f"{sentence_of(deciding[0])}{more}"


def sentence_of(measurement: Measurement) -> str:
    """Return a judged measurement in words, with its value, its limit and the distance."""
    name, value = measurement.name, measurement.value
    unit = f" {measurement.unit}" if measurement.unit else ""
    limit = measurement.limit
    if limit is None or value != value:  # noqa: PLR0124
        return f"{name} could not be measured" if value != value else f"{name} {value:.4g}{unit}"  # noqa: PLR0124
    if name in CHECKS and value == 0.0:
        note = f" ({measurement.note})" if measurement.note else ""
        return f"{name} was not met{note}"
    if limit.high is not None and value > limit.high:
        return f"{name} {value:.4g}{unit} is above {limit.high:.4g}{unit}"
    if limit.low is not None and value < limit.low:
        return f"{name} {value:.4g}{unit} is below {limit.low:.4g}{unit}"
    if measurement.outcome is Outcome.MARGINAL:
        return f"{name} {value:.4g}{unit} is within {_guard_words(measurement, limit)}"
    return f"{name} {value:.4g}{unit} is inside its limits"


def _guard_words(measurement: Measurement, limit: Limit) -> str:
    """Return the guard band in words: its width, the limit that it guards, and U."""
    unit = f" {measurement.unit}" if measurement.unit else ""
    near_low = limit.low is not None and measurement.value < limit.low + limit.guard_band
    guarded = limit.low if near_low else limit.high
    u = f" (U = {limit.uncertainty:.2g}{unit})" if limit.uncertainty > 0.0 else ""
    return f"the guard band w = {limit.guard_band:.2g}{unit} of its limit {guarded:.4g}{unit}{u}"
