"""What the terms of the bridges cost, what a run sees of them, and what taking them out gives.

Run:  python benchmarks/bridge.py --units 1000

Every good unit goes through the poses of a procedure on its own bench. First table: the term by
the run against the unit's own, the standard deviation that the run claims, and the share of units
within two of them; of the play the rig's ring-down takes a part back, which the run cannot see.

Second table: the truth-aided calibration on the readings as they are, without the cross-axis term,
and besides without the play as far as the run sees it. Residual of the fit, heading error over the
procedure's verification poses as the bench reads it, and that of the coefficients alone, on
noiseless readings in the middle of the play. Exits 1 where taking out the cross-axis term does not
make the residual and the coefficients' error smaller.
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
from many_fits import STATION, Calibrated, calibrated, data_of
from many_units import STRAIGHT, Lot, Readings, Way, drawn_lot, perfect_readings, read, way_of
from verifications import poses_of

from bench.acceptance.site import field_rig_mg, total_field_mg
from bench.calibration.cross_axis import cross_axis_of
from bench.calibration.crossed_field import CROSS_AXIS
from bench.calibration.hysteresis import hysteresis_of
from bench.calibration.temperature import (
    accel_drift_g_per_c,
    offset_tempco_mg_per_c,
    sensitivity_tempco_per_c,
)
from bench.calibration.tilt import ned_from_body
from bench.pose import Attitude
from bench.procedure_loader import load_procedure
from bench.steps.verify import Verify
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

HOME: Final = Attitude(azimuth_deg=0.0)
POWER_ON_S: Final = 40.0
"""Time from power-on to the first calibration pose."""
BLOCK: Final = 100
WAYS: Final = ("as read", "without cross-axis term", "... and without play seen")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """What runs told of terms, (units, 3) or (units, 1): value, claimed deviation, the unit's."""

    value: NDArray[np.float64]
    sd: NDArray[np.float64]
    own: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tour:
    """The poses of a procedure: the first `count` calibrate, the others verify."""

    way: Way
    count: int
    direction: NDArray[np.int_]

    @property
    def shown_deg(self) -> NDArray[np.float64]:
        """Azimuth, pitch and roll that the rig shows at the poses, shape (n, 3)."""
        return self.way.shown_deg[:, -1]


def tour_of(procedure: str) -> Tour:
    """Return the poses of a shipped procedure in its order."""
    calibrating = poses_of(procedure)
    steps = load_procedure(procedure).walk()
    verifying = [pose for step in steps if isinstance(step, Verify) for pose in step.poses()]
    poses = [*calibrating, *verifying]
    return Tour(
        way=way_of(poses, HOME, POWER_ON_S),
        count=len(calibrating),
        direction=np.array([pose.direction for pose in poses]),
    )


def terms_of(lot: Lot, tour: Tour, readings: Readings, fits: Calibrated) -> dict[str, Seen]:
    """Return what the runs of a lot tell of each term."""
    own, rows = lot.values, range(len(lot.ambient_c))
    across = list(CROSS_AXIS)
    data = [data_of(tour.shown_deg, readings, unit, tour.count) for unit in rows]
    cross = [cross_axis_of(one) for one in data]
    level = (tour.shown_deg[: tour.count, 1:] == 0.0).all(axis=1)
    swept = level & (tour.direction[: tour.count] != 0)
    azimuth_deg, direction = tour.shown_deg[: tour.count][swept, 0], tour.direction[: tour.count]
    plays = [hysteresis_of(one.field_mg[swept], azimuth_deg, direction[swept]) for one in data]
    warm = [_tempcos(tour, readings, fits, unit) for unit in rows]
    terms = {
        "Hk (mG)": Seen(
            value=np.array([one.seen_mg for one in cross]),
            sd=np.array([one.sd_mg for one in cross]),
            own=own["hk_mg"] * _gain(lot, readings)[:, across],
        ),
        "play (mG)": Seen(
            value=np.array([one.half_width_mg for one in plays]),
            sd=np.array([one.sd_mg for one in plays]),
            own=own["hysteresis_mg"] * own["sensitivity"],
        ),
    }
    truths = (
        ("offset tempco (mG/C)", own["offset_tempco_mg_per_c"]),
        ("sensitivity tempco (%/C)", 100.0 * own["sensitivity_tempco_per_c"].mean(axis=1)[:, None]),
        ("accelerometer drift (mg/C)", 1000.0 * lot.accel[1]),
    )
    for number, (name, truth) in enumerate(truths):
        value, sd = np.array([one[number] for one in warm]).swapaxes(0, 1)
        terms[name] = Seen(value=value, sd=sd, own=truth)
    return terms


def _gain(lot: Lot, readings: Readings) -> NDArray[np.float64]:
    """Return the sensitivity, (units, 3), at the mean temperature of the run."""
    warm_c = readings.temperature_c.mean(axis=1)[:, None] - 25.0
    values = lot.values
    return values["sensitivity"] * (1.0 + values["sensitivity_tempco_per_c"] * warm_c)


