"""Listen to the bus: load, lost frames, and whether the module speaks at all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bench.quantity import Seconds
from bench.steps.step import Step
from protocols.compass import FLAG_REPLAY_ENDED

if TYPE_CHECKING:
    from bench.run_context import RunContext

LOAD_NAME = "bus_load"
LOST_NAME = "frames_lost"


class CheckBus(Step):
    """Wait for module and reference magnetometer, listen, judge bus load and lost frames.

    Both count since the start of the run.
    """

    kind: Literal["check_bus"]
    listen: Seconds = 0.5
    """How long to listen."""
    ready_timeout: Seconds = 2.0
    """How long the module may take to send its first complete cycle."""

    def run(self, context: RunContext) -> None:
        """Listen, then judge.

        Raises
        ------
        ModuleSilent
            If the module sends no complete cycle within `ready_timeout`.
        ReferenceSilent
            If the station's reference magnetometer sends nothing.
        BusFault
            If the channel fails or two modules claim one address.
        """
        if not context.module.status.flags & FLAG_REPLAY_ENDED:
            context.module.wait_ready(self.ready_timeout)
        if context.reference is not None:
            context.reference.wait_ready(self.ready_timeout)
        context.bus.run_for(self.listen)
        context.measure(LOAD_NAME, context.bus.load_worst_percent)
        context.measure(LOST_NAME, float(context.module.lost))

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        return (LOAD_NAME, LOST_NAME)

    def duration_s(self) -> float:
        """Return the listening time."""
        return self.listen
