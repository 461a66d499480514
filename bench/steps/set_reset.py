"""Check that set and reset pulses work on every axis, and that axes point where they should."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bench.steps.ring_step import RingStep
from bench.steps.step import OnMiss

if TYPE_CHECKING:
    from bench.run_context import RunContext

AXES = ("x", "y", "z")


class SetReset(RingStep):
    """Peaks, set/reset amplitude and symmetry, bridge offset, Hk and senses of all axes.

    All three axes must see a change of the field, so that some rings are tilted.
    """

    kind: Literal["set_reset"]
    on_miss: OnMiss = "stop"
    senses: bool = True
    """Whether to judge the sense of the axes against the rig's attitude as well."""

    def run(self, context: RunContext) -> None:
        """Visit the poses and judge the pairs.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        from bench.acceptance.sensor_evaluation import (
            evaluate_peaks,
            evaluate_senses,
            evaluate_set_reset,
        )

        readings = context.visit(self.poses(), sentinel=self.sentinel)
        context.judge(evaluate_peaks(context.step_name, readings))
        if context.synthesised:
            context.event("not_available", what="set/reset checks", reason="synthesised pairs")
        else:
            context.judge(evaluate_set_reset(context.step_name, readings, context.station))
        if self.senses:
            context.judge(evaluate_senses(context.step_name, readings, context.station))

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        names = ["peak_reading"]
        pairs = ("set_reset_amplitude", "set_reset_symmetry", "bridge_offset", "hk")
        names += [f"{pair}_{axis}" for axis in AXES for pair in pairs]
        if self.senses:
            names += [f"{sense}_{axis}" for sense in ("axis_sense", "accel_sense") for axis in AXES]
        return tuple(names)
