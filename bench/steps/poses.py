"""Visit poses for the calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bench.steps.ring_step import RingStep
from bench.steps.step import OnMiss

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Poses(RingStep):
    """Rings of poses that calibrate; what they peak at is judged."""

    kind: Literal["poses"]
    on_miss: OnMiss = "stop"

    def run(self, context: RunContext) -> None:
        """Visit the poses and judge the peaks.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        from bench.acceptance.sensor_evaluation import evaluate_peaks

        readings = context.visit(self.poses(), calibrates=True, sentinel=self.sentinel)
        context.judge(evaluate_peaks(context.step_name, readings))

    def measured(self) -> tuple[str, ...]:
        """Return the name of what is judged here."""
        return ("peak_reading",)
