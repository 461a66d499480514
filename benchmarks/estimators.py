"""Achieved heading error over its Cramer-Rao bound, for the three estimators.

Run:  python benchmarks/estimators.py
      python benchmarks/estimators.py --trials 10000

Poses all round, tilted to 45 and to 20 deg, 12 and 36 of them, noise of 0.1 % and 1 % of the
field; one unit, read again with new noise in every trial. Prints for each estimator the bound,
the achieved error over it with two standard errors, how often the 95 % intervals (Student t,
sigma from the residuals) hold the true parameters (mean, and that farthest from 95 %), the
refused share, and the time a unit. A cell is regular where the poses determine all parameters
and the bound is at most 1 deg RMS and 2 deg at the worst attitude.

Exits 1 where a regular cell leaves 0.95 to 1.05, two standard errors included, or its intervals
hold less than 93 % or more than 97 %, or it refuses more than 1 in 1000.
Times are of the processor.
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
from scipy.special import stdtrit

from bench.calibration.bound import Conditions, Estimator, HeadingBound, heading_bound
from bench.calibration.ellipsoid_batch import ellipsoid_batch
from bench.calibration.prediction import grid_attitudes_deg
from bench.calibration.tilt import attitude_deg, ned_from_body, tilt_compensated_heading_deg
from bench.calibration.tilt_aided_batch import tilt_aided_batch
from bench.calibration.truth_aided_batch import TruthAidedFits, truth_aided_batch
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

STRENGTH_MG: Final = 500.0
DIP_DEG: Final = 65.0
ACCEL_SD_G: Final = float(np.deg2rad(0.1))
RIG_SD_DEG: Final = 0.03
TILTS_DEG: Final = (180.0, 45.0, 20.0)
COUNTS: Final = (12, 36)
NOISES: Final = (0.001, 0.01)
RATIO: Final = (0.95, 1.05)
HOLDS: Final = (0.93, 0.97)
LARGEST_REFUSED: Final = 0.001
LARGEST_RMS_DEG: Final = 1.0
LARGEST_WORST_DEG: Final = 2.0
ESTIMATORS: Final[tuple[Estimator, ...]] = ("ellipsoid", "tilt_aided", "truth_aided")
SYMMETRIC: Final = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unit:
    """A unit's true coefficients, raw = gain @ v + offset."""

    gain: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    accel_gain: NDArray[np.float64]
    accel_offset_g: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """Readings of one unit on the same poses, again and again, shape (trials, n, 3)."""

    attitudes_deg: NDArray[np.float64]
    field_mg: NDArray[np.float64]
    accel_g: NDArray[np.float64]
    raw_accel_g: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Errors:
    """What an estimator left: heading errors (m, k) and whether intervals held (m, p)."""

    heading_deg: NDArray[np.float64]
    held: NDArray[np.bool_]
    refused: float
    seconds: float


def station_mg() -> NDArray[np.float64]:
    """Return the field, shape (3,), north east down."""
    dip_rad = np.deg2rad(DIP_DEG)
    return STRENGTH_MG * np.array([np.cos(dip_rad), 0.0, np.sin(dip_rad)])


def drawn_unit(rng: np.random.Generator) -> Unit:
    """Return a unit with soft iron of 5 %, hard iron of 80 mG and a raw accelerometer."""
    return Unit(
        gain=np.eye(3) + rng.normal(0.0, 0.05, (3, 3)),
        offset_mg=rng.normal(0.0, 80.0, 3),
        accel_gain=np.eye(3) + rng.normal(0.0, 0.015, (3, 3)),
        accel_offset_g=rng.normal(0.0, 0.03, 3),
    )


def spread_attitudes_deg(count: int, tilt_deg: float) -> NDArray[np.float64]:
    """Return attitudes, shape (count, 3), with the vertical evenly spread over a cone.

    Down moves along a spiral of equal areas, the heading in steps of another irrational part of
    a turn, so that neither repeats.
    """
    index = np.arange(count) + 0.5
    cosine = 1.0 - (1.0 - np.cos(np.deg2rad(tilt_deg))) * index / count
    sine = np.sqrt(1.0 - cosine**2)
    turn_rad = index * np.pi * (3.0 - np.sqrt(5.0))
    down = np.column_stack([sine * np.cos(turn_rad), sine * np.sin(turn_rad), cosine])
    pitch_deg, roll_deg = attitude_deg(-down)
    return np.column_stack([np.mod(index * 360.0 * np.sqrt(2.0), 360.0), pitch_deg, roll_deg])


