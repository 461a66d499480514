"""Have the unit mounted in another way for a reversal."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from bench.calibration.mountings import Mounting  # noqa: TC001  (pydantic reads it)
from bench.pose import Attitude
from bench.remount import remount
from bench.steps.step import Step

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Mount(Step):
    """Level the rig and have the operator put the unit in; what follows belongs to it."""

    fixed_duration_s: ClassVar[float] = 15.0
    kind: Literal["mount"]
    mounting: Mounting
    """as_marked; turned by 180 deg about down; turned_over by 180 deg about forward."""

    def run(self, context: RunContext) -> None:
        """Level, ask, and note from which position on the unit sits so.

        Raises
        ------
        RigFault
            If the rig does not come to its level.
        ConfigError, BenchNotReady, BusFault
            See `bench.remount.remount`.
        """
        rig = context.require_rig()
        rig.move_to(Attitude(azimuth_deg=0.0))
        remount(context, self.mounting)
        context.field_watch.anchors.clear()  # the field in the unit's own axes is another now
        context.mountings.append((self.mounting, len(context.poses)))
        context.event("mounted", mounting=self.mounting)
