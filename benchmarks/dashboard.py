"""What the rerun recording costs a tick of a run, beside logging sample by sample.

Run:  python benchmarks/dashboard.py

Makes one end-of-line run, then its recording, and prints the time of the recording divided by
the run's ticks; the baseline logs the same headings and errors of some thousand samples with
one ``rr.log`` call each, as rerun's own examples do.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Final

import rerun as rr

from bench.cli.run_command import RunRequest, run_procedure
from dashboards.recorder import write_recording
from dashboards.run_view import RunView

if TYPE_CHECKING:
    from dashboards.run_view import Block

LIMIT_US: Final = 30.0
REPEATS: Final = 3
BASELINE_SAMPLES: Final = 2000


def recorder_us(folder: Path, ticks: int) -> float:
    """Return the best time of the whole recording, in microseconds a tick of the run."""
    times_s = []
    for _ in range(REPEATS):
        started_s = time.perf_counter()
        write_recording(folder / "again.rrd")
        times_s.append(time.perf_counter() - started_s)
    return 1e6 * min(times_s) / ticks


def baseline_us(folder: Path, block: Block) -> float:
    """Return the time of logging one sample's headings and errors call by call, in microseconds."""
    recording = rr.RecordingStream("compass_bench_baseline", recording_id="baseline")
    recording.save(folder / "baseline.rrd")
    headings = {"raw": block.raw_deg, "reference": block.reference_deg}
    headings["module"] = block.samples["heading_deg"]
    started_s = time.perf_counter()
    for row in range(BASELINE_SAMPLES):
        recording.set_time("sim_time", duration=float(block.samples["t_s"][row]))
        recording.set_time("tick", sequence=int(block.samples["tick"][row]))
        for name, heading_deg in headings.items():
            recording.log(f"heading_deg/{name}", rr.Scalars(float(heading_deg[row])))
    recording.flush()
    elapsed_s = time.perf_counter() - started_s
    recording.disconnect()
    return 1e6 * elapsed_s / BASELINE_SAMPLES


def main() -> int:
    """Print both costs and their ratio; return 1 where the recorder is over its budget."""
    with tempfile.TemporaryDirectory() as out:
        request = RunRequest(
            procedure="eol_three_axis",
            serial="SN0001",
            out=Path(out),
            no_input=True,
            dashboard=False,
            quiet=True,
        )
        run_procedure(request)
        folder = Path(out) / "latest"
        run = RunView(folder)
        ticks = int(run.record["run"]["ticks"])
        cost_us = recorder_us(folder, ticks)
        by_sample_us = baseline_us(folder, next(run.blocks()))
        size_mb = (folder / "again.rrd").stat().st_size / 1e6
    print(f"recording of {ticks} ticks: {cost_us:.1f} us a tick, {size_mb:.1f} MB")
    print(f"baseline, rr.log of three headings a sample: {by_sample_us:.0f} us a tick")
    print(f"ratio baseline/recording: {by_sample_us / cost_us:.1f}")
    print(f"budget {LIMIT_US:g} us a tick: {'met' if cost_us <= LIMIT_US else 'NOT MET'}")
    return int(cost_us > LIMIT_US)


if __name__ == "__main__":
    sys.exit(main())
