"""The adaptive calibration with its stopping rule in the loop: whether its claims are true.

Run:  python benchmarks/adaptive.py --units 1000

Every unit goes through the poses of procedure `adaptive`; after each one the bench's own fit
claims the largest heading error of the coefficients over 120 attitudes, and the unit stops where
that is as small as wanted. Then the claim is held against the true error: that of the coefficients
on noiseless readings at true attitudes, against the heading of the unit as it sits, since no pose
sees the seat's own error. Exits 1 where less than 93 % of the claims hold, or more than 97 %, two
standard errors allowed.

The poses are those of a run in which none is lost; `all` poses says what would be claimed, and how
often it would hold, if every unit went on to the most poses.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core, before numpy reads it

import argparse
import sys
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from many_benches import seat_from_body
from many_fits import Calibrated, calibrated, data_of
from many_units import Lot, Readings, Way, drawn_lot, perfect_readings, read, way_of

from bench.calibration.heading_claim import claimed
from bench.calibration.prediction import grid_attitudes_deg
from bench.calibration.tilt import ned_from_body
from bench.pose import Attitude
from bench.procedure_loader import load_procedure
from bench.steps.adaptive_poses import AdaptivePoses
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

HOME: Final = Attitude(azimuth_deg=0.0)
HOLDS: Final = (0.93, 0.97)
BLOCK: Final = 100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stopped:
    """Where the rule stopped the units of a lot; arrays of shape (units,).

    `count` poses were visited in `seconds` of rig time, from level at 0 deg and back; `claim_deg`
    is what was claimed and `true_deg` the largest error of the coefficients; infinite claims are
    of refused fits. `calibrations` holds, by the number of poses, the fits of all units.
    """

    count: NDArray[np.int_]
    seconds: NDArray[np.float64]
    claim_deg: NDArray[np.float64]
    true_deg: NDArray[np.float64]
    calibrations: dict[int, Calibrated]


def adaptive_step() -> AdaptivePoses:
    """Return the step of the shipped procedure."""
    steps = load_procedure("adaptive").walk()
    return next(step for step in steps if isinstance(step, AdaptivePoses))


def stopped(step: AdaptivePoses, lot: Lot, seed: int, least: int | None = None) -> Stopped:
    """Return where the rule stops every unit; with `least`, it does not ask before that pose."""
    poses = list(step.longest_poses())
    way = way_of(poses, HOME)
    readings = read(lot, way, np.random.default_rng(seed))
    first = least or step.least
    found = [_unit_stop(step, way, readings, unit, first) for unit in range(len(lot.ambient_c))]
    count = np.array([one[0] for one in found])
    shown_deg = way.shown_deg[:, -1]
    calibrations = {n: calibrated(shown_deg, readings, n) for n in sorted(set(count.tolist()))}
    true_deg = np.empty(len(count))
    for n, calibration in calibrations.items():
        of_count = count == n
        true_deg[of_count] = _true_largest_deg(lot, readings, calibration, n)[of_count]
    return Stopped(
        count=count,
        seconds=np.array([rig_seconds(way_of(poses[:n], HOME)) for n in count.tolist()]),
        claim_deg=np.array([one[1] for one in found]),
        true_deg=true_deg,
        calibrations=calibrations,
    )


def rig_seconds(way: Way) -> float:
    """Return the time from level at 0 deg through all poses, dwells included, and back."""
    return float(way.seconds[-1]) + way.back_s


def _unit_stop(
    step: AdaptivePoses, way: Way, readings: Readings, unit: int, first: int
) -> tuple[int, float]:
    claim_deg = np.inf
    for count in range(first, step.most + 1):
        claim = claimed(data_of(way.shown_deg[:, -1], readings, unit, count)).claim
        claim_deg = np.inf if claim is None else claim.largest_deg
        if claim_deg <= step.wanted:
            break
    return count, claim_deg


def _true_largest_deg(
    lot: Lot, readings: Readings, calibration: Calibrated, count: int
) -> NDArray[np.float64]:
    """Return the largest error, shape (units,), of coefficients over the verification grid."""
    attitudes_deg = grid_attitudes_deg()
    seats = seat_from_body(lot.benches)[:, None]
    seated = replace(
        readings,
        axes=ned_from_body(*attitudes_deg.T) @ seats,
        temperature_c=readings.temperature_c[:, :count],
        wander_g=readings.wander_g[:, :count],
    )
    iron_mg = np.einsum("uij,uj->ui", lot.soft_iron, lot.benches.iron_mg)[:, None]
    heading_deg = calibration.heading_deg(*perfect_readings(lot, seated, iron_mg))
    true_deg = attitudes_deg[:, 0] - lot.benches.field_azimuth_deg[:, None]
    return np.asarray(np.abs(wrap_180_deg(heading_deg - true_deg)).max(axis=1))


def lots_of(units: int) -> list[Lot]:
    """Return units 1 to `units` in lots."""
    firsts = range(1, units + 1, BLOCK)
    return [drawn_lot(first, min(BLOCK, units + 1 - first)) for first in firsts]


def shown(name: str, found: list[Stopped]) -> tuple[float, float]:
    """Print the line of a rule; return the share of claims that hold and its standard error."""
    count, seconds, claim, true = (
        np.concatenate([getattr(one, field) for one in found])
        for field in ("count", "seconds", "claim_deg", "true_deg")
    )
    fitted = np.isfinite(claim)
    share = float((true[fitted] <= claim[fitted]).mean())
    error = float(np.sqrt(share * (1.0 - share) / fitted.sum()))
    p50, p95 = np.percentile(count, [50, 95])
    print(
        f"{name:12} {p50:6.0f} {p95:6.0f} {np.median(seconds):7.1f} "
        f"{np.percentile(seconds, 95):7.1f} {np.median(claim):8.3f} "
        f"{np.percentile(true, 95):8.3f} {true.max():8.3f} {100.0 * (1.0 - fitted.mean()):7.1f} "
        f"{100.0 * share:7.1f} {200.0 * error:5.1f}",
        flush=True,
    )
    return share, error


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=1000)
    options = parser.parse_args()
    started_s = time.perf_counter()
    step, lots = adaptive_step(), lots_of(options.units)
    print(
        f"{options.units} good units; wanted {step.wanted:g} deg at 95 %; {step.most} poses at most"
    )
    print(
        f"{'rule':12} {'poses':>6} {'p95':>6} {'rig s':>7} {'p95':>7} {'claim':>8} {'true p95':>8} "
        f"{'largest':>8} {'refused':>7} {'held %':>7} {'2 se':>5}"
    )
    share, error = shown("stops", [stopped(step, lot, n) for n, lot in enumerate(lots)])
    shown("all", [stopped(step, lot, n, step.most) for n, lot in enumerate(lots)])
    met = share + 2.0 * error >= HOLDS[0] and share - 2.0 * error <= HOLDS[1]
    verdict = "" if met else " not"
    print(
        f"adaptive: {100.0 * share:.1f} % of the claims hold,{verdict} within "
        f"{100.0 * HOLDS[0]:.0f} to {100.0 * HOLDS[1]:.0f} %; "
        f"{time.perf_counter() - started_s:.0f} s"
    )
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
