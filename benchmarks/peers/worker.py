"""Coefficients that one peer gives for the readings of a file, in the peer's own process.

    PYTHON -I worker.py PEER readings.npz results.npz

PYTHON is that of the peer's environment. readings.npz holds `sets`, the names of its sets, and
for each set `<set>_field_mg` (units, n, 3), `<set>_sd_mg`, `<set>_passes` and `<set>_limit_s`;
`station_mg` (3,) for all. The units are fitted one after the other, as often as there are
passes; past the limit of time the first pass ends with the units done so far.

results.npz holds for each set `<set>_matrix` (k, 3, 3) and `<set>_offset_mg` (k, 3) of
corrected = matrix @ (raw - offset), `<set>_raised` (k,), and `<set>_seconds` (passes,) that a
pass of k units took of the processor, without what is between the calls.
"""

from __future__ import annotations

import importlib
import sys
import time
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Readings = NDArray[np.float64]
    Coefficients = tuple[Any, Any]
    Estimate = Callable[[Readings, Readings, float], Coefficients]

MG_OF_UT = 10.0
MG_OF_G = 1000.0
ITERATIONS = 2000


def mag_cal() -> Estimate:
    """Return the estimate of circuitpython-mag-cal: algebraic ellipsoid, field in uT."""
    sensor = importlib.import_module("mag_cal.sensor").Sensor

    def estimate(field_mg: Readings, _station_mg: Readings, _sd_mg: float) -> Coefficients:
        fitted = sensor()
        fitted.fit_ellipsoid(field_mg / MG_OF_UT)
        # It multiplies rows from the right.
        return fitted.transform.T, fitted.centre * MG_OF_UT

    return estimate


def magcal() -> Estimate:
    """Return the estimate of magcal: ellipsoid about the mean of the readings, field in uT."""
    fit = importlib.import_module("magcal.core").MagnetometerCalibrator().ellipsoid_fit

    def estimate(field_mg: Readings, _station_mg: Readings, _sd_mg: float) -> Coefficients:
        found = fit(field_mg / MG_OF_UT)
        return found["transform_matrix"], found["center"] * MG_OF_UT

    return estimate


def magcc() -> Estimate:
    """Return the estimate of magcc: least squares of the radius, field in uT."""
    fit = importlib.import_module("magcc.magcc").calibrate_lm

    def estimate(field_mg: Readings, station_mg: Readings, _sd_mg: float) -> Coefficients:
        found = fit(field_mg / MG_OF_UT, float(np.linalg.norm(station_mg)) / MG_OF_UT)
        return found[1], found[0] * MG_OF_UT

    return estimate


def magyc() -> Estimate:
    """Return the estimate of magyc's twostep: Alonso and Shuster, field in gauss."""
    fit = importlib.import_module("magyc.benchmark_methods").twostep_hsi

    def estimate(field_mg: Readings, station_mg: Readings, sd_mg: float) -> Coefficients:
        found = fit(field_mg / MG_OF_G, station_mg / MG_OF_G, ITERATIONS, sd_mg / MG_OF_G)
        return np.linalg.inv(found[1]), found[0] * MG_OF_G

    return estimate


def min_max() -> Estimate:
    """Return offset and gain of three axes from their extremes: no package, two lines."""

    def estimate(field_mg: Readings, _station_mg: Readings, _sd_mg: float) -> Coefficients:
        high, low = field_mg.max(axis=0), field_mg.min(axis=0)
        return np.diag(2.0 / (high - low)), (high + low) / 2.0

    return estimate


PEERS: dict[str, Callable[[], Estimate]] = {
    "mag_cal": mag_cal,
    "magcal": magcal,
    "magcc": magcc,
    "magyc": magyc,
    "min_max": min_max,
}


def fitted(
    estimate: Estimate, field_mg: Readings, station_mg: Readings, sd_mg: float, limit_s: float
) -> tuple[dict[str, NDArray[Any]], float]:
    """Return the coefficients of all units that the time allows, NaN where there are none."""
    units = len(field_mg)
    matrix, offset_mg = np.full((units, 3, 3), np.nan), np.full((units, 3), np.nan)
    raised = np.zeros(units, dtype=bool)
    spent_s, done = 0.0, 0
    for unit in range(units):
        start_s = time.process_time()
        try:
            gains, centre_mg = estimate(field_mg[unit], station_mg, sd_mg)
        except Exception:  # whatever a peer raises is its way to refuse
            gains, centre_mg = None, None
        spent_s += time.process_time() - start_s
        if gains is None:
            raised[unit] = True
        else:
            gains, centre_mg = np.real_if_close(gains), np.real_if_close(centre_mg)
            if np.isrealobj(gains) and np.isrealobj(centre_mg):
                matrix[unit], offset_mg[unit] = gains, centre_mg
        done = unit + 1
        if spent_s > limit_s:
            break
    results = {"matrix": matrix, "offset_mg": offset_mg, "raised": raised}
    return {name: values[:done] for name, values in results.items()}, spent_s


def main() -> int:
    """Fit all sets of the readings."""
    peer, readings_path, results_path = sys.argv[1:]
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    estimate = PEERS[peer]()
    readings = np.load(readings_path)
    results: dict[str, NDArray[Any]] = {}
    for name in readings["sets"]:
        field_mg, sd_mg = readings[f"{name}_field_mg"], float(readings[f"{name}_sd_mg"])
        limit_s, seconds = float(readings[f"{name}_limit_s"]), []
        found: dict[str, NDArray[Any]] = {}
        for _ in range(int(readings[f"{name}_passes"])):
            found, spent_s = fitted(estimate, field_mg, readings["station_mg"], sd_mg, limit_s)
            seconds.append(spent_s)
            field_mg = field_mg[: len(found["raised"])]
        results |= {f"{name}_{key}": values for key, values in found.items()}
        results[f"{name}_seconds"] = np.array(seconds)
    np.savez(results_path, **results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