def read(
    unit: Unit, attitudes_deg: NDArray[np.float64], sd_mg: float, trials: int, seed: int
) -> Readings:
    """Return the readings of a unit with new noise in every trial."""
    rng = np.random.default_rng(seed)
    shape = (trials, *attitudes_deg.shape)
    actual_deg = attitudes_deg + rng.normal(0.0, RIG_SD_DEG, shape)
    axes = ned_from_body(*np.moveaxis(actual_deg, -1, 0))
    noise_g = rng.normal(0.0, ACCEL_SD_G, shape)
    force = -axes[..., 2, :]
    noise_mg = rng.normal(0.0, sd_mg, shape)
    return Readings(
        attitudes_deg=attitudes_deg,
        field_mg=np.einsum("bnji,j->bni", axes, station_mg()) @ unit.gain.T
        + unit.offset_mg
        + noise_mg,
        accel_g=force + noise_g,
        raw_accel_g=force @ unit.accel_gain.T + unit.accel_offset_g + noise_g,
    )


def errors_of(estimator: Estimator, unit: Unit, readings: Readings, sd_mg: float) -> Errors:
    """Return what one estimator leaves on the readings."""
    start = time.process_time()
    if estimator == "truth_aided":
        return _truth_aided(unit, readings, sd_mg, start)
    if estimator == "ellipsoid":
        fits = ellipsoid_batch(readings.field_mg, sd_mg, station_field_mg=station_mg())
    else:
        fits = tilt_aided_batch(
            readings.field_mg, readings.accel_g, sd_mg, ACCEL_SD_G, station_field_mg=station_mg()
        )
    seconds = time.process_time() - start
    good = fits.cause == 0
    matrix, offset_mg = fits.matrix[good], fits.offset_mg[good]
    truth, dof = np.linalg.inv(unit.gain), readings.field_mg.shape[1]
    turned = matrix
    if estimator == "ellipsoid":
        left, _, right = np.linalg.svd(matrix @ unit.gain)
        turned = np.swapaxes(left @ right, 1, 2) @ matrix
        _, gains, right = np.linalg.svd(truth)
        truth = right.T * gains @ right
        found = [matrix[:, *SYMMETRIC], offset_mg]
        true = np.concatenate([truth[tuple(SYMMETRIC)], unit.offset_mg])
        dof -= 9
    else:
        found = [matrix.reshape(-1, 9), offset_mg, fits.dip_deg[good, None]]
        true = np.concatenate([truth.ravel(), unit.offset_mg, [DIP_DEG]])
        dof = 2 * dof - 13
    field_mg, force_g = _verified()
    raw_mg = field_mg @ unit.gain.T + unit.offset_mg - offset_mg[:, None, :]
    held = _held(
        np.concatenate(found, axis=1) - true, fits.covariance, fits.chi2_reduced, good, dof
    )
    return Errors(
        heading_deg=_heading_error_deg(raw_mg @ np.swapaxes(turned, 1, 2), force_g),
        held=held,
        refused=1.0 - float(good.mean()),
        seconds=seconds / len(good),
    )


def truth_aided(readings: Readings, sd_mg: float) -> TruthAidedFits:
    """Fit T: both sensors, field direction and base level."""
    return truth_aided_batch(
        readings.attitudes_deg,
        readings.field_mg,
        readings.raw_accel_g,
        field_sd_mg=sd_mg,
        accel_sd_g=ACCEL_SD_G,
        rig_sd_deg=RIG_SD_DEG,
        station_field_mg=station_mg(),
    )


def conditions_of(unit: Unit, sd_mg: float) -> Conditions:
    """Return the conditions of the bound for a unit and a noise of the field."""
    return Conditions(
        station_field_mg=station_mg(),
        field_sd_mg=sd_mg,
        accel_sd_g=ACCEL_SD_G,
        rig_sd_deg=RIG_SD_DEG,
        gain=unit.gain,
        accel_gain=unit.accel_gain,
    )


def _truth_aided(unit: Unit, readings: Readings, sd_mg: float, start: float) -> Errors:
    fits = truth_aided(readings, sd_mg)
    seconds = time.process_time() - start
    good = fits.cause == 0
    field_mg, force_g = _verified()
    raw_mg = field_mg @ unit.gain.T + unit.offset_mg - fits.offset_mg[good, None, :]
    raw_g = force_g @ unit.accel_gain.T + unit.accel_offset_g - fits.accel_offset_g[good, None, :]
    back = np.swapaxes(np.linalg.inv(fits.gain[good]), 1, 2)
    accel_back = np.swapaxes(np.linalg.inv(fits.accel_gain[good]), 1, 2)
    found = [fits.gain.reshape(-1, 9), fits.offset_mg]
    found += [np.stack([fits.field_azimuth_deg, fits.dip_deg], axis=1)]
    found += [fits.accel_gain.reshape(-1, 9), fits.accel_offset_g]
    found += [np.stack([fits.base_level_north_deg, fits.base_level_east_deg], axis=1)]
    parts = [unit.gain.ravel(), unit.offset_mg, [0.0, DIP_DEG]]
    true = np.concatenate([*parts, unit.accel_gain.ravel(), unit.accel_offset_g, [0.0, 0.0]])
    off = np.concatenate(found, axis=1)[good] - true
    dof = 6 * len(readings.attitudes_deg) - 28
    return Errors(
        heading_deg=_heading_error_deg(raw_mg @ back, raw_g @ accel_back),
        held=_held(off, fits.covariance, fits.chi2_reduced, good, dof),
        refused=1.0 - float(good.mean()),
        seconds=seconds / len(good),
    )


