"""What a run tells whoever watches it: step, position, time, measurements as they are judged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from bench.acceptance.measurement import Measurement
    from bench.acceptance.outcome import Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class RunState:
    """Where a run is; times are of the bus's clock.

    Attributes
    ----------
    step : str
        Name of the step that runs.
    position, positions : int
        Dwells done and dwells of the whole procedure.
    elapsed_s, expected_s : float
        Time since the start, and that of the whole procedure by its plan.
    """

    step: str
    position: int
    positions: int
    elapsed_s: float
    expected_s: float


class Progress(Protocol):
    """Watches a run; must not change it and must not raise."""

    def step_started(self, state: RunState) -> None:
        """Say that a step begins."""
        ...

    def position_reached(self, state: RunState) -> None:
        """Say that a dwell is done."""
        ...

    def measured(self, measurement: Measurement) -> None:
        """Say that a measurement was judged."""
        ...

    def step_ended(self, state: RunState, outcome: Outcome) -> None:
        """Say how a step ended."""
        ...


class SilentProgress:
    """Watches without a word."""

    def step_started(self, state: RunState) -> None:
        """Say nothing."""

    def position_reached(self, state: RunState) -> None:
        """Say nothing."""

    def measured(self, measurement: Measurement) -> None:
        """Say nothing."""

    def step_ended(self, state: RunState, outcome: Outcome) -> None:
        """Say nothing."""
