"""Let time pass on the bus."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bench.quantity import Seconds
from bench.steps.step import Step

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Wait(Step):
    """Wait, for instance for the module to warm up; frames are recorded meanwhile."""

    kind: Literal["wait"]
    duration: Seconds
    """How long to wait."""

    def run(self, context: RunContext) -> None:
        """Let the bus run for the duration."""
        context.bus.run_for(self.duration)

    def duration_s(self) -> float:
        """Return the duration."""
        return self.duration
