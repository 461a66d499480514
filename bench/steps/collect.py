"""Listen to a module without moving it: a replayed recording, or a unit turned by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final, Literal

from bench.errors import ModuleSilent
from bench.quantity import Seconds
from bench.steps.step import Step
from protocols.compass import FLAG_REPLAY_ENDED

if TYPE_CHECKING:
    from bench.module import Module
    from bench.run_context import RunContext
    from bench.sample_log import SampleLog

PAIR: Final = 0b0011
"""Bits of `complete` for the set and the reset reading."""
POSITION: Final = 0
"""All that is collected counts as one dwell."""
QUIET_TICKS: Final = 5
"""A module that has sent no cycle for so long is booting."""


class Collect(Step):
    """Keep every reading until the recording ends or the time is over.

    The module is reset first: a replayed recording then begins again with its first row, and
    listening begins while the module boots, so that no row is missed and none comes twice.
    """

    fixed_duration_s: ClassVar[float] = 30.0
    kind: Literal["collect"]
    timeout: Seconds = 600.0
    """Longest time to listen."""

    def run(self, context: RunContext) -> None:
        """Reset the module and listen until it says that its recording has ended.

        Raises
        ------
        ModuleSilent
            If no set and reset reading came.
        """
        bus, module = context.bus, context.module
        start = _QuietStart(module, context.sample_log)
        bus.add_hook(start)
        try:
            module.diagnostics.reset()
        finally:
            bus.remove_hook(start)
        end_s = bus.now_s + self.timeout
        while bus.now_s < end_s and not module.status.flags & FLAG_REPLAY_ENDED:
            bus.tick()
        samples = context.sample_log.end_dwell()
        if not (samples["complete"] & PAIR == PAIR).any():
            message = (
                f"module sent no set and reset readings within {self.timeout:g} s; "
                "check its recording"
            )
            raise ModuleSilent(message)
        context.recording = samples
        context.event("collected", samples=len(samples))


class _QuietStart:
    """Begins the dwell, once, as soon as the module is quiet."""

    def __init__(self, module: Module, sample_log: SampleLog) -> None:
        self._module = module
        self._sample_log = sample_log
        self._cycles = module.cycles
        self._quiet_ticks = 0
        self._begun = False

    def __call__(self) -> None:
        """Count a tick."""
        self._quiet_ticks = 0 if self._module.cycles != self._cycles else self._quiet_ticks + 1
        self._cycles = self._module.cycles
        if self._quiet_ticks >= QUIET_TICKS and not self._begun:
            self._begun = True
            self._sample_log.begin_dwell(POSITION)
