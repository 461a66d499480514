"""Whether the bench's uncertainty is true: certificate intervals and the risk of wrong decisions.

Run:  python benchmarks/uncertainty.py --units 1000

Every unit of the full sensor model is calibrated on the poses of eol_three_axis, on a bench of its
own drawn from the uncertainties of the default station, written, and verified on that procedure's
verification poses. From the verification the bench computes its uncertainty budget.

- certificate: e_k +- U shall hold the unit's own error, on noiseless readings at the true attitude
  in the undisturbed field, without seat: 93 to 97 % of units and poses, level and tilted.
- decision: hard iron that comes after the write, and magnetometers that turn in their housing,
  bring units to their limits. Of those measured at 0.6 to 1.4 of a limit, as many shall be wrongly
  accepted and wrongly rejected as the probabilities of conformity predict, by the limit alone and
  with the guard band, within two standard errors; so shall as many conform in every bin of the
  probability, within three.

`own worst` is the share of units whose interval holds at the pose of their own largest error, and
`e worst` at the pose of the largest measured one: that is picked for its noise, so that no interval
of single poses holds there.

The probability of conformity errs a little to the safe side, which several thousand units show:
rejected and accepted units alike conform somewhat more often than predicted. In part that is
because it takes nothing for known about the unit, not even how far it repeats.

Exits 1 where one of these does not hold.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core, before numpy reads it

import argparse
import sys
import time
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from adaptive import lots_of
from many_fits import STATION
from verifications import Verifications, verifications_of

from bench.acceptance.heading_evaluation import error_measurements
from bench.acceptance.outcome import Outcome
from bench.acceptance.site import is_level
from bench.acceptance.verdict import judge_measurement
from bench.limit_set import load_limits
from bench.uncertainty.decision import heading_decision
from bench.uncertainty.heading_budget import heading_budget
from bench.uncertainty.unit_data import UnitData

if TYPE_CHECKING:
    from many_units import Lot
    from numpy.typing import NDArray

    from bench.acceptance.measurement import Measurement
    from bench.uncertainty.heading_budget import HeadingBudget

PROCEDURE: Final = "eol_three_axis"
LIMITS: Final = load_limits(PROCEDURE)
UNIT: Final = LIMITS.unit or UnitData()
HOLDS: Final = (0.93, 0.97)
SPOILED_DEG: Final = (0.1, 1.0)
NEAR: Final = (0.6, 1.4)
BINS: Final = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0 + 1e-9)
TOTAL_SIGMAS: Final = 2.0
BIN_SIGMAS: Final = 3.0
PASS: Final = Outcome.PASS
ACCEPTED: Final = (Outcome.PASS, Outcome.MARGINAL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One judged number near its limit.

    `conformity` is the probability that the error shown was inside the limit, `conforms` whether
    it was.
    """

    outcome: Outcome
    conformity: float
    conforms: bool


def certificates(lot: Lot, seed: int) -> dict[str, NDArray[np.float64]]:
    """Return, level and tilted, an array of shape (3, units, m).

    (own - measured error)/u, the measured error and u, the standard uncertainty, in deg.
    """
    found = verifications_of(lot, seed, PROCEDURE)
    level = is_level(found.readings[0])
    u_deg = np.array([_budget(found, unit).u_deg / 2.0 for unit in range(len(found.readings))])
    ratio = (found.own_deg - found.error_deg) / u_deg
    both = np.stack([ratio, found.error_deg, u_deg])
    return {"level": both[..., level], "tilted": both[..., ~level]}


def decisions(lot: Lot, seed: int) -> dict[str, list[Decision]]:
    """Return the decisions near the limits of level_max and tilt_max."""
    spoiled_deg = np.random.default_rng((seed, 2)).uniform(*SPOILED_DEG, len(lot.ambient_c))
    found = verifications_of(lot, seed, PROCEDURE, spoiled_deg)
    level = is_level(found.readings[0])
    judged: dict[str, list[Decision]] = {}
    for name, mask in (("level", level), ("tilt", ~level)):
        limit_deg = LIMITS.by_name[f"{name}_max"].high
        assert limit_deg is not None
        near = np.abs(found.error_deg[:, mask]).max(axis=1) / limit_deg
        judged[f"{name}_max"] = [
            _decision(found, unit, name, mask, limit_deg)
            for unit in np.flatnonzero((near >= NEAR[0]) & (near <= NEAR[1])).tolist()
        ]
    return judged


