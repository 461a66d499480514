"""The product's estimators beside public packages, on the same readings in the same run.

    make peers
    python benchmarks/peers.py [--trials N] [--units N] [--seed N]

Makes an environment for each peer under build/peers/ from the pins in benchmarks/peers/, then
prints for poses all round, tilted to 45 and to 20 deg, 12 and 36 of them, noise of 0.1 % and
1 % of the field: the RMS of the heading error over all trials, that over its bound, the share
without a result, and the share that is wrong without saying so; then times, and what of the
asked is met.

Peers run one unit after the other in processes of their own. Times are of the processor, of
one core. Exits 1 where something asked is not met, or too few peers ran.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core, before numpy reads it

import argparse
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from estimators import (
    ACCEL_SD_G,
    DIP_DEG,
    LARGEST_RMS_DEG,
    LARGEST_WORST_DEG,
    RIG_SD_DEG,
    STRENGTH_MG,
    drawn_unit,
)
from peer_cells import OURS, WRONG_BOUNDS, WRONG_DEG, Cell, CellKey, cells_of, fit_by, fit_ours
from peer_processes import PEERS, Peer, prepared
from peer_times import KERNELS, PARTS, SAMPLES, TIMED, Seconds, times_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

PACKAGES: Final = tuple(peer.name for peer in PEERS if peer.distribution)
COLUMNS: Final = (*(peer.name for peer in PEERS), *OURS)
LARGEST_LOSS: Final = 1.02
LARGEST_REFUSED: Final = 0.001
ELLIPSOIDS: Final = ("ellipsoid", "coefficients")
"""The magnetometer alone, with all that judges it and without."""
NEAR_BOUND: Final = 1.05
LARGEST_SINGLE: Final = 2.5
LEAST_BATCHED: Final = {"magcc": 40.0, "magyc": 40.0, "mag_cal": 4.0}
LEAST_COMMON: Final = 50.0
NOTES: Final = {
    "coefficients": "  of the ellipsoid, and its refusals",
    "truth_linear": "  magnetometer alone",
}


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """One thing that was asked for; `met` is None where no peer ran that it needs."""

    asked: str
    figure: float = float("nan")
    met: bool | None
    where: str = ""

    def __str__(self) -> str:
        word = {True: "met", False: "NOT MET", None: "not measured"}[self.met]
        digits = 3 if self.figure < 10.0 else 1 if self.figure < 100.0 else 0
        figure = "" if self.met is None else f"{self.figure:.{digits}f}"
        return f"{word:12} {figure:>7}  {self.asked}{self.where and f' ({self.where})'}"


def verdicts_of(cells: list[Cell], times: dict[CellKey, dict[str, Seconds]]) -> list[Verdict]:
    """Return what was asked of accuracy and time."""
    singles = [_single(cells, key, found) for key, found in times.items()]
    return [*_accuracy(cells), *singles, *_batched(times)]


def _accuracy(cells: list[Cell]) -> list[Verdict]:
    regular = [cell for cell in cells if cell.regular]
    asked = f"error over that of any peer, regular cells, at most {LARGEST_LOSS}"
    losses = [
        (cell.loss(name, ours), f"{ours}, {name}, {cell.key.words()}")
        for cell in regular
        for ours in ELLIPSOIDS
        for name in PACKAGES
        if {ours, name} <= {*cell.outcomes} and not np.isnan(cell.loss(name, ours))
    ]
    refused = max(
        float(cell.outcomes[ours].refused.mean())
        for cell in regular
        for ours in ELLIPSOIDS
        if ours in cell.outcomes
    )
    refusals = Verdict(
        asked=f"share refused in the worst regular cell, at most {LARGEST_REFUSED}",
        figure=refused,
        met=refused <= LARGEST_REFUSED,
    )
    if not losses:
        return [Verdict(asked=asked, met=None), refusals]
    largest, where = max(losses)
    met = largest <= LARGEST_LOSS
    loss = Verdict(asked=asked, figure=largest, met=met, where=where)
    return [loss, refusals]


def _alike(cells: list[Cell]) -> Verdict:
    """Return whether the coefficients alone are refused as the ellipsoid is, in all cells."""
    unlike = max(
        float((cell.outcomes["ellipsoid"].refused != cell.outcomes["coefficients"].refused).mean())
        for cell in cells
    )
    asked = f"share that only one of {' and '.join(ELLIPSOIDS)} refuses, at most {LARGEST_REFUSED}"
    return Verdict(asked=asked, figure=unlike, met=unlike <= LARGEST_REFUSED)


def _single(cells: list[Cell], key: CellKey, times: dict[str, Seconds]) -> Verdict:
    cell = next(cell for cell in cells if cell.key == key)
    asked = (
        f"one unit, ellipsoid's coefficients: time over the fastest peer within {NEAR_BOUND} of "
        f"the bound, at most {LARGEST_SINGLE}"
    )
    near = [
        (times[name].single, name)
        for name in PACKAGES
        if name in times and cell.ratio(name) <= NEAR_BOUND
    ]
    if not near:
        return Verdict(asked=asked, met=None, where=key.words())
    fastest_s, name = min(near)
    figure = times["coefficients"].single / fastest_s
    whole = times["ellipsoid"].single / fastest_s
    where = f"{name}, {key.words()}; {whole:.3g} with all that judges them"
    return Verdict(asked=asked, figure=figure, met=figure <= LARGEST_SINGLE, where=where)


def _batched(times: dict[CellKey, dict[str, Seconds]]) -> list[Verdict]:
    wanted = [("coefficients", name, least) for name, least in LEAST_BATCHED.items()]
    wanted += [("truth_linear", name, LEAST_COMMON) for name in PACKAGES]
    return [_ahead(times, ours, name, least) for ours, name, least in wanted]


def _ahead(times: dict[CellKey, dict[str, Seconds]], ours: str, name: str, least: float) -> Verdict:
    words = "ellipsoid's coefficients" if ours == "coefficients" else ours
    asked = f"many units, {words}: times as fast as {name}, at least {least:.0f}"
    ahead = [
        (found[name].batched / found[ours].batched, key.words(), found)
        for key, found in times.items()
        if name in found
    ]
    if not ahead:
        return Verdict(asked=asked, met=None)
    figure, where, found = min(ahead, key=lambda one: one[0])
    if ours == "coefficients":
        whole = found[name].batched / found["ellipsoid"].batched
        where += f"; {whole:.3g} with all that judges them"
    return Verdict(asked=asked, figure=figure, met=figure >= least, where=where)


# ---- what is printed -------------------------------------------------------------------------


def show_peers(reasons: dict[str, str]) -> None:
    """Print which peers are compared, and why one is not."""
    for peer in PEERS:
        words = f"{peer.distribution} {peer.version}, {peer.licence}: " if peer.distribution else ""
        reason = reasons[peer.name]
        print(f"  {peer.name:8} {words}{peer.call}{reason and f'; DID NOT RUN: {reason}'}")


def show_cells(cells: list[Cell], title: str, value: Callable[[Cell, str], str]) -> None:
    """Print one block: cells down, estimators across."""
    heads = "".join(f"{name:>13}" if name in OURS else f"{name:>11}" for name in COLUMNS)
    print(f"\n{title}\n{'tilt':>5} {'poses':>5} {'noise':>6} {'bound':>8}{heads}")
    for cell in cells:
        line = f"{cell.key} {cell.bound_deg('ellipsoid'):8.3f}"
        for name in COLUMNS:
            text = value(cell, name) if name in cell.outcomes else "-"
            line += f"{text:>13}" if name in OURS else f"{text:>11}"
        print(line + ("" if cell.regular else "  *"))


def error_text(cell: Cell, name: str) -> str:
    """Return the RMS of the heading error in deg."""
    error_deg = cell.outcomes[name].error_deg()
    return "none" if np.isnan(error_deg) else f"{error_deg:.3f}"


def ratio_text(cell: Cell, name: str) -> str:
    """Return the error over its bound."""
    ratio = cell.ratio(name)
    return "none" if np.isnan(ratio) else f"{ratio:.3f}" if ratio < 99.5 else f"{ratio:.0f}"


def nothing_text(cell: Cell, name: str) -> str:
    """Return the shares refused and without numbers in percent."""
    outcome = cell.outcomes[name]
    return f"{100.0 * outcome.refused.mean():.3g}/{100.0 * outcome.nothing.mean():.3g}"


def wrong_text(cell: Cell, name: str) -> str:
    """Return the shares wrong by bounds and degrees, and by degrees, in percent."""
    both = cell.wrong(name, WRONG_BOUNDS), cell.wrong(name)
    return "/".join(f"{100.0 * share:.3g}" for share in both)


def show_times(key: CellKey, times: dict[str, Seconds], units: int) -> None:
    """Print the times of one set."""
    print(f"\nTime at {key.words()}: one unit, and {units} units")
    for name in (*(peer.name for peer in PEERS), *KERNELS):
        if name not in times:
            continue
        single, batched = times[name]
        how = NOTES.get(name, "")
        if name in SAMPLES:
            how = f"  a loop, extrapolated from {SAMPLES[name]} units"
        elif name in PARTS:
            how = f"  extrapolated from {units // PARTS[name]} units"
        print(f"  {name:12} {1e6 * single:9.1f} us {units * batched:9.3f} s{how}")


def show_left_out(cells: list[Cell], trials: int) -> None:
    """Say where a peer took too long for all trials."""
    for name in PACKAGES:
        short = [
            len(cell.outcomes[name].rms_deg)
            for cell in cells
            if name in cell.outcomes and len(cell.outcomes[name].rms_deg) < trials
        ]
        if short:
            print(f"{name} had time for {min(short)} trials or more in {len(short)} cells")


def enough(ran: Sequence[str]) -> bool:
    """Return whether enough peers ran for a comparison."""
    return {"mag_cal", "magcal"} <= {*ran} and bool({"magcc", "magyc"} & {*ran})


def main() -> int:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--units", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    reasons = {peer.name: prepared(peer) for peer in PEERS}
    start_s = time.perf_counter()
    unit = drawn_unit(np.random.default_rng(options.seed))
    cells = cells_of(unit, options.trials, options.seed)
    fit_ours(unit, cells)
    for peer in PEERS:
        reasons[peer.name] = reasons[peer.name] or fit_by(peer, unit, cells)
    ran: list[Peer] = [peer for peer in PEERS if not reasons[peer.name]]
    times = {key: times_of(key, ran, options.units, options.seed) for key in TIMED}
    print(
        f"{options.trials} trials a cell, field {STRENGTH_MG:.0f} mG, dip {DIP_DEG:.0f} deg, "
        f"accelerometer {1000.0 * ACCEL_SD_G:.2f} mg, rig {RIG_SD_DEG} deg"
    )
    show_peers(reasons)
    show_cells(cells, "Heading error, deg RMS over all trials with a result", error_text)
    show_cells(cells, "The same over its own bound", ratio_text)
    show_cells(cells, "No result, %: refused or raised / not a number", nothing_text)
    title = f"more than {WRONG_DEG:.0f} deg"
    title = f"Wrong without saying so, %: {title} and {WRONG_BOUNDS:.0f} bounds / {title}"
    show_cells(cells, title, wrong_text)
    print(
        f"* irregular: the bound of the magnetometer alone is above {LARGEST_RMS_DEG:.0f} deg RMS "
        f"or {LARGEST_WORST_DEG:.0f} deg at the worst attitude"
    )
    show_left_out(cells, options.trials)
    for key, found in times.items():
        show_times(key, found, options.units)
    verdicts = [_alike(cells), *verdicts_of(cells, times)]
    print("\nAsked", *verdicts, sep="\n")
    compared = enough([peer.name for peer in ran])
    if not compared:
        print("too few peers ran: mag_cal, magcal and one of magcc and magyc are needed")
    print(f"{time.perf_counter() - start_s:.0f} s")
    return 0 if compared and all(verdict.met is not False for verdict in verdicts) else 1


if __name__ == "__main__":
    sys.exit(main())