def _verified() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the true field and force in the body over the verification grid, shape (k, 3)."""
    axes = ned_from_body(*grid_attitudes_deg().T)
    return np.einsum("nji,j->ni", axes, station_mg()), -axes[:, 2]


def _heading_error_deg(
    field_mg: NDArray[np.float64], force_g: NDArray[np.float64]
) -> NDArray[np.float64]:
    heading_deg = tilt_compensated_heading_deg(field_mg, force_g)
    return np.asarray(wrap_180_deg(heading_deg - grid_attitudes_deg()[:, 0]))


def _held(
    off: NDArray[np.float64],
    covariance: NDArray[np.float64],
    chi2_reduced: NDArray[np.float64],
    good: NDArray[np.bool_],
    dof: int,
) -> NDArray[np.bool_]:
    """Return whether each parameter's 95 % interval holds the truth, sigma from the residuals."""
    variance = np.diagonal(covariance[good], axis1=1, axis2=2)
    chi2 = chi2_reduced[good, None]
    sd = np.sqrt(variance / np.maximum(chi2, 1.0) * chi2)
    return np.asarray(np.abs(off) <= stdtrit(dof, 0.975) * sd)


def judged(bound: HeadingBound, errors: Errors) -> tuple[str, bool]:
    """Return a cell's line, and whether it is regular and leaves its limits."""
    regular = bool(bound.rms_deg <= LARGEST_RMS_DEG and bound.worst_deg <= LARGEST_WORST_DEG)
    line = f"{float(bound.rms_deg):8.4f} {float(bound.worst_deg):8.4f} "
    micro = 1e6 * errors.seconds
    if len(errors.heading_deg) < 2:
        line += f"{'-':>7} {'-':>6} {'-':>6} {'-':>6} {100.0 * errors.refused:7.1f} {micro:6.0f}"
        return f"{line}  {'FAIL' if regular else 'irregular, refused'}", regular
    squares = (errors.heading_deg**2).mean(axis=1)
    ratio = float(np.sqrt(squares.mean()) / bound.rms_deg)
    spread = ratio * float(squares.std(ddof=1) / squares.mean()) / np.sqrt(len(squares))
    shares = errors.held.mean(axis=0)
    farthest = float(shares[np.argmax(np.abs(shares - 0.95))])
    fails = not (
        ratio - spread >= RATIO[0]
        and ratio + spread <= RATIO[1]
        and HOLDS[0] <= farthest <= HOLDS[1]
        and errors.refused <= LARGEST_REFUSED
    )
    line += f"{ratio:7.3f} {spread:6.3f} {100.0 * shares.mean():6.1f} {100.0 * farthest:6.1f} "
    line += f"{100.0 * errors.refused:7.1f} {micro:6.0f}"
    if not regular:
        return f"{line}  irregular", False
    return f"{line}  {'FAIL' if fails else 'ok'}", fails


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    unit = drawn_unit(np.random.default_rng(options.seed))
    print(
        f"{options.trials} trials a cell, field {STRENGTH_MG:.0f} mG, dip {DIP_DEG:.0f} deg, "
        f"accelerometer {1000.0 * ACCEL_SD_G:.2f} mg, rig {RIG_SD_DEG} deg"
    )
    print(
        f"{'estimator':12} {'tilt':>5} {'poses':>5} {'noise':>6} {'bound':>8} {'worst':>8} "
        f"{'ratio':>7} {'2 se':>6} {'held':>6} {'far':>6} {'refused':>7} {'us':>6}"
    )
    start, failed, seed = time.perf_counter(), 0, options.seed
    for tilt_deg in TILTS_DEG:
        for count in COUNTS:
            for noise in NOISES:
                seed += 1
                failed += _cell(unit, (tilt_deg, count, noise), options.trials, seed)
    print(f"{failed} regular cells leave their limits; {time.perf_counter() - start:.0f} s")
    return 1 if failed else 0


def _cell(unit: Unit, cell: tuple[float, int, float], trials: int, seed: int) -> int:
    """Print the lines of the three estimators on the same readings; return how many fail."""
    tilt_deg, count, noise = cell
    sd_mg = noise * STRENGTH_MG
    attitudes_deg = spread_attitudes_deg(count, tilt_deg)
    readings = read(unit, attitudes_deg, sd_mg, trials, seed)
    conditions = conditions_of(unit, sd_mg)
    failed = 0
    for estimator in ESTIMATORS:
        bound = heading_bound(estimator, attitudes_deg, conditions)
        line, fails = judged(bound, errors_of(estimator, unit, readings, sd_mg))
        failed += fails
        print(f"{estimator:12} {tilt_deg:5.0f} {count:5} {100.0 * noise:5.1f}% {line}", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