def _decision(
    found: Verifications, unit: int, name: str, mask: NDArray[np.bool_], limit_deg: float
) -> Decision:
    error_deg, readings = found.error_deg[unit], found.readings[unit]
    spread = heading_decision(error_deg, _budget(found, unit), mask)
    measured = error_measurements(name, "verify", error_deg[mask], readings[mask], spread=spread)
    judged: Measurement = judge_measurement(measured[0], LIMITS.by_name)
    assert judged.outcome is not None
    assert judged.conformity is not None
    return Decision(
        outcome=judged.outcome,
        conformity=judged.conformity,
        conforms=bool(np.abs(found.shown_deg[unit][mask]).max() <= limit_deg),
    )


def _budget(found: Verifications, unit: int) -> HeadingBudget:
    return heading_budget(found.readings[unit], found.calibrated.fit_of(unit), STATION, UNIT)


def show_certificates(lots: list[Lot]) -> bool:
    """Print how often the certificate's intervals hold; return whether they do."""
    blocks = [certificates(lot, seed) for seed, lot in enumerate(lots)]
    print(
        f"{'certificate':12} {'held %':>7} {'2 se':>5} {'own worst':>9} {'e worst':>7} "
        f"{'U deg':>7} {'e rms':>7} {'e max':>7}"
    )
    met = True
    for name in blocks[0]:
        ratio, error_deg, u_deg = np.concatenate([block[name] for block in blocks], axis=1)
        held = np.abs(ratio) <= 2.0
        by_unit = held.mean(axis=1)
        spread = 2.0 * by_unit.std(ddof=1) / np.sqrt(len(by_unit))
        own_deg, units = error_deg + ratio * u_deg, np.arange(len(held))
        own, seen = (
            100.0 * held[units, np.argmax(np.abs(of), axis=1)].mean() for of in (own_deg, error_deg)
        )
        print(
            f"{name:12} {100.0 * by_unit.mean():7.1f} {100.0 * spread:5.1f} "
            f"{own:9.1f} {seen:7.1f} {2.0 * np.median(u_deg):7.3f} "
            f"{np.sqrt((error_deg**2).mean()):7.3f} {np.abs(error_deg).max():7.3f}",
            flush=True,
        )
        met &= bool(HOLDS[0] <= by_unit.mean() <= HOLDS[1])
    return met


def show_decisions(lots: list[Lot]) -> bool:
    """Print predicted and observed wrong decisions; return whether they agree."""
    blocks = [decisions(lot, seed) for seed, lot in enumerate(lots)]
    print(
        f"{'decision':12} {'rule':26} {'decided':>7} {'predicted':>9} {'observed':>8} {'2 se':>6}"
    )
    met = True
    for name in blocks[0]:
        found = [one for block in blocks for one in block[name]]
        for rule, chosen, wrong_if in (
            ("false accept, guarded", [one for one in found if one.outcome is PASS], False),
            ("false accept, limit alone", [one for one in found if one.outcome in ACCEPTED], False),
            ("false reject", [one for one in found if one.outcome is Outcome.FAIL], True),
        ):
            met &= _agrees(name, rule, chosen, wrong_if=wrong_if, sigmas=TOTAL_SIGMAS)
        for low, high in pairwise(BINS):
            chosen = [one for one in found if low <= one.conformity < high]
            rule = f"conforms, p {low:.2f} to {min(high, 1.0):.2f}"
            met &= _agrees(name, rule, chosen, wrong_if=True, sigmas=BIN_SIGMAS)
    return met


def _agrees(name: str, rule: str, chosen: list[Decision], *, wrong_if: bool, sigmas: float) -> bool:
    """Print how many of some decisions conform (or do not); return whether that was predicted."""
    p = np.array([one.conformity if wrong_if else 1.0 - one.conformity for one in chosen])
    observed = sum(one.conforms is wrong_if for one in chosen)
    error = float(np.sqrt((p * (1.0 - p)).sum()))
    off = abs(observed - p.sum()) > max(sigmas * error, 1.0)
    print(
        f"{name:12} {rule:26} {len(chosen):7} {p.sum():9.1f} {observed:8} {2.0 * error:6.1f}"
        f"{'  OFF' if off else ''}",
        flush=True,
    )
    return not off


def main() -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=1000)
    options = parser.parse_args()
    started_s, lots = time.perf_counter(), lots_of(options.units)
    print(f"{options.units} good units on {STATION.name}, procedure {PROCEDURE}")
    held = show_certificates(lots)
    agreed = show_decisions(lots)
    print(
        f"uncertainty: certificate intervals {'hold' if held else 'do not hold'} "
        f"{100.0 * HOLDS[0]:.0f} to {100.0 * HOLDS[1]:.0f} %, wrong decisions are "
        f"{'as' if agreed else 'not as'} predicted; {time.perf_counter() - started_s:.0f} s"
    )
    return 0 if held and agreed else 1


if __name__ == "__main__":
    sys.exit(main())
