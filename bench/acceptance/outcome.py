"""Outcomes of a measurement and of a run, and their exit codes."""

from __future__ import annotations

from enum import StrEnum
from typing import Final


class Outcome(StrEnum):
    """Outcomes from best to worst; the worst of a run is its verdict."""

    PASS = "PASS"  # noqa: S105
    MARGINAL = "MARGINAL"
    FAIL = "FAIL"
    ABORTED = "ABORTED"
    ERROR = "ERROR"

    @property
    def severity(self) -> int:
        """Rank of the outcome, 0 for PASS."""
        return _ORDER.index(self)

    @property
    def exit_code(self) -> int:
        """Exit code of the command line; an abort by a signal has its own, 128 + signal."""
        return _EXIT_CODES[self]


_ORDER: Final = tuple(Outcome)
_EXIT_CODES: Final = {
    Outcome.PASS: 0,
    Outcome.FAIL: 1,
    Outcome.MARGINAL: 3,
    Outcome.ERROR: 4,
    Outcome.ABORTED: 130,
}


def worst(outcomes: list[Outcome]) -> Outcome:
    """Return the worst of several outcomes; of none, ERROR: nothing was judged."""
    return max(outcomes, key=lambda outcome: outcome.severity, default=Outcome.ERROR)
