"""What the run knows of its bridges' temperature, written down as it goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bench.run_context import RunContext


def record_temperature_terms(context: RunContext) -> None:
    """Write down the temperature coefficients that all readings so far tell.

    Nothing is told where set and reset readings were made from one recorded value.
    """
    from bench.acceptance.bridge_terms import temperature_terms

    if context.synthesised:
        return
    station = context.station
    drift_sd_mg = station.surroundings.u_drift_mg / 2.0
    context.recorder.set(
        "bridge_terms",
        temperature_terms(context.readings, context.judged_fit, station, drift_sd_mg=drift_sd_mg),
    )
