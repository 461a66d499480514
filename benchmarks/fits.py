"""Fits per second of every calibration method: one unit, a batch of units, a loop over units.

    python benchmarks/fits.py [--units N] [--rounds N] [--json]

single  `fit_<method>` of one unit: refusals, fit, covariance, predicted heading error
batch   the method's kernel on all units at once
loop    the same kernel on one unit after the other, in a plain Python loop

The units are random good ones: 24 level headings and three at each of +-30 deg of pitch and
roll, hard and soft iron, set/reset pairs, noise. Batch and loop are timed in turn, round by
round, and their ratio is that of the best rounds; the loop runs over a part of the units.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from bench.calibration.accelerometer_batch import accelerometer_batch
from bench.calibration.ellipsoid_batch import ellipsoid_batch
from bench.calibration.fit import CalibrationData
from bench.calibration.four_position import four_position_batch
from bench.calibration.methods import METHODS
from bench.calibration.min_max import min_max_batch
from bench.calibration.set_reset import set_reset_batch
from bench.calibration.soft_iron import soft_iron_batch
from bench.calibration.three_headings import three_headings_batch
from bench.calibration.tilt import ned_from_body
from bench.calibration.tilt_aided_batch import tilt_aided_batch
from bench.calibration.truth_aided_batch import truth_aided_batch
from bench.calibration.two_axis_batch import two_axis_batch

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

LEVEL: Final = 24
TILT_DEG: Final = 30.0
STATION_MG: Final = 250.0 * np.array([1.0, 0.0, np.tan(np.deg2rad(60.0))])
FIELD_SD_MG: Final = 0.35
ACCEL_SD_G: Final = 0.0005
RIG_SD_DEG: Final = 0.02
HK_MG: Final = 8000.0
SINGLE_S: Final = 0.4
LOOPED_UNITS: Final = 300


@dataclass(frozen=True, kw_only=True, eq=False)
class Units:
    """Readings of many units at the same poses; arrays have units in front."""

    angles_deg: NDArray[np.float64]
    field_mg: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    accel_g: NDArray[np.float64]

    def data(self, unit: int) -> CalibrationData:
        """Return what a fit takes of one unit."""
        azimuth_deg, pitch_deg, roll_deg = self.angles_deg.T
        return CalibrationData(
            field_mg=self.field_mg[unit],
            accel_g=self.accel_g[unit],
            azimuth_deg=azimuth_deg,
            pitch_deg=pitch_deg,
            roll_deg=roll_deg,
            field_sd_mg=FIELD_SD_MG,
            accel_sd_g=ACCEL_SD_G,
            rig_sd_deg=RIG_SD_DEG,
            offset_mg=self.offset_mg[unit],
            station_field_mg=STATION_MG,
        )


class Speed(NamedTuple):
    """Fits per second of one method; None where it has no kernel for many units."""

    single: float
    batch: float | None
    loop: float | None

    @property
    def ratio(self) -> float | None:
        """How many times faster a batch is than a loop."""
        return None if self.batch is None or self.loop is None else self.batch / self.loop


def poses_deg() -> NDArray[np.float64]:
    """Return azimuth, pitch and roll of 36 poses, shape (36, 3)."""
    level = [(heading, 0.0, 0.0) for heading in np.arange(0.0, 360.0, 360.0 / LEVEL)]
    tilts = ((TILT_DEG, 0.0), (-TILT_DEG, 0.0), (0.0, TILT_DEG), (0.0, -TILT_DEG))
    tilted = [
        (heading + 30.0 * index, pitch, roll)
        for index, (pitch, roll) in enumerate(tilts)
        for heading in (45.0, 165.0, 285.0)
    ]
    return np.array([*level, *tilted])


def good_units(count: int, seed: int = 1) -> Units:
    """Return random good units: iron of 20 % and 5 %, bridges, noise."""
    rng = np.random.default_rng(seed)
    angles_deg = poses_deg()
    rotations = ned_from_body(*angles_deg.T)
    body_mg = np.einsum("nji,j->ni", rotations, STATION_MG)
    body_g = np.einsum("nji,j->ni", rotations, np.array([0.0, 0.0, -1.0]))
    iron = np.eye(3) + rng.normal(0.0, 0.03, (count, 3, 3))
    sense = np.eye(3) + rng.normal(0.0, 0.01, (count, 3, 3))
    field_mg = np.einsum("uij,nj->uni", iron, body_mg) + rng.normal(0.0, 50.0, (count, 1, 3))
    accel_g = np.einsum("uij,nj->uni", sense, body_g) + rng.normal(0.0, 0.02, (count, 1, 3))
    cross_mg = field_mg * field_mg[..., [1, 0, 0]] / HK_MG
    offset_mg = rng.normal(0.0, 30.0, (count, 1, 3)) - cross_mg
    return Units(
        angles_deg=angles_deg,
        field_mg=field_mg + rng.normal(0.0, FIELD_SD_MG, field_mg.shape),
        offset_mg=offset_mg + rng.normal(0.0, FIELD_SD_MG, field_mg.shape),
        accel_g=accel_g + rng.normal(0.0, ACCEL_SD_G, accel_g.shape),
    )


def kernels(units: Units) -> dict[str, Callable[[slice | int], object]]:
    """Return, for each method that has one, its kernel on the units of an index or a slice."""
    level_mg, tilted_mg = units.field_mg[:, :LEVEL, :2], units.field_mg[:, LEVEL:, :2]
    azimuth_deg = units.angles_deg[:LEVEL, 0]
    tilted_deg = units.angles_deg[LEVEL:].T
    quarters_mg, thirds_mg = level_mg[:, :: LEVEL // 4], level_mg[:, :: LEVEL // 3]
    thirds_deg = azimuth_deg[:: LEVEL // 3]
    sd_mg, station = FIELD_SD_MG, {"station_field_mg": STATION_MG}
    rig = {"field_sd_mg": sd_mg, "accel_sd_g": ACCEL_SD_G, "rig_sd_deg": RIG_SD_DEG}
    return {
        "set_reset": lambda of: set_reset_batch(units.field_mg[of], units.offset_mg[of]),
        "min_max": lambda of: min_max_batch(level_mg[of], sd_mg),
        "four_position": lambda of: four_position_batch(quarters_mg[of], sd_mg),
        "soft_iron": lambda of: soft_iron_batch(level_mg[of], sd_mg),
        "three_headings": lambda of: three_headings_batch(thirds_mg[of], thirds_deg, sd_mg),
        "ellipsoid": lambda of: ellipsoid_batch(units.field_mg[of], sd_mg, **station),
        "tilt_aided": lambda of: tilt_aided_batch(
            units.field_mg[of], units.accel_g[of], sd_mg, ACCEL_SD_G, **station
        ),
        "accelerometer": lambda of: accelerometer_batch(
            units.angles_deg, units.accel_g[of], accel_sd_g=ACCEL_SD_G, rig_sd_deg=RIG_SD_DEG
        ),
        "two_axis": lambda of: two_axis_batch(level_mg[of], None, tilted_mg[of], *tilted_deg),
        "two_axis_aided": lambda of: two_axis_batch(
            level_mg[of], azimuth_deg, tilted_mg[of], *tilted_deg
        ),
        "truth_aided": lambda of: truth_aided_batch(
            units.angles_deg, units.field_mg[of], units.accel_g[of], **rig, **station
        ),
    }


def seconds_of(work: Callable[[], object]) -> float:
    """Return how long a call takes."""
    started_s = time.perf_counter()
    work()
    return time.perf_counter() - started_s


def single_rate(method: str, units: Units) -> float:
    """Return fits per second of one unit after the other, each a whole Fit.

    Raises
    ------
    RuntimeError
        If a good unit is refused.
    """
    data = [units.data(unit) for unit in range(min(8, len(units.field_mg)))]
    refused = next((fit for fit in map(METHODS[method], data) if fit.refused), None)
    if refused is not None:
        message = f"{method} must accept good units; instead received: {refused.message}"
        raise RuntimeError(message)
    fastest_s, spent_s = float("inf"), 0.0
    while spent_s < SINGLE_S:
        took_s = seconds_of(lambda: [METHODS[method](one) for one in data])
        fastest_s, spent_s = min(fastest_s, took_s), spent_s + took_s
    return len(data) / fastest_s


def batch_and_loop(
    kernel: Callable[[slice | int], object], count: int, rounds: int
) -> tuple[float, float]:
    """Return fits per second of all units at once and of one after the other."""
    looped = range(min(LOOPED_UNITS, count))

    def loop() -> None:
        for unit in looped:
            kernel(unit)

    batch_s, loop_s = float("inf"), float("inf")
    for _ in range(rounds):
        batch_s = min(batch_s, seconds_of(lambda: kernel(slice(None))))
        loop_s = min(loop_s, seconds_of(loop))
    return count / batch_s, len(looped) / loop_s


def measured(units: Units, rounds: int) -> dict[str, Speed]:
    """Return the speed of every method."""
    batched = kernels(units)
    found = {}
    for method in METHODS:
        single = single_rate(method, units)
        rates: tuple[float | None, float | None] = (None, None)
        if method in batched:
            rates = batch_and_loop(batched[method], len(units.field_mg), rounds)
        found[method] = Speed(single, *rates)
    return found


def show(found: dict[str, Speed], count: int) -> None:
    """Print the table."""
    print(f"fits per second; {len(poses_deg())} poses, batch of {count} units")
    print(f"{'method':<16}{'single':>9}{'batch':>11}{'loop':>9}{'batch/loop':>12}")
    for method, speed in found.items():
        if speed.batch is None:
            print(f"{method:<16}{speed.single:>9.0f}   no kernel for many units")
        else:
            print(
                f"{method:<16}{speed.single:>9.0f}{speed.batch:>11.0f}{speed.loop:>9.0f}"
                f"{speed.ratio:>11.0f}x"
            )


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=10_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    found = measured(good_units(arguments.units), arguments.rounds)
    if arguments.json:
        speeds = {name: {**speed._asdict(), "ratio": speed.ratio} for name, speed in found.items()}
        print(json.dumps({"units": arguments.units, "fits_per_s": speeds}, indent=2))
    else:
        show(found, arguments.units)
    return 0


if __name__ == "__main__":
    sys.exit(main())
