"""How well a reversal knows its own accuracy: other seats, rigs and golden units over CAN.

Run:  python benchmarks/reversals.py --benches 40

Draws seats with index, level and iron, sites with another field azimuth, and golden units; runs
`bench_verify` on each; prints, for every value, the RMS of its error, its stated U (k = 2), and
the share of truths inside. Exits 1 where all shares together lie outside 0.90 to 0.99, or a
reversal was refused.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

SHARE: Final = (0.90, 0.99)
SEED: Final = 0x5EA7
VALUES: Final = (
    "index", "pitch", "roll", "iron_x", "iron_y", "iron_z", "field_azimuth", "dip",
)  # fmt: skip


def truth_of(number: int) -> dict[str, float]:
    """Return what is true of a bench, by the names of the record; deg and mG."""
    rng = np.random.default_rng((SEED, number))
    index_deg, pitch_deg, roll_deg = rng.normal(0.0, 1.0, 3) * (0.3, 0.1, 0.1)
    iron_mg = rng.normal(0.0, 1.5, 3)
    values = (index_deg, pitch_deg, roll_deg, *iron_mg, rng.normal(0.0, 0.05), 60.0)
    return dict(zip(VALUES, map(float, values), strict=True))


def verified(number: int, out: Path) -> dict[str, Any]:
    """Run `bench_verify` on one bench and return the record's section `reversal`."""
    from bench.bus import BenchBus
    from bench.executor import execute
    from bench.limit_set import load_limits
    from bench.module import Module
    from bench.procedure_loader import load_procedure
    from bench.record.recorder import RunRecorder
    from bench.rig import Rig
    from bench.run_context import RunContext
    from bench.sample_log import SampleLog
    from bench.station import load_station
    from devices.seat import Seat
    from devices.simulator import SimulatorOptions, build_host
    from protocols.clock import SimulatedClock
    from protocols.link import Wire

    truth, serial = truth_of(number), f"GOLD{number}"
    seat = Seat(
        index_deg=truth["index"], pitch_deg=truth["pitch"], roll_deg=truth["roll"],
        iron_mg=(truth["iron_x"], truth["iron_y"], truth["iron_z"]),
    )  # fmt: skip
    options = SimulatorOptions(
        serial=serial, seed=number, seat=seat, declination_deg=truth["field_azimuth"]
    )
    wire, clock = Wire(), SimulatedClock()
    host = build_host(options, wire.attach())
    wire.add_server(host.serve)
    bus = BenchBus(wire.attach(), clock)
    module, rig = Module(bus), Rig(bus)
    procedure = load_procedure("bench_verify")
    recorder = RunRecorder(out, serial, procedure.name, clock=clock)
    context = RunContext(
        bus=bus, module=module, rig=rig, sample_log=SampleLog(None, module, rig),
        station=load_station("default"), limits=load_limits(procedure.limits), recorder=recorder,
        procedure=procedure, serial=serial,
    )  # fmt: skip
    execute(procedure, context)
    section: dict[str, Any] = recorder.record["reversal"]
    return section


def main() -> int:
    """Print the table; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--benches", type=int, default=40)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path, default=None, help="Write the numbers here as well.")
    given = parser.parse_args()
    numbers = range(given.first, given.first + given.benches)
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(given.jobs) as pool:
        sections = list(pool.map(partial(verified, out=Path(folder)), numbers))
    pairs = list(zip(map(truth_of, numbers), sections, strict=True))
    refused = [section["message"] for _, section in pairs if "found" not in section]
    table = _table([(truth, s["found"]) for truth, s in pairs if "found" in s])
    if given.json is not None:
        given.json.write_text(json.dumps({"refused": refused, "values": table}, indent=1))
    print(f"{given.benches} benches, {len(refused)} refused")
    print(f"{'value':14}{'bias':>9}{'RMS':>9}{'U (k=2)':>9}{'inside':>8}{'worst':>7}")
    for name, row in table.items():
        print(
            f"{name:14}{row['bias']:+9.4f}{row['rms']:9.4f}{row['u']:9.4f}{row['inside']:8.3f}"
            f"{row['worst']:7.2f}"
        )
    share = float(np.mean([row["inside"] for row in table.values()])) if table else 0.0
    print(f"all values: {share:.3f} of the truths within U")
    return 0 if not refused and SHARE[0] <= share <= SHARE[1] else 1


def _table(pairs: list[tuple[dict[str, float], dict[str, Any]]]) -> dict[str, dict[str, float]]:
    table = {}
    for name in VALUES if pairs else ():
        error = np.array([found[name]["value"] - truth[name] for truth, found in pairs])
        u = np.array([found[name]["u"] for _, found in pairs])
        table[name] = {
            "bias": float(error.mean()),
            "rms": float(np.sqrt((error**2).mean())),
            "u": float(u.mean()),
            "inside": float(np.mean(np.abs(error) <= u)),
            "worst": float(np.max(np.abs(error) / u)),
        }
    return table


if __name__ == "__main__":
    sys.exit(main())
