"""Measure the noise of the magnetometer at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bench.pose import Attitude
from bench.quantity import Degrees, Seconds
from bench.steps.step import PlannedPose, Step

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Noise(Step):
    """Standard deviation of single readings of each axis at one settled pose."""

    kind: Literal["noise"]
    azimuth: Degrees = 0.0
    """Heading at which to listen, level."""
    dwell: Annotated[Seconds, Field(ge=0.5)] = 2.0
    """How long to listen; of a few readings no spread can be told."""

    def poses(self) -> list[PlannedPose]:
        """Return the one pose."""
        return [PlannedPose(attitude=Attitude(azimuth_deg=self.azimuth), dwell_s=self.dwell)]

    def run(self, context: RunContext) -> None:
        """Listen and judge.

        Raises
        ------
        RigFault, ModuleSilent
            If the pose is not reached or the module stops sending.
        """
        from bench.acceptance.sensor_evaluation import evaluate_noise

        context.judge(evaluate_noise(context.step_name, context.visit(self.poses())))

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        return ("noise_x", "noise_y", "noise_z")
