"""Turn the level unit through all headings, clockwise and counter-clockwise, and come back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bench.pose import Attitude
from bench.quantity import Degrees, Seconds
from bench.steps.deviation import raw_deviation_entry
from bench.steps.headings import DIRECTION_SIGN, Direction, Headings
from bench.steps.sentinel import Sentinel  # noqa: TC001  (pydantic reads it)
from bench.steps.step import OnMiss, PlannedPose, Step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bench.run_context import RunContext


class Sweep(Step):
    """Headings in each direction with return to start: hysteresis, drift, peaks; calibrates.

    A clockwise pass starts at the first heading and ends there a whole turn later, so that
    the return is approached from the same side; the counter-clockwise pass takes the same
    headings on the way back.
    """

    kind: Literal["sweep"]
    on_miss: OnMiss = "stop"
    headings: Headings
    """The headings of one pass."""
    directions: Annotated[list[Direction], Field(min_length=1, max_length=4)] = [
        "clockwise",
        "counter_clockwise",
    ]
    """The passes in order."""
    pitch: Degrees = 0.0
    """Nose up."""
    roll: Degrees = 0.0
    """Right side down."""
    dwell: Seconds = 0.5
    """Time over which a reading is averaged."""
    sentinel: Sentinel | None = None
    """Pose to come back to between the others, where the station has no reference magnetometer."""

    def poses(self) -> list[PlannedPose]:
        """Return the poses of all passes; the first pass closes the turn."""
        azimuths = self.headings.azimuths_deg()
        planned: list[PlannedPose] = []
        for index, name in enumerate(self.directions):
            sign = DIRECTION_SIGN[name]
            turn = azimuths if sign > 0 else [azimuths[0], *azimuths[:0:-1]]
            # After the first pass the rig stands at the first heading, which then comes last.
            turn = [*turn, turn[0]] if index == 0 else [*turn[1:], turn[0]]
            planned += [self._pose(azimuth, sign) for azimuth in turn]
        return planned

    def dwells(self, *, with_reference: bool = True) -> Sequence[PlannedPose]:
        """Return the dwells with those at the sentinel pose."""
        planned = self.poses()
        if self.sentinel is None:
            return planned
        return self.sentinel.among(planned, with_reference=with_reference)

    def _pose(self, azimuth_deg: float, direction: int) -> PlannedPose:
        attitude = Attitude(azimuth_deg=azimuth_deg, pitch_deg=self.pitch, roll_deg=self.roll)
        return PlannedPose(attitude=attitude, direction=direction, dwell_s=self.dwell)

    def run(self, context: RunContext) -> None:
        """Visit the headings and judge.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        from bench.acceptance.heading_evaluation import evaluate_raw_heading
        from bench.acceptance.sensor_evaluation import evaluate_sweep

        poses = self.poses()
        readings = context.visit(poses, calibrates=True, sentinel=self.sentinel)
        deviation = raw_deviation_entry(readings, context.station)
        context.recorder.set("deviation", {"raw": deviation})
        context.judge(evaluate_sweep(context.step_name, readings, context.poses))
        context.judge(evaluate_raw_heading(context.step_name, readings, context.station))

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        both = len(set(self.directions)) == 2
        return ("peak_reading", "return_to_start", *(("hysteresis",) if both else ()))
