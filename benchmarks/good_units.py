"""How many good units pass: other serials and seeds through the whole bench over CAN.

Run:  python benchmarks/good_units.py --units 200
      python benchmarks/good_units.py --units 34 --procedure four_position

Prints the share that passes, the statistics behind the limits, and every unit that did not
pass with its first failure; exits 1 where less than 97 % pass, the median of the raw
heading error's maximum leaves 20 to 60 deg (three-axis units), or a unit verifies to an error
of zero. Without --procedure the main one runs.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

PASS_SHARE: Final = 0.97
RAW_MEDIAN_DEG: Final = (20.0, 60.0)
TWO_AXIS: Final = "eol_two_axis"
"""Procedure of units with less hard iron."""
SHOWN: Final = (
    "raw_max",
    "level_max",
    "level_rms",
    "tilt_max",
    "tilt_rms",
    "achieved_level_max",
    "achieved_level_rms",
    "repeatability",
    "closing_error",
    "hysteresis",
    "fit_residual",
    "field_azimuth_difference",
    "dip_difference",
    "field_magnitude_difference",
    "z_estimate_difference",
    "sensitivity",
    "temperature_change",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitResult:
    """What one unit's run gave."""

    serial: str
    seed: int
    outcome: str
    first_failure: str | None
    reason: str
    values: dict[str, float]


def run_unit(number: int, procedure: str) -> UnitResult:
    """Run a procedure on one virtual unit; every number is another serial and seed."""
    from bench.cli.run_command import RunRequest, run_procedure
    from bench.record.document import read_record

    serial = f"GU{number:04d}"
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        run_procedure(
            RunRequest(
                procedure=procedure,
                serial=serial,
                seed=number,
                out=out,
                no_input=True,
                dashboard=False,
                quiet=True,
            )
        )
        record = read_record(out / "latest")
    values = {m["name"]: m["value"] for m in record["measurements"] if m["value"] is not None}
    return UnitResult(
        serial=serial,
        seed=number,
        outcome=record["verdict"]["outcome"],
        first_failure=record["first_failure"],
        reason=record["verdict"]["reason"],
        values=values,
    )


def run_units(count: int, workers: int, procedure: str) -> list[UnitResult]:
    """Run units 1 to `count`, several at a time."""
    run = partial(run_unit, procedure=procedure)
    if workers == 1:
        return [run(number) for number in range(1, count + 1)]
    with ProcessPoolExecutor(workers) as pool:
        return list(pool.map(run, range(1, count + 1)))


def complaints(results: list[UnitResult], procedure: str) -> list[str]:
    """Return a sentence for each demand on good units that the results do not meet."""
    found = []
    share = np.mean([result.outcome == "PASS" for result in results])
    if share < PASS_SHARE:
        found.append(f"{100 * share:.1f} % of good units pass; {100 * PASS_SHARE:.0f} % are needed")
    raw = [result.values["raw_max"] for result in results if "raw_max" in result.values]
    median_deg = float(np.median(raw)) if raw else None
    of_three_axes = median_deg is not None and procedure != TWO_AXIS
    if of_three_axes and not RAW_MEDIAN_DEG[0] <= median_deg <= RAW_MEDIAN_DEG[1]:
        found.append(f"median of the raw heading error's maximum is {median_deg:.1f} deg")
    zero = [r.serial for r in results if r.values.get("level_max", 1.0) <= 0.01]
    if zero:
        found.append(f"verified to an error of zero: {', '.join(zero)}")
    return found


def show(results: list[UnitResult], elapsed_s: float) -> None:
    """Print the statistics."""
    passed = sum(result.outcome == "PASS" for result in results)
    print(
        f"{passed} of {len(results)} good units pass "
        f"({100 * passed / len(results):.1f} %), {elapsed_s:.0f} s"
    )
    print(f"{'measurement':<26}{'p50':>9}{'p95':>9}{'p99':>9}{'max':>9}")
    for name in SHOWN:
        values = [result.values[name] for result in results if name in result.values]
        if values:
            quantiles = np.percentile(values, [50, 95, 99, 100])
            print(f"{name:<26}" + "".join(f"{value:9.3f}" for value in quantiles))
    for result in results:
        if result.outcome != "PASS":
            print(f"{result.serial} seed {result.seed}: {result.outcome}, {result.reason}")


def main() -> int:
    """Run the study and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--procedure", default="eol_three_axis")
    arguments = parser.parse_args()
    started_s = time.perf_counter()
    results = run_units(arguments.units, arguments.workers, arguments.procedure)
    show(results, time.perf_counter() - started_s)
    found = complaints(results, arguments.procedure)
    for sentence in found:
        print(f"NOT MET: {sentence}")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
