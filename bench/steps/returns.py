"""Come back to the same headings several times: repeatability and closing error."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bench.quantity import Seconds
from bench.steps.bridge_terms import record_temperature_terms
from bench.steps.headings import Ring, ring_poses
from bench.steps.step import PlannedPose, Step

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Returns(Step):
    """A ring visited `visits` times; judges the spread and the shift of the module's heading."""

    kind: Literal["returns"]
    ring: Ring
    """Headings to come back to, all approached clockwise."""
    visits: Annotated[int, Field(ge=2, le=20)] = 4
    """Visits to each heading."""
    dwell: Seconds = 0.5
    """Time over which a heading is averaged."""

    def poses(self) -> list[PlannedPose]:
        """Return the ring's poses, once around for each visit."""
        once = ring_poses([self.ring], self.dwell)
        return [replace(pose, direction=1) for pose in once] * self.visits

    def run(self, context: RunContext) -> None:
        """Visit and judge.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        from bench.acceptance.heading_evaluation import evaluate_returns

        readings = context.visit(self.poses())
        context.judge(evaluate_returns(context.step_name, readings, context.poses, context.station))
        record_temperature_terms(context)

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        return ("repeatability", "closing_error")
