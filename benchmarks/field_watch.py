"""What a forklift beside the rig costs a good unit: watched by a reference, by sentinels, or not.

Run:  python benchmarks/field_watch.py --units 4

Every good unit goes through eol_three_axis (the truth-aided method alone, without the last turns)
once undisturbed and once with the catalogue's forklift arriving in the level sweep, among the
tilted poses and in the verification; at a station with a reference magnetometer, at one whose
sentinel poses take its place, and at one with neither. Printed are the outcomes, the heading
errors over the verification poses (mean and worst of the units), the poses that were repeated and
the time. Exits 1 where a unit does not pass at the station with the reference, or where its mean
error with the forklift is larger than without by more than `WITHIN_DEG`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core, before numpy reads it

import argparse
import json
import statistics
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from bench.cli.run_command import RunRequest, run_procedure
from bench.procedure_loader import procedure_path
from bench.shipped import find_file

STEPS: Final = ("level_sweep", "tilted_poses", "verify")
WATCHES: Final = ("reference", "sentinels", "none")
ARRIVES_TICKS: Final = 450
"""So many ticks before a step's start a forklift must set out to come near amid its poses."""
WITHIN_DEG: Final = 0.1
"""Means of few units differ by themselves: one visit repeats to 0.07 deg."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What one run came to."""

    outcome: str
    level_max_deg: float
    tilt_max_deg: float
    repeated: int
    largest_change_mg: float
    simulated_s: float
    starts_s: dict[str, float]


def write_files(folder: Path) -> None:
    """Write the procedure with and without sentinels, and the station with and without a sensor."""
    procedure = yaml.safe_load(procedure_path("eol_three_axis").read_text(encoding="utf-8"))
    procedure["steps"] = [step for step in procedure["steps"] if step["kind"] != "returns"]
    for step in procedure["steps"]:
        if step["kind"] == "fit":
            step["methods"] = ["truth_aided"]
    station = yaml.safe_load(find_file("stations", "default").read_text(encoding="utf-8"))
    for watch in WATCHES:
        if watch == "none":
            for step in procedure["steps"]:
                step.pop("sentinel", None)
        if watch != "reference":
            station.pop("reference", None)
        for name, document in (("procedure", procedure), ("station", station)):
            text = yaml.safe_dump(document, sort_keys=False)
            (folder / f"{watch}_{name}.yaml").write_text(text, encoding="utf-8")


def run_of(folder: Path, watch: str, unit: int, faults: tuple[str, ...]) -> Run:
    """Run the procedure on one unit and return what came of it."""
    out = folder / f"{watch}_{unit}_{'_'.join(faults) or 'still'}"
    run_procedure(
        RunRequest(
            procedure=str(folder / f"{watch}_procedure.yaml"),
            site=folder / f"{watch}_station.yaml",
            serial=f"SN{unit:04d}",
            seed=unit,
            faults=faults,
            out=out,
            no_input=True,
            dashboard=False,
            quiet=True,
        )
    )
    record: dict[str, Any] = json.loads((out / "latest" / "record.json").read_text("utf-8"))
    values = {each["name"]: each["value"] for each in record["measurements"]}
    field = record["field_watch"]
    return Run(
        outcome=record["verdict"]["outcome"],
        level_max_deg=values.get("level_max") or float("nan"),
        tilt_max_deg=values.get("tilt_max") or float("nan"),
        repeated=len(field["spoiled"]),
        largest_change_mg=field["largest_change_mg"] or 0.0,
        simulated_s=record["run"]["simulated_s"],
        starts_s={step["name"]: step["started_s"] for step in record["steps"]},
    )


def runs_of(folder: Path, units: int) -> dict[tuple[str, str], list[Run]]:
    """Return the runs of every unit by watch and by the step in which the forklift came."""
    found: dict[tuple[str, str], list[Run]] = {}
    for unit in range(1, units + 1):
        for watch in WATCHES:
            still = run_of(folder, watch, unit, ())
            found.setdefault((watch, "never"), []).append(still)
            for step in STEPS:
                tick = max(1, round(100.0 * still.starts_s[step]) - ARRIVES_TICKS)
                run = run_of(folder, watch, unit, (f"forklift@{tick}",))
                found.setdefault((watch, step), []).append(run)
    return found


def show(found: dict[tuple[str, str], list[Run]]) -> None:
    """Print one line for each watch and step."""
    print(
        f"{'watched by':<11}{'forklift in':<14}{'outcomes':<20}{'level_max mean, worst':>23}"
        f"{'tilt_max mean, worst':>23}{'repeated':>10}{'change mG':>11}{'time s':>8}"
    )
    for (watch, step), runs in found.items():
        counted = Counter(run.outcome for run in runs)
        outcomes = " ".join(f"{count} {outcome}" for outcome, count in sorted(counted.items()))
        level_deg = [run.level_max_deg for run in runs]
        tilt_deg = [run.tilt_max_deg for run in runs]
        print(
            f"{watch:<11}{step:<14}{outcomes:<20}"
            f"{statistics.mean(level_deg):>15.3f}, {max(level_deg):.3f}"
            f"{statistics.mean(tilt_deg):>16.3f}, {max(tilt_deg):.3f}"
            f"{statistics.mean(run.repeated for run in runs):>10.1f}"
            f"{max(run.largest_change_mg for run in runs):>11.2f}"
            f"{statistics.mean(run.simulated_s for run in runs):>8.0f}"
        )


def is_harmless(found: dict[tuple[str, str], list[Run]]) -> bool:
    """Whether every unit passed under the reference and was judged as without the forklift."""
    for name in ("level_max_deg", "tilt_max_deg"):
        still_deg = statistics.mean(getattr(run, name) for run in found["reference", "never"])
        for step in STEPS:
            runs = found["reference", step]
            mean_deg = statistics.mean(getattr(run, name) for run in runs)
            passed = all(run.outcome in ("PASS", "MARGINAL") for run in runs)
            if not passed or mean_deg > still_deg + WITHIN_DEG:
                return False
    return True


def main() -> int:
    """Run all units and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=4)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_files(folder)
        found = runs_of(folder, options.units)
    show(found)
    return 0 if is_harmless(found) else 1


if __name__ == "__main__":
    sys.exit(main())
