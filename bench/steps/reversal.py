"""Separate the seat from the unit by what it read in several mountings."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from bench.quantity import Degrees
from bench.steps.step import Step

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bench.calibration.mountings import Mounting
    from bench.run_context import RunContext

REVERSAL_NAMES: Final = (
    "fit_accepted",
    "seat_index_change",
    "seat_level_change",
    "fixture_iron_change",
    "field_azimuth_change",
    "dip_change",
    "fit_residual",
    "seating",
)
"""Measurements of `reversal_evaluation.evaluate_reversal`."""


class Reversal(Step):
    """Seat index, level, fixture iron and field azimuth against the station's file."""

    kind: Literal["reversal"]
    seating_uncertainty: Annotated[Degrees, Field(ge=0.0, le=1.0)] = 0.02
    """U (k = 2) of each of the three turns of a unit that is put in again."""

    def run(self, context: RunContext) -> None:
        """Separate and judge; the values stand in the record's section `reversal`.

        A refusal is a measurement (`fit_accepted`) with its reason. What the mountings cannot
        tell is not judged.
        """
        from bench.acceptance.reversal_evaluation import (
            doubts_of,
            evaluate_reversal,
            former_values,
            reversal_of,
            reversal_section,
        )

        mounted = self._mounted(context)
        doubts = doubts_of(context.station, self.seating_uncertainty)
        former = former_values(context.station)
        found = context.compute(
            partial(reversal_of, mounted, context.station, doubts, paired=not context.synthesised)
        )
        context.recorder.set("reversal", reversal_section(found, former, doubts, mounted))
        judged = context.judge(evaluate_reversal(context.step_name, found, former))
        if not found.refused:
            context.not_available |= set(REVERSAL_NAMES) - {one.name for one in judged}

    def _mounted(self, context: RunContext) -> list[tuple[Mounting, NDArray[np.void]]]:
        """Return the calibration readings of each mounting in order; empty ones are left out."""
        begins = [first for _, first in context.mountings]
        ends = [*begins[1:], len(context.poses)]
        found = []
        for (mounting, first), end in zip(context.mountings, ends, strict=True):
            positions = [p for p in context.calibration_positions if first <= p < end]
            if positions:
                found.append((mounting, context.readings_at(positions)))
        return found

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        return REVERSAL_NAMES
