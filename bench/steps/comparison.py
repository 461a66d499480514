"""All methods of the run on the poses of one step: study and ranking, for verify and compare."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bench.run_context import RunContext

MAXIMA: Final = ("level_max", "tilt_max", "achieved_level_max", "achieved_tilt_max")
"""Measurements whose uncertainty is that of a method's largest error."""


def compare_methods(context: RunContext, readings: NDArray[np.void]) -> None:
    """Write down what every method achieves on verification poses, and which is the best.

    Where the judged method is not the best, by more than the uncertainty of a largest error, an
    event `better_method` says so: it is for the engineer and changes no verdict.
    """
    from bench.acceptance.method_comparison import (
        achieved_by,
        evaluate_rank,
        expected_of,
        ranking,
        study_of,
    )

    compared = context.compute(partial(study_of, context.fits, readings, context.station))
    achieved = achieved_by(context.fits, compared)
    for name, fit in context.fits.items():
        context.recorder.fit(fit, achieved[name])
    ranked = ranking(achieved)
    change_g = _zero_change_g(context, readings)
    expected = context.compute(
        partial(expected_of, context.fits, readings, context.station, change_g)
    )
    context.recorder.set("study", {**compared.as_dict(), **expected})
    context.recorder.set("ranking", ranked)
    if context.judged_fit is None:
        return
    judged = context.judged_fit.method
    for behind in context.judge(evaluate_rank(context.step_name, judged, achieved)):
        uncertainty_deg = _uncertainty_deg(context)
        if behind.value > uncertainty_deg:
            context.event(
                "better_method",
                judged=judged,
                best=ranked[0],
                behind_deg=behind.value,
                uncertainty_deg=uncertainty_deg,
            )


def _zero_change_g(context: RunContext, readings: NDArray[np.void]) -> float:
    """Return what the accelerometer's zero moves after the calibration; 0 of an unknown part."""
    from bench.uncertainty.zero_change import zero_change_g

    unit = context.limits.unit
    before = context.readings_at(context.calibration_positions)
    return 0.0 if unit is None else zero_change_g(before, readings, unit)


def _uncertainty_deg(context: RunContext) -> float:
    """Return the largest U of the largest errors that the run has judged."""
    return max(
        (one.uncertainty or 0.0 for one in context.measurements if one.name in MAXIMA), default=0.0
    )
