"""Judge the heading that the module itself sends, on poses that no fit has used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bench.steps.bridge_terms import record_temperature_terms
from bench.steps.comparison import compare_methods
from bench.steps.deviation import deviation_entry
from bench.steps.ring_step import RingStep

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bench.run_context import RunContext
    from protocols.uds import Coefficients


class Verify(RingStep):
    """Heading error level and tilted, agreement with the bench's own heading, temperature.

    None of the poses may be a calibration pose. All fits of the run are ranked on the same poses.
    """

    kind: Literal["verify"]

    def run(self, context: RunContext) -> None:
        """Visit the poses and judge.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        import numpy as np

        from bench.acceptance.heading_evaluation import evaluate_verification
        from bench.acceptance.heading_uncertainty import uncertainty_section, verification_budget

        name, station = context.step_name, context.station
        coefficients = context.written
        if coefficients is None:
            coefficients = context.module.diagnostics.read_coefficients()
            context.recorder.set("coefficients", {"before": coefficients})
        first = len(context.verification_samples)
        readings = context.visit(self.poses(), verifies=True, sentinel=self.sentinel)
        samples = np.concatenate(context.verification_samples[first:])
        baseline_mg = context.field_watch.baseline_mg
        budget = verification_budget(
            readings, coefficients, station, context.limits.unit, baseline_mg
        )
        judged = context.judge(
            evaluate_verification(name, readings, samples, coefficients, station, budget=budget)
        )
        if budget is not None:
            section = uncertainty_section(readings, budget, judged, station)
            context.recorder.set("uncertainty", section)
        self._judge_surroundings(context, readings, coefficients)
        context.verified = True
        compensated = deviation_entry(readings["heading_deg"], readings, station)
        context.recorder.set("deviation", {"compensated": compensated})
        record_temperature_terms(context)
        compare_methods(context, readings)

    def _judge_surroundings(
        self, context: RunContext, readings: NDArray[np.void], coefficients: Coefficients
    ) -> None:
        """Judge field strength and temperature, as far as the run can tell them."""
        from bench.acceptance.heading_evaluation import (
            evaluate_field_strength,
            evaluate_temperature,
        )
        from bench.acceptance.two_axis_evaluation import evaluate_z_estimate

        name, station = context.step_name, context.station
        if context.written is not None:
            context.judge(evaluate_field_strength(name, readings, coefficients, station))
        else:
            context.not_available.add("field_magnitude_difference")
        if coefficients.horizontal_mg > 0.0:
            context.judge(evaluate_z_estimate(name, readings, coefficients))
        if context.calibration_positions:
            before = context.readings_at(context.calibration_positions)
            context.judge(evaluate_temperature(name, before, readings))
        else:
            context.not_available.add("temperature_change")

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        level = ("level_max", "level_rms") if self.has_level else ()
        tilted = ("tilt_max", "tilt_rms") if self.has_tilted else ()
        judged = ("bench_against_module", "field_magnitude_difference", "temperature_change")
        return (*level, *tilted, *judged)
