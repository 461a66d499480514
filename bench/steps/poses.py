"""Visit tilted poses for the calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bench.quantity import Seconds
from bench.steps.headings import Ring, ring_poses
from bench.steps.step import OnMiss, PlannedPose, Step

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Poses(Step):
    """Rings of poses that calibrate; what they peak at is judged."""

    kind: Literal["poses"]
    on_miss: OnMiss = "stop"
    rings: Annotated[list[Ring], Field(min_length=1)]
    """Rings in order."""
    dwell: Seconds = 0.5
    """Time over which a reading is averaged."""

    def poses(self) -> list[PlannedPose]:
        """Return the poses of all rings in order."""
        return ring_poses(self.rings, self.dwell)

    def run(self, context: RunContext) -> None:
        """Visit the poses and judge the peaks.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        from bench.acceptance.sensor_evaluation import evaluate_peaks

        readings = context.visit(self.poses(), calibrates=True)
        context.judge(evaluate_peaks(context.step_name, readings))

    def measured(self) -> tuple[str, ...]:
        """Return the name of what is judged here."""
        return ("peak_reading",)
