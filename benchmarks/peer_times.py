"""Time of one unit's coefficients, and of a unit among many, of peers and product.

Thirty-six poses all round and tilted to 45 deg, noise of 0.1 % of the field; every unit is
another. The best of several rounds counts, in which all take turns. Of the ellipsoid the time of
its coefficients is also taken alone: peers give neither covariance nor prediction, nor the
refusals that are still in it.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from estimators import STRENGTH_MG, Readings, Unit, read, spread_attitudes_deg, station_mg
from peer_cells import CellKey, one_set
from peer_errors import coefficients, ellipsoid, tilt_aided, truth_aided, truth_linear
from peer_processes import Peer, fitted_by

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

TIMED: Final = (CellKey(180.0, 36, 0.001), CellKey(45.0, 36, 0.001))
KERNELS: Final = {
    "coefficients": coefficients,
    "ellipsoid": ellipsoid,
    "tilt_aided": tilt_aided,
    "truth_aided": truth_aided,
    "truth_linear": truth_linear,
}
SAMPLES: Final = {"mag_cal": 200, "magcal": 200, "magcc": 60, "magyc": 60, "min_max": 200}
PARTS: Final = {"tilt_aided": 5, "truth_aided": 10}
"""The slower kernels are timed on one in so many of the units."""
SINGLES: Final = 40
ROUNDS: Final = 3
PASSES: Final = 8
"""Of the peers and of one unit at a time; the machine is never quiet for long."""
BATCH_PASSES: Final = 3


class Seconds(NamedTuple):
    """Processor time of one unit alone and of a unit among many."""

    single: float
    batched: float


def many_units(key: CellKey, count: int, seed: int) -> Readings:
    """Return readings of units that all differ, soft and hard iron as `estimators.drawn_unit`."""
    rng = np.random.default_rng(seed)
    perfect = Unit(
        gain=np.eye(3), offset_mg=np.zeros(3), accel_gain=np.eye(3), accel_offset_g=np.zeros(3)
    )
    attitudes_deg = spread_attitudes_deg(key.poses, key.tilt_deg)
    true = read(perfect, attitudes_deg, 0.0, count, seed)

    def sensed(
        values: NDArray[np.float64], gain_sd: float, offset_sd: float
    ) -> NDArray[np.float64]:
        gain = np.eye(3) + rng.normal(0.0, gain_sd, (count, 3, 3))
        offset = rng.normal(0.0, offset_sd, (count, 1, 3))
        return np.asarray(values @ np.swapaxes(gain, 1, 2) + offset)

    noise_mg = rng.normal(0.0, key.noise * STRENGTH_MG, true.field_mg.shape)
    return Readings(
        attitudes_deg=attitudes_deg,
        field_mg=sensed(true.field_mg, 0.05, 80.0) + noise_mg,
        accel_g=true.accel_g,
        raw_accel_g=sensed(true.raw_accel_g, 0.015, 0.03),
    )


def units_of(readings: Readings, index: int | slice) -> Readings:
    """Return the readings of some units."""
    return Readings(
        attitudes_deg=readings.attitudes_deg,
        field_mg=readings.field_mg[index],
        accel_g=readings.accel_g[index],
        raw_accel_g=readings.raw_accel_g[index],
    )


def times_of(key: CellKey, peers: list[Peer], units: int, seed: int) -> dict[str, Seconds]:
    """Return the times of peers and product; a peer's among many is that of its loop."""
    readings = many_units(key, units, seed)
    sd_mg = key.noise * STRENGTH_MG
    best: dict[str, Seconds] = {}
    for _ in range(ROUNDS):
        for peer in peers:
            each_s = _looped_s(peer, readings, sd_mg)
            if each_s is not None:
                _keep(best, peer.name, Seconds(each_s, each_s))
        for name, kernel in KERNELS.items():
            part = units_of(readings, slice(max(units // PARTS.get(name, 1), 1)))
            _keep(best, name, _product_s(kernel, part, sd_mg))
    return best


def _keep(best: dict[str, Seconds], name: str, now: Seconds) -> None:
    before = best.get(name, now)
    best[name] = Seconds(min(before.single, now.single), min(before.batched, now.batched))


def _looped_s(peer: Peer, readings: Readings, sd_mg: float) -> float | None:
    sample = units_of(readings, slice(SAMPLES[peer.name]))
    timed = one_set("timed", sample, sd_mg, passes=PASSES, limit_s=np.inf)
    found = fitted_by(peer, {"sets": ["timed"], "station_mg": station_mg(), **timed})
    if isinstance(found, str):
        return None
    return float(found["timed_seconds"].min()) / len(sample.field_mg)


def _product_s(
    kernel: Callable[[Readings, float], object], readings: Readings, sd_mg: float
) -> Seconds:
    alone = [units_of(readings, index) for index in range(min(SINGLES, len(readings.field_mg)))]
    single_s = min(
        _processor_s(lambda: [kernel(one, sd_mg) for one in alone]) for _ in range(PASSES)
    )
    batch_s = min(_processor_s(lambda: kernel(readings, sd_mg)) for _ in range(BATCH_PASSES))
    return Seconds(single_s / len(alone), batch_s / len(readings.field_mg))


def _processor_s(work: Callable[[], object]) -> float:
    start_s = time.process_time()
    work()
    return time.process_time() - start_s
