"""What the calibration reaches, what it claims, and what its peers reach: all of it in one run.

Run:  python benchmarks/accuracy.py

Runs the benchmarks below one after the other, with what they print, and closes with one line each:
whether every figure was inside its limits, the last line that it printed, and its time. Exits 1
where any of them missed, with the rest still run.
"""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

HERE: Final = Path(__file__).parent


@dataclass(frozen=True, slots=True, kw_only=True)
class Benchmark:
    """One benchmark: its file and what it holds against what."""

    file: str
    question: str


BENCHMARKS: Final = (
    Benchmark(file="estimators.py", question="achieved error over its bound; 95 % intervals"),
    Benchmark(file="peers.py", question="accuracy and time beside public packages"),
    Benchmark(file="poses.py", question="rig seconds and verified accuracy of sets of poses"),
    Benchmark(file="adaptive.py", question="claims of the adaptive mode, its rule in the loop"),
    Benchmark(file="uncertainty.py", question="certificate intervals; risks near the limit"),
    Benchmark(file="expected_errors.py", question="expected over achieved error by method"),
    Benchmark(file="bridge.py", question="cross-axis, hysteresis and temperature"),
    Benchmark(file="reversals.py", question="seat, iron and field azimuth by reversal"),
    Benchmark(file="field_watch.py", question="vehicles that pass during a run"),
)


def main() -> int:
    """Run all, then print the closing lines."""
    closing, missed = [], 0
    for benchmark in BENCHMARKS:
        print(f"\n== {benchmark.file}: {benchmark.question}", flush=True)
        begun_s = time.perf_counter()
        code, last = run(benchmark)
        missed += code != 0
        word = "met" if code == 0 else f"MISSED ({code})"
        elapsed_s = time.perf_counter() - begun_s
        closing.append(f"{word:10} {benchmark.file:20} {elapsed_s:6.0f} s  {last}")
    print("\n" + "\n".join(closing))
    print(f"{missed} of {len(BENCHMARKS)} missed")
    return 1 if missed else 0


def run(benchmark: Benchmark) -> tuple[int, str]:
    """Run one benchmark, pass its output on, and return its exit code and last line."""
    command = [sys.executable, str(HERE / benchmark.file)]
    last = ""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None  # noqa: S101
        for line in process.stdout:
            print(line, end="", flush=True)
            last = line.strip() or last
    return process.returncode, last


if __name__ == "__main__":
    sys.exit(main())
