"""Fit by several methods on the same readings, judge the one whose coefficients count."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bench.steps.step import OnMiss, Step

if TYPE_CHECKING:
    from bench.calibration.fit import CalibrationData, Fit
    from bench.run_context import RunContext

Method = Literal["min_max", "ellipsoid", "accelerometer", "truth_aided"]

FIT_NAMES = ("fit_accepted", "fit_residual")
TRUTH_NAMES = (
    "fit_condition",
    "sensitivity",
    "accel_bias",
    "accel_residual",
    "field_azimuth_difference",
    "dip_difference",
)


class FitMethods(Step):
    """Fit; the first method of `judged` that accepts the data is judged and may be written."""

    kind: Literal["fit"]
    on_miss: OnMiss = "stop"
    methods: Annotated[list[Method], Field(min_length=1)]
    """Methods to fit and rank, all on the same readings."""
    judged: Annotated[list[Method], Field(min_length=1)]
    """Method that is judged; further ones are tried where the data do not allow the first."""

    def run(self, context: RunContext) -> None:
        """Fit, write all results down, judge one.

        A refusal is a measurement (`fit_accepted`), with the method's reason in its note.
        """
        from bench.acceptance.fit_evaluation import evaluate_fit
        from bench.calibration.methods import fit_named

        data = self._data(context)
        for name in dict.fromkeys([*self.methods, *self.judged]):
            fit = fit_named(name, data)
            context.fits[name] = fit
            context.recorder.fit(fit)
        judged = self._judged(context.fits)
        if not judged.refused:
            context.judged_fit = judged
        context.judge(evaluate_fit(context.step_name, judged, context.station))

    def _data(self, context: RunContext) -> CalibrationData:
        from bench.acceptance.site import calibration_data, recording_data

        if context.recording is not None:
            return recording_data(context.recording)
        readings = context.readings_at(context.calibration_positions)
        return calibration_data(readings, context.station)

    def _judged(self, fits: dict[str, Fit]) -> Fit:
        accepted = [fits[name] for name in self.judged if not fits[name].refused]
        return accepted[0] if accepted else fits[self.judged[0]]

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        return FIT_NAMES + (TRUTH_NAMES if self.judged == ["truth_aided"] else ())
