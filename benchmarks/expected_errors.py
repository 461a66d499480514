"""Expected beside achieved heading error of every method, over good units through the whole bench.

Run:  python benchmarks/expected_errors.py --units 40
      python benchmarks/expected_errors.py --units 40 --procedure quick

For each unit the record's `study.expected` is what the unit's own truth-aided fit said before the
verification; `achieved` is what the verification found. Prints, for each method, level and tilted
apart: the median of achieved RMS and of the method's own claim, expected over achieved of the RMS
pooled over the units with two standard errors, the 5th and 95th percentile of the units' own
ratios, the same of the maximum, and how many units the report marks as wrong without saying so.
Exits 1 where a pooled ratio is outside 0.8 to 1.25 after its two standard errors.
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
from typing import Any, Final

import numpy as np

NEAR: Final = (0.8, 1.25)
KINDS: Final = ("level", "tilt")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """Expected over achieved of one method and kind, over units."""

    method: str
    kind: str
    achieved_deg: float
    claimed_deg: float
    rms: float
    rms_se: float
    low: float
    high: float
    maximum: float
    marked: int
    units: int


def run_unit(number: int, procedure: str) -> dict[str, Any]:
    """Return what one unit's record says: expected, achieved and claimed errors by method."""
    from bench.cli.run_command import RunRequest, run_procedure
    from bench.record.document import read_record
    from bench.record.method_study import method_rows

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        request = RunRequest(
            procedure=procedure, serial=f"EX{number:04d}", seed=number, out=out,
            no_input=True, dashboard=False, quiet=True,
        )  # fmt: skip
        run_procedure(request)
        record = read_record(out / "latest")
    return {
        "expected": record["study"].get("expected") or {},
        "achieved": {fit["method"]: fit["achieved"] for fit in record["fits"]}
        | {"raw": record["study"]["raw"]},
        "claimed": {fit["method"]: fit["predicted_heading_rms_deg"] for fit in record["fits"]},
        "marked": {row.key for row in method_rows(record) if row.unsaid},
    }


def run_units(count: int, workers: int, procedure: str) -> list[dict[str, Any]]:
    """Run units 1 to `count`, several at a time."""
    run = partial(run_unit, procedure=procedure)
    if workers == 1:
        return [run(number) for number in range(1, count + 1)]
    with ProcessPoolExecutor(workers) as pool:
        return list(pool.map(run, range(1, count + 1)))


def ratio_of(units: list[dict[str, Any]], method: str, kind: str) -> Ratio | None:
    """Return a method's ratio over the units that have both errors."""
    pairs = [
        (unit["expected"][method], unit["achieved"][method])
        for unit in units
        if method in unit["expected"]
        and unit["achieved"].get(method, {}).get(f"{kind}_rms_deg") is not None
    ]
    if len(pairs) < 2:
        return None
    expected, achieved = (
        np.array([[side[f"{kind}_{part}_deg"] for part in ("rms", "max")] for side in sides])
        for sides in zip(*pairs, strict=True)
    )
    squares = expected[:, 0] ** 2, achieved[:, 0] ** 2
    pooled = float(np.sqrt(squares[0].sum() / squares[1].sum()))
    spread = (squares[0] - pooled**2 * squares[1]).std(ddof=1) / np.sqrt(len(pairs))
    claims = [unit["claimed"].get(method) for unit in units]
    low, high = np.percentile(expected[:, 0] / achieved[:, 0], [5, 95])
    return Ratio(
        method=method,
        kind=kind,
        achieved_deg=float(np.median(achieved[:, 0])),
        claimed_deg=float(np.median([c for c in claims if c is not None] or [np.nan])),
        rms=pooled,
        rms_se=float(spread / squares[1].mean() / (2.0 * pooled)),
        low=float(low),
        high=float(high),
        maximum=float(expected[:, 1].mean() / achieved[:, 1].mean()),
        marked=sum(method in unit["marked"] for unit in units),
        units=len(pairs),
    )


def ratios(units: list[dict[str, Any]]) -> list[Ratio]:
    """Return the ratios of raw readings and of every method, level and tilted."""
    methods = list(dict.fromkeys(name for unit in units for name in unit["expected"]))
    found = (ratio_of(units, method, kind) for method in methods for kind in KINDS)
    return [ratio for ratio in found if ratio is not None]


def complaints(found: list[Ratio]) -> list[str]:
    """Return a sentence for each ratio that is not near one."""
    return [
        f"{r.method}, {r.kind}: expected over achieved is {r.rms:.2f} +- {2.0 * r.rms_se:.2f}"
        for r in found
        if r.rms + 2.0 * r.rms_se < NEAR[0] or r.rms - 2.0 * r.rms_se > NEAR[1]
    ]


def show(found: list[Ratio], units: int, elapsed_s: float) -> None:
    """Print the table."""
    print(f"{units} good units, {elapsed_s:.0f} s; RMS heading error, deg; ratio expected/achieved")
    print(
        f"{'method':<16}{'poses':<7}{'claimed':>9}{'achieved':>9}{'ratio':>8}{'+-2se':>7}"
        f"{'5 %':>7}{'95 %':>7}{'max':>7}{'unsaid':>9}"
    )
    for r in found:
        print(
            f"{r.method:<16}{r.kind:<7}{r.claimed_deg:9.3f}{r.achieved_deg:9.3f}{r.rms:8.3f}"
            f"{2.0 * r.rms_se:7.3f}{r.low:7.2f}{r.high:7.2f}{r.maximum:7.2f}"
            f"{r.marked:5d}/{r.units:d}"
        )


def main() -> int:
    """Run the study and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=40)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--procedure", default="eol_three_axis")
    arguments = parser.parse_args()
    started_s = time.perf_counter()
    units = run_units(arguments.units, arguments.workers, arguments.procedure)
    found = ratios(units)
    show(found, len(units), time.perf_counter() - started_s)
    missed = complaints(found)
    for sentence in missed:
        print(f"NOT MET: {sentence}")
    return int(bool(missed) or not found)


if __name__ == "__main__":
    sys.exit(main())
