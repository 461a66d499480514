"""Judge the heading that the module itself sends, on poses that no fit has used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bench.quantity import Seconds
from bench.steps.deviation import deviation_entry
from bench.steps.headings import Ring, ring_poses
from bench.steps.step import PlannedPose, Step

if TYPE_CHECKING:
    from bench.run_context import RunContext


class Verify(Step):
    """Heading error level and tilted, agreement with the bench's own heading, temperature."""

    kind: Literal["verify"]
    rings: Annotated[list[Ring], Field(min_length=1)]
    """Verification poses; none of them may be a calibration pose."""
    dwell: Seconds = 0.5
    """Time over which a heading is averaged."""

    def poses(self) -> list[PlannedPose]:
        """Return the poses of all rings in order."""
        return ring_poses(self.rings, self.dwell)

    def run(self, context: RunContext) -> None:
        """Visit the poses and judge.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        import numpy as np

        from bench.acceptance.heading_evaluation import (
            evaluate_field_strength,
            evaluate_temperature,
            evaluate_verification,
        )

        name, station = context.step_name, context.station
        coefficients = context.written
        if coefficients is None:
            coefficients = context.module.diagnostics.read_coefficients()
            context.recorder.set("coefficients", {"before": coefficients})
        readings = context.visit(self.poses(), verifies=True)
        samples = np.concatenate(context.verification_samples)
        context.judge(evaluate_verification(name, readings, samples, coefficients, station))
        if context.written is not None:
            context.judge(evaluate_field_strength(name, readings, coefficients, station))
        else:
            context.not_available.add("field_magnitude_difference")
        if context.calibration_positions:
            before = context.readings_at(context.calibration_positions)
            context.judge(evaluate_temperature(name, before, readings))
        else:
            context.not_available.add("temperature_change")
        context.verified = True
        compensated = deviation_entry(readings["heading_deg"], readings, station)
        context.recorder.set("deviation", {"compensated": compensated})
        self._compare_methods(context)

    def _compare_methods(self, context: RunContext) -> None:
        """Say what every method would have achieved on the same verification poses."""
        from bench.acceptance.heading_evaluation import achieved_heading, ranking

        readings = context.readings_at(context.verification_positions)
        achieved = {
            name: achieved_heading(fit, readings, context.station)
            for name, fit in context.fits.items()
        }
        for name, fit in context.fits.items():
            context.recorder.fit(fit, achieved[name])
        context.recorder.set("ranking", ranking(achieved))

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        level = any(ring.pitch == 0.0 and ring.roll == 0.0 for ring in self.rings)
        tilted = any(ring.pitch != 0.0 or ring.roll != 0.0 for ring in self.rings)
        names = [*(("level_max", "level_rms") if level else ())]
        names += [*(("tilt_max", "tilt_rms") if tilted else ())]
        judged = ("bench_against_module", "field_magnitude_difference", "temperature_change")
        return (*names, *judged)
