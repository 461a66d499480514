"""Judge the heading that the bench computes by the fits, on poses that none of them has used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bench.steps.comparison import compare_methods
from bench.steps.ring_step import RingStep

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Compare(RingStep):
    """Rank all fits on verification poses and judge the judged one; nothing is written.

    The module's own heading takes no part. None of the poses may be a calibration pose.
    """

    kind: Literal["compare"]

    def run(self, context: RunContext) -> None:
        """Visit the poses, compare the methods, judge.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        from bench.acceptance.method_comparison import evaluate_comparison

        readings = context.visit(self.poses(), verifies=True, sentinel=self.sentinel)
        if context.judged_fit is not None:
            judged = context.judged_fit.method
            context.judge(
                evaluate_comparison(
                    context.step_name, judged, context.fits, readings, context.station
                )
            )
        compare_methods(context, readings)

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        level = ("achieved_level_max", "achieved_level_rms") if self.has_level else ()
        tilted = ("achieved_tilt_max", "achieved_tilt_rms") if self.has_tilted else ()
        return (*level, *tilted)
