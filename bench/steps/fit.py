"""Fit by several methods on the same readings, judge the one whose coefficients count."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from bench.calibration.fit import Cause
from bench.calibration.method_names import MethodName
from bench.steps.step import OnMiss, Step

if TYPE_CHECKING:
    from bench.acceptance.bridge_terms import CorrectedFits
    from bench.calibration.fit import CalibrationData, Fit
    from bench.run_context import RunContext

FIT_NAMES = ("fit_accepted",)
NOT_ENOUGH = frozenset(
    {
        Cause.TOO_FEW,
        Cause.NO_TURN,
        Cause.POSITIONS_NOT_SQUARE,
        Cause.NOT_OBSERVABLE,
        Cause.BLIND_AZIMUTH,
        Cause.TILT_TOO_SMALL,
        Cause.NO_ACCELERATION,
        Cause.NO_TRUTH,
        Cause.NO_SET_RESET,
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
TWO_AXIS_NAMES = ("fit_residual", "dip_difference")
REQUIRED: Final[dict[str, tuple[str, ...]]] = {
    "truth_aided": TRUTH_NAMES,
    "two_axis": TWO_AXIS_NAMES,
    "two_axis_aided": (*TWO_AXIS_NAMES, "field_azimuth_difference"),
}
"""What each method tells beyond its acceptance and must tell where it is judged."""


class FitMethods(Step):
    """Fit; the first method of `judged` for which the data suffice is judged and may be written."""

    kind: Literal["fit"]
    on_miss: OnMiss = "stop"
    methods: Annotated[list[MethodName], Field(min_length=1)]
    """Methods to fit and rank, all on the same readings."""
    judged: Annotated[list[MethodName], Field(min_length=1)]
    """Method that is judged; a further one is tried where the data are not enough for the first."""

    @model_validator(mode="after")
    def _judged_is_fitted(self) -> Self:
        for name in self.judged:
            if name not in self.methods:
                message = (
                    f"judged must name methods that are fitted ({', '.join(self.methods)}); "
                    f"instead received {name}"
                )
                raise ValueError(message)
        return self

    def run(self, context: RunContext) -> None:
        """Fit, write all results down, judge one.

        A refusal is a measurement (`fit_accepted`), with the method's reason in its note.
        """
        from bench.acceptance.bridge_terms import CorrectedFits
        from bench.acceptance.fit_evaluation import evaluate_fit

        fits = context.compute(partial(CorrectedFits, self._data(context)))
        self._record_terms(context, fits)
        for name in dict.fromkeys(self.methods):
            fit = context.compute(partial(fits.fit, name))
            context.fits[name] = fit
            context.recorder.fit(fit)
        judged = self._judged(context.fits)
        if not judged.refused:
            context.judged_fit = judged
        context.judge(evaluate_fit(context.step_name, judged, context.station))

    def _record_terms(self, context: RunContext, fits: CorrectedFits) -> None:
        from bench.acceptance.bridge_terms import calibration_terms, cross_axis_term

        terms = {"hk_mg": cross_axis_term(fits.cross)}
        if context.recording is None:
            readings = context.readings_at(context.calibration_positions)
            terms = calibration_terms(readings, context.poses, fits.cross)
        context.recorder.set("bridge_terms", terms)

    def _data(self, context: RunContext) -> CalibrationData:
        from bench.acceptance.site import calibration_data, recording_data

        if context.recording is not None:
            return recording_data(context.recording)
        readings = context.readings_at(context.calibration_positions)
        return calibration_data(readings, context.station, paired=not context.synthesised)

    def _judged(self, fits: dict[str, Fit]) -> Fit:
        for name in self.judged:
            if fits[name].cause not in NOT_ENOUGH:
                return fits[name]
        return fits[self.judged[0]]

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        common = [name for name in REQUIRED.get(self.judged[0], ()) if self._all_tell(name)]
        return (*FIT_NAMES, *common)

    def _all_tell(self, name: str) -> bool:
        return all(name in REQUIRED.get(method, ()) for method in self.judged)