def _tempcos(
    tour: Tour, readings: Readings, fits: Calibrated, unit: int
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return value and deviation of each temperature coefficient of one unit, in shown units."""
    fit, temperature_c = fits.fit_of(unit), readings.temperature_c[unit]
    field_mg, total_mg = readings.field_mg[unit], total_field_mg(STATION)
    strength = np.linalg.norm(fit.corrected_mg(field_mg), axis=1) / total_mg
    attitude = ned_from_body(*tour.shown_deg.T)
    left_g = fit.corrected_g(readings.force_g[unit]) + attitude[:, 2, :]
    drift_sd = STATION.surroundings.u_drift_mg / 2.0 / total_mg
    found = (
        (1.0, offset_tempco_mg_per_c(field_mg, readings.offset_mg[unit], temperature_c)),
        (100.0, sensitivity_tempco_per_c(strength, temperature_c, drift_sd)),
        (1000.0, accel_drift_g_per_c(left_g, temperature_c, tour.way.seconds)),
    )
    return [(scale * one.per_c, scale * one.sd_per_c) for scale, one in found]


def calibrations(tour: Tour, readings: Readings, plays: Seen) -> list[Calibrated]:
    """Return the fits of a lot's readings in each of the `WAYS`."""
    as_read = replace(readings, offset_mg=np.zeros_like(readings.offset_mg))
    seen = plays.value > 2.0 * plays.sd
    lag_mg = np.where(seen, plays.value, 0.0)[:, None] * _rising(tour)
    unlagged = replace(readings, field_mg=readings.field_mg + lag_mg)
    return [calibrated(tour.shown_deg, one, tour.count) for one in (as_read, readings, unlagged)]


def _rising(tour: Tour) -> NDArray[np.float64]:
    """Return, (n, 3), whether the station's field on an axis rose (1) or fell as a leg ended."""
    legs = tour.way.shown_deg[:, STRAIGHT - 2 : STRAIGHT]
    azimuth_deg, pitch_deg, roll_deg = np.moveaxis(legs, -1, 0)
    field_mg = field_rig_mg(STATION) @ ned_from_body(azimuth_deg, pitch_deg, roll_deg)
    return np.asarray(np.sign(field_mg[:, 1] - field_mg[:, 0]))


def errors_of(
    lot: Lot, tour: Tour, readings: Readings, fits: Calibrated
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return heading errors at the verifying poses, (units, n): as read, and the coefficients'."""
    rows = slice(tour.count, None)
    heading_deg = fits.heading_deg(readings.field_mg[:, rows], readings.force_g[:, rows])
    read_deg = wrap_180_deg(heading_deg - tour.shown_deg[rows, 0])
    seats = seat_from_body(lot.benches)[:, None]
    seated = replace(readings, axes=ned_from_body(*tour.shown_deg[rows].T) @ seats)
    iron_mg = np.einsum("uij,uj->ui", lot.soft_iron, lot.benches.iron_mg)[:, None]
    heading_deg = fits.heading_deg(*perfect_readings(lot, seated, iron_mg))
    true_deg = tour.shown_deg[rows, 0] - lot.benches.field_azimuth_deg[:, None]
    return read_deg, wrap_180_deg(heading_deg - true_deg)


def show_terms(found: list[dict[str, Seen]]) -> None:
    """Print the first table."""
    print(f"{'term':28}{'unit, rms':>11}{'error rms':>11}{'sd claimed':>12}{'within 2 sd':>13}")
    for name in found[0]:
        value, sd, own = (
            np.concatenate([getattr(one[name], part) for one in found])
            for part in ("value", "sd", "own")
        )
        error, known = value - own, np.isfinite(value)
        if not known.any():
            print(f"{name:28}{np.sqrt((own**2).mean()):11.4g}   the poses do not show it")
            continue
        print(
            f"{name:28}{np.sqrt((own**2).mean()):11.4g}"
            f"{np.sqrt((error[known] ** 2).mean()):11.4g}{sd[known].mean():12.4g}"
            f"{100.0 * (np.abs(error[known]) < 2.0 * sd[known]).mean():11.1f} %"
        )


def show_ways(
    tour: Tour, found: list[list[tuple[Calibrated, NDArray[np.float64], NDArray[np.float64]]]]
) -> list[tuple[float, float]]:
    """Print the second table; return residual and largest error of the coefficients, each way."""
    level = (tour.shown_deg[tour.count :, 1:] == 0.0).all(axis=1)
    print(f"{'':28}{'residual':>9}{'chi2':>7}   as read: level, tilt   coefficients: level, tilt")
    kept = []
    for number, name in enumerate(WAYS):
        fits = [one[number][0].fits for one in found]
        residual = np.concatenate([one.residual_rms_mg for one in fits])
        chi2 = np.concatenate([one.chi2_reduced for one in fits])
        largest = [
            np.concatenate([np.abs(one[number][part][:, rows]).max(axis=1) for one in found])
            for part in (1, 2)
            for rows in (level, ~level)
        ]
        means = [float(one.mean()) for one in largest]
        print(
            f"{name:28}{residual.mean():9.4f}{chi2.mean():7.3f}"
            f"{means[0]:15.4f}{means[1]:8.4f}{means[2]:20.4f}{means[3]:8.4f}"
        )
        kept.append((float(residual.mean()), max(means[2:])))
    return kept


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=1000)
    parser.add_argument("--procedure", default="eol_three_axis")
    options = parser.parse_args()
    started_s = time.perf_counter()
    tour, terms, ways = tour_of(options.procedure), [], []
    for first in range(1, options.units + 1, BLOCK):
        lot = drawn_lot(first, min(BLOCK, options.units + 1 - first))
        readings = read(lot, tour.way, np.random.default_rng(first))
        terms.append(
            terms_of(lot, tour, readings, calibrated(tour.shown_deg, readings, tour.count))
        )
        fits = calibrations(tour, readings, terms[-1]["play (mG)"])
        ways.append([(one, *errors_of(lot, tour, readings, one)) for one in fits])
    print(f"{options.units} good units, {options.procedure}: {tour.count} poses calibrate")
    show_terms(terms)
    print("mean of the largest error of each unit, deg; residual in mG")
    before, after, _ = show_ways(tour, ways)
    met = after[0] < before[0] and after[1] < before[1]
    print(
        f"cross-axis term: {'met' if met else 'NOT MET'}; {time.perf_counter() - started_s:.0f} s"
    )
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
