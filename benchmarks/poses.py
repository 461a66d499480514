"""What poses cost and give: rig seconds and verified accuracy of good units, all judged by T.

Run:  python benchmarks/poses.py --units 1000

Every unit is calibrated by the truth-aided fit on each set of poses, on its own rig, and verified
at 24 headings level and at +-30 deg of pitch and of roll. Exits 1 where quick takes more than 0.45
of the rig time of caruso_24, or less than 95 % of its units verify to 0.5 deg at every attitude.
`four_position, level` is that procedure's own method, judged at the level headings alone.
`adaptive` goes on, unit by unit, until its coefficients are claimed to be good enough: its poses
and rig seconds are medians.

Rig seconds run from level at 0 deg through the poses and back; `predicted` is the fit's own RMS
from its covariance, which holds the coefficients alone; `rms` to `largest` are the verified error,
with the noise, repeatability and hysteresis of the verifying readings; `azi p99` is the field
azimuth against the station's.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Final

import numpy as np
from adaptive import HOME, adaptive_step, lots_of, rig_seconds, stopped
from many_fits import Calibrated, calibrated, data_of
from many_units import Lot, read, way_of
from verifications import poses_of

from bench.calibration.methods import fit_named
from bench.calibration.prediction import grid_attitudes_deg
from bench.calibration.tilt import tilt_compensated_heading_deg
from bench.calibration.truth_aided_batch import CAUSES
from bench.pose import Attitude
from bench.steps.step import PlannedPose
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

DWELL_S: Final = 0.5
WANTED_DEG: Final = 0.5
WANTED_SHARE: Final = 0.95
WANTED_TIME: Final = 0.45
FOUR_POSITION: Final = "four_position"


def sets_of_poses() -> dict[str, list[PlannedPose]]:
    """Return the sets by name, in the order in which the rig goes through them."""
    return {
        "quick": poses_of("quick"),
        "PNI-like 12, tilt 10": pni_like(),
        "4 level + 8 at 30 deg": rings(4, 2),
        "caruso_24": poses_of("caruso_24"),
        "36 in rings": rings(12, 6),
        "eol_three_axis": poses_of("eol_three_axis"),
        FOUR_POSITION: poses_of(FOUR_POSITION),
        "12 level": rings(12, 0),
    }


def rings(level: int, tilted: int) -> list[PlannedPose]:
    """Return a level ring and one at each of +-30 deg of pitch and of roll."""
    tilts = [(0.0, 0.0, 0.0, level)]
    if tilted:
        tilts += [(0.0, angle, 0.0, tilted) for angle in (30.0, -30.0)]
        tilts += [(45.0, 0.0, angle, tilted) for angle in (30.0, -30.0)]
    return [
        planned(first + 360.0 * index / count, pitch, roll)
        for first, pitch, roll, count in tilts
        for index in range(count)
    ]


def planned(azimuth_deg: float, pitch_deg: float, roll_deg: float) -> PlannedPose:
    """Return a pose of half a second."""
    attitude = Attitude(azimuth_deg=azimuth_deg, pitch_deg=pitch_deg, roll_deg=roll_deg)
    return PlannedPose(attitude=attitude, dwell_s=DWELL_S)


def pni_like() -> list[PlannedPose]:
    """Return 4 level headings, 4 nose up and 4 nose down by 10 deg, the roll left and right."""
    tilts = [(0.0, 0.0)] * 4
    tilts += [(10.0, 10.0), (10.0, -10.0)] * 2 + [(-10.0, 10.0), (-10.0, -10.0)] * 2
    return [
        planned(90.0 * (index % 4) + 30.0 * (index // 4), pitch, roll)
        for index, (pitch, roll) in enumerate(tilts)
    ]


def verification() -> list[PlannedPose]:
    """Return the 120 attitudes of the verification grid."""
    return [planned(*attitude) for attitude in grid_attitudes_deg().tolist()]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """What a set of poses gave a lot of units; arrays of shape (units, ...).

    Attributes
    ----------
    count, seconds : ndarray, shape (units,)
        Poses and rig time.
    error_deg : ndarray, shape (units, 120)
        Verified heading errors.
    predicted_deg, azimuth_deg : ndarray, shape (units,)
        The fit's RMS, and its azimuth of the field.
    cause : ndarray of int8, shape (units,)
        Index into CAUSES.
    """

    count: NDArray[np.int_]
    seconds: NDArray[np.float64]
    error_deg: NDArray[np.float64]
    predicted_deg: NDArray[np.float64]
    azimuth_deg: NDArray[np.float64]
    cause: NDArray[np.int8]


def found_on(poses: list[PlannedPose], lot: Lot, seed: int) -> Found:
    """Return what poses that are the same for all units gave."""
    way, count = way_of([*poses, *verification()], HOME), len(poses)
    readings = read(lot, way, np.random.default_rng(seed))
    calibration = calibrated(way.shown_deg[:, -1], readings, count)
    heading_deg = calibration.heading_deg(readings.field_mg[:, count:], readings.force_g[:, count:])
    error_deg = wrap_180_deg(heading_deg - way.shown_deg[count:, -1, 0])
    units = len(error_deg)
    seconds = np.full(units, rig_seconds(way_of(poses, HOME)))
    return _found(calibration, np.full(units, count), seconds, error_deg)


def found_adaptively(lot: Lot, seed: int) -> Found:
    """Return what the adaptive poses gave, each unit verified with its own coefficients."""
    stop = stopped(adaptive_step(), lot, seed)
    way = way_of(verification(), HOME, start_s=float(stop.seconds.mean()))
    readings = read(lot, way, np.random.default_rng((seed, 1)))
    parts = []
    for count, calibration in stop.calibrations.items():
        heading_deg = calibration.heading_deg(readings.field_mg, readings.force_g)
        error_deg = wrap_180_deg(heading_deg - way.shown_deg[:, -1, 0])
        found = _found(calibration, stop.count, stop.seconds, error_deg)
        parts.append(_rows(found, stop.count == count))
    return _joined(parts)


def found_level(lot: Lot, seed: int) -> Found:
    """Return what four_position gave by its own method, verified at the 24 level headings.

    The module is level by the rig: the method calibrates no accelerometer.
    """
    poses = poses_of(FOUR_POSITION)
    level = [planned(*attitude) for attitude in grid_attitudes_deg(level_only=True).tolist()]
    way, count = way_of([*poses, *level], HOME), len(poses)
    readings = read(lot, way, np.random.default_rng(seed))
    shown_deg = way.shown_deg[:, -1]
    level_g = np.tile([0.0, 0.0, -1.0], (len(level), 1))
    errors_deg, predicted_deg, units = [], [], range(len(readings.field_mg))
    for unit in units:
        fit = fit_named(FOUR_POSITION, data_of(shown_deg, readings, unit, count))
        heading_deg = tilt_compensated_heading_deg(
            fit.corrected_mg(readings.field_mg[unit, count:]), level_g
        )
        errors_deg.append(wrap_180_deg(heading_deg - shown_deg[count:, 0]))
        predicted_deg.append(fit.predicted_heading_rms_deg or np.nan)
    return Found(
        count=np.full(len(units), count),
        seconds=np.full(len(units), rig_seconds(way_of(poses, HOME))),
        error_deg=np.array(errors_deg),
        predicted_deg=np.array(predicted_deg),
        azimuth_deg=np.full(len(units), np.nan),
        cause=np.zeros(len(units), dtype=np.int8),
    )


def _found(
    calibration: Calibrated,
    count: NDArray[np.int_],
    seconds: NDArray[np.float64],
    error_deg: NDArray[np.float64],
) -> Found:
    fits = calibration.fits
    return Found(
        count=count,
        seconds=seconds,
        error_deg=error_deg,
        predicted_deg=fits.predicted_rms_deg,
        azimuth_deg=fits.field_azimuth_deg,
        cause=fits.cause,
    )


def _rows(found: Found, units: NDArray[np.bool_]) -> Found:
    return Found(**{one.name: getattr(found, one.name)[units] for one in fields(Found)})


def _joined(parts: list[Found]) -> Found:
    return Found(
        **{
            one.name: np.concatenate([getattr(part, one.name) for part in parts])
            for one in fields(Found)
        }
    )


def line(name: str, found: Found) -> tuple[float, float]:
    """Print a set's line; return its rig seconds and the share of units within 0.5 deg."""
    seconds, good = float(np.median(found.seconds)), found.cause == 0
    text = f"{name:22} {np.median(found.count):5.0f} {seconds:7.1f} "
    if not good.any():
        print(f"{text}  refused: {CAUSES[int(found.cause[0])]}", flush=True)
        return seconds, 0.0
    errors = found.error_deg[good]
    largest = np.abs(errors).max(axis=1)
    share = float((largest <= WANTED_DEG).sum() / len(good))
    rms = np.sqrt((errors**2).mean(axis=1))
    p50, p95, p99 = np.percentile(largest, [50, 95, 99])
    azimuth_p99 = float(np.percentile(np.abs(found.azimuth_deg[good]), 99))
    azimuth = "-" if np.isnan(azimuth_p99) else f"{azimuth_p99:.3f}"
    print(
        f"{text} {np.median(found.predicted_deg[good]):9.3f} {np.median(rms):7.3f} {p50:7.3f} "
        f"{p95:7.3f} {p99:7.3f} {largest.max():7.3f} {100.0 * share:8.1f} {azimuth:>8}",
        flush=True,
    )
    return seconds, share


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=1000)
    options = parser.parse_args()
    started_s = time.perf_counter()
    lots = list(enumerate(lots_of(options.units)))
    print(f"{options.units} good units; heading errors in deg over 120 attitudes")
    print(
        f"{'poses':22} {'count':>5} {'rig s':>7} {'predicted':>9} {'rms':>7} {'max p50':>7} "
        f"{'p95':>7} {'p99':>7} {'largest':>7} {'<= 0.5 %':>8} {'azi p99':>8}"
    )
    found = {
        name: line(name, _joined([found_on(poses, lot, seed) for seed, lot in lots]))
        for name, poses in sets_of_poses().items()
    }
    line("four_position, level", _joined([found_level(lot, seed) for seed, lot in lots]))
    line("adaptive", _joined([found_adaptively(lot, seed) for seed, lot in lots]))
    ratio = found["quick"][0] / found["caruso_24"][0]
    elapsed_s = time.perf_counter() - started_s
    print(f"quick takes {ratio:.2f} of the rig time of caruso_24; {elapsed_s:.0f} s")
    met = ratio <= WANTED_TIME and found["quick"][1] >= WANTED_SHARE
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
