"""Fit by several methods on the same readings, judge the one whose coefficients count."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bench.calibration.fit import Cause
from bench.steps.step import OnMiss, Step

if TYPE_CHECKING:
    from bench.calibration.fit import CalibrationData, Fit
    from bench.run_context import RunContext

Method = Literal["min_max", "ellipsoid", "accelerometer", "truth_aided"]

FIT_NAMES = ("fit_accepted",)
NOT_ENOUGH = frozenset(
    {
        Cause.TOO_FEW,
        Cause.NO_TURN,
        Cause.NOT_OBSERVABLE,
        Cause.TILT_TOO_SMALL,
        Cause.NO_ACCELERATION,
        Cause.NO_TRUTH,
    }
)
"""Causes for which a simpler method may be tried; for others the readings themselves are bad."""
TRUTH_NAMES = (
    "fit_residual",
    "fit_condition",
    "sensitivity",
    "accel_bias",
    "accel_residual",
    "field_azimuth_difference",
    "dip_difference",
)


class FitMethods(Step):
    """Fit; the first method of `judged` for which the data suffice is judged and may be written."""

    kind: Literal["fit"]
    on_miss: OnMiss = "stop"
    methods: Annotated[list[Method], Field(min_length=1)]
    """Methods to fit and rank, all on the same readings."""
    judged: Annotated[list[Method], Field(min_length=1)]
    """Method that is judged; a further one is tried where the data are not enough for the first."""

    def run(self, context: RunContext) -> None:
        """Fit, write all results down, judge one.

        A refusal is a measurement (`fit_accepted`), with the method's reason in its note.
        """
        from bench.acceptance.fit_evaluation import evaluate_fit

        data = self._data(context)
        for name in dict.fromkeys([*self.methods, *self.judged]):
            fit = context.compute(partial(_fit, name, data))
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
        for name in self.judged:
            if fits[name].cause not in NOT_ENOUGH:
                return fits[name]
        return fits[self.judged[0]]

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        return FIT_NAMES + (TRUTH_NAMES if self.judged == ["truth_aided"] else ())


def _fit(name: str, data: CalibrationData) -> Fit:
    from bench.calibration.methods import fit_named  # slow where it is the first

    return fit_named(name, data)
