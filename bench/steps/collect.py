"""Listen to a module without moving it: a replayed recording, or a unit turned by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from bench.errors import ModuleSilent
from bench.quantity import Seconds
from bench.steps.step import Step
from protocols.compass import FLAG_NO_ACCELERATION, FLAG_REPLAY_ENDED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData
    from bench.run_context import RunContext

PAIR = 0b0011
"""Bits of `complete` for the set and the reset reading."""
POSITION = 0
"""All that is collected counts as one dwell."""


class Collect(Step):
    """Keep every reading until the recording ends or the time is over."""

    fixed_duration_s: ClassVar[float] = 30.0
    kind: Literal["collect"]
    timeout: Seconds = 600.0
    """Longest time to listen."""

    def run(self, context: RunContext) -> None:
        """Listen until the module says that its recording has ended.

        Raises
        ------
        ModuleSilent
            If no set and reset reading came.
        """
        bus, module = context.bus, context.module
        end_s = bus.now_s + self.timeout
        context.sample_log.begin_dwell(POSITION)
        while bus.now_s < end_s and not module.status.flags & FLAG_REPLAY_ENDED:
            bus.tick()
        samples = context.sample_log.end_dwell()
        usable = (samples["complete"] & PAIR == PAIR) & (samples["flags"] & FLAG_REPLAY_ENDED == 0)
        context.recording = samples[usable]
        if not len(context.recording):
            message = (
                f"module sent no set and reset readings within {self.timeout:g} s; "
                "check its recording"
            )
            raise ModuleSilent(message)
        context.event("collected", samples=len(context.recording))


def recorded_data(samples: NDArray[np.void]) -> CalibrationData:
    """Return what the fits take from samples without a rig, one row a sample.

    The acceleration is left out where the module flags that it has none.
    """
    from bench.calibration.fit import CalibrationData

    no_acceleration = np.any(samples["flags"] & FLAG_NO_ACCELERATION != 0)
    with_acceleration = not no_acceleration and bool(np.isfinite(samples["accel_g"]).all())
    return CalibrationData(
        field_mg=np.array((samples["set_mg"] - samples["reset_mg"]) / 2.0),
        accel_g=np.array(samples["accel_g"]) if with_acceleration else None,
    )
