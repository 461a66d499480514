"""`compass-bench plan`: a procedure laid out, without a bus."""

from __future__ import annotations

import json as json_module
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.table import Table

from bench.plan import (
    LEVEL_ONLY,
    expected_load_percent,
    predictions,
    require_load,
    require_observable,
)
from bench.run_files import load_run_files

if TYPE_CHECKING:
    from pathlib import Path

    from bench.calibration.planned_poses import Prediction
    from bench.plan import Plan


def show_plan(
    procedure: str, *, site: Path | None, limits: Path | None, bitrate: int, json: bool
) -> int:
    """Print poses, travel, time, cable, bus load and the accuracy to expect.

    Raises
    ------
    ConfigError
        If a file cannot be used, a limit is missing, a pose cannot be reached, the bus would be
        too busy or, after the plan is printed, if the poses suffice for no judged method.
    """
    files = load_run_files(procedure, site=site, limits=limits)
    plan = files.plan
    load_percent = expected_load_percent(
        with_rig=files.procedure.uses_rig,
        with_reference=files.station.reference is not None,
        bitrate=bitrate,
    )
    require_load(load_percent)
    predicted = predictions(files.procedure, files.station)
    if json:
        document = asdict(plan) | {
            "bus_load_worst_percent": load_percent,
            "predictions": [_entry(prediction) for prediction in predicted],
        }
        typer.echo(json_module.dumps(document, indent=1))
    else:
        _print_plan(plan, load_percent, predicted)
    require_observable(files.procedure, predicted)
    return 0


def _entry(prediction: Prediction) -> dict[str, Any]:
    return {**asdict(prediction), "level_only": prediction.method in LEVEL_ONLY}


def _print_plan(plan: Plan, load_percent: float, predicted: list[Prediction]) -> None:
    console = Console(highlight=False)
    table = Table("position", "step", "azimuth", "pitch", "roll", "approach", "travel", "dwell")
    approach = {1: "clockwise", -1: "counter-clockwise", 0: ""}
    for move in plan.moves:
        attitude = move.attitude
        table.add_row(
            str(move.position),
            move.step,
            f"{attitude.azimuth_deg:.1f} deg",
            f"{attitude.pitch_deg:.0f} deg",
            f"{attitude.roll_deg:.0f} deg",
            approach[move.direction],
            f"{move.travel_s:.2f} s",
            f"{move.dwell_s:.2f} s",
        )
    console.print(table)
    steps = Table("step", "kind", "positions", "time")
    for step in plan.steps:
        most = f", at most {step.most_poses}" if step.most_poses > step.poses else ""
        longest = f", at most {step.longest_s:.1f} s" if most else ""
        seconds = f"{step.duration_s:.1f} s{longest}"
        steps.add_row(step.name, step.kind, f"{step.poses}{most}", seconds)
    console.print(steps)
    longest = f" (at most {plan.longest_s:.0f} s)" if plan.longest_s > plan.duration_s else ""
    console.print(
        f"{plan.procedure} {plan.version}: {len(plan.moves)} positions, {plan.samples} samples, "
        f"{plan.duration_s:.0f} s{longest}; cable winds from {plan.wound_low_deg:.0f} to "
        f"{plan.wound_high_deg:.0f} deg; bus load at worst {load_percent:.0f} %",
        soft_wrap=True,
    )
    if predicted:
        console.print(_prediction_table(predicted))


def _prediction_table(predicted: list[Prediction]) -> Table:
    table = Table("method", "rank", "condition", "heading error to expect (rms, max)", "remark")
    for one in predicted:
        rms, largest = one.predicted_heading_rms_deg, one.predicted_heading_max_deg
        where = ", level only" if one.method in LEVEL_ONLY else ""
        table.add_row(
            one.method,
            "" if one.rank is None else str(one.rank),
            "" if one.condition is None else f"{one.condition:.0f}",
            "" if rms is None or largest is None else f"{rms:.3f} deg, {largest:.3f} deg{where}",
            one.message,
        )
    return table
