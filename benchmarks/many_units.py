"""Good units on their benches in numpy: what `devices` simulates tick by tick, a reading a pose.

Units and rigs are drawn by `devices`, what else a bench is off by by `many_benches`; a leg between
poses is walked in a few straight steps, so that hysteresis and repeatability remember the way. Left
out: frames, the ring-down's oscillation (its extremes are steps), and the converter's steps beyond
their variance, which the noise dithers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from many_benches import Benches, drawn_benches, field_at_sensor_mg, ned_from_seat, site_field_mg

from bench.station import load_station
from bench.travel import SETTLE_S, azimuth_path_deg, travel_time_s
from devices.accelerometer import NOISE_G
from devices.bridge import ACROSS, REFERENCE_C, REPEATABILITY_PATH_MG
from devices.unit import NOISE_MG, PINK_SHARE, ModuleUnit, draw_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.pose import Attitude
    from bench.steps.step import PlannedPose

STRAIGHT: Final = 6
"""Straight steps of a leg between two poses."""
SWINGS_DEG: Final = (0.020, -0.008, 0.0)
"""Extremes of an axis's ring-down after a stop: 0.03 deg, 14 Hz, decay 0.04 s."""
STEPS: Final = STRAIGHT + len(SWINGS_DEG)
SAMPLES_PER_S: Final = 100.0
WANDER_S: Final = 100.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Way:
    """A tour of the rig: poses in order, with the way to each.

    Attributes
    ----------
    shown_deg : ndarray, shape (n, steps, 3)
        Azimuth (wound), pitch and roll on the way to each pose, the last one at the pose.
    side : ndarray, shape (n, 3)
        +1 or -1 by the direction from which each axis came last.
    seconds : ndarray, shape (n,)
        Time at the end of each dwell.
    dwell_s : ndarray, shape (n,)
    back_s : float
        Time to level at 0 deg from the last pose.
    """

    shown_deg: NDArray[np.float64]
    side: NDArray[np.float64]
    seconds: NDArray[np.float64]
    dwell_s: NDArray[np.float64]
    back_s: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lot:
    """Units, each on its own bench; arrays of shape (units, ...).

    `values` holds the bridges' parameters by their names in `BridgeParameters`, (units, 3);
    `accel` bias, drift, quadratic and cubic terms, (4, units, 3); `like` is one of the units, for
    what all have alike.
    """

    soft_iron: NDArray[np.float64]
    hard_iron_mg: NDArray[np.float64]
    values: dict[str, NDArray[np.float64]]
    accel_matrix: NDArray[np.float64]
    accel: NDArray[np.float64]
    ambient_c: NDArray[np.float64]
    benches: Benches
    like: ModuleUnit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """What the units read at poses, and what there truly was; arrays of shape (units, n, ...).

    Attributes
    ----------
    field_mg, offset_mg : ndarray, shape (units, n, 3)
        Half the difference and half the sum of set and reset readings.
    force_g : ndarray, shape (units, n, 3)
    temperature_c : ndarray, shape (units, n)
    axes : ndarray, shape (units, n, 3, 3)
        True rotation of the seated body, in the rig's frame.
    there_mg : ndarray, shape (units, n, 3)
        Field at the sensor in the rig's frame, without the fixture's iron.
    wander_g : ndarray, shape (units, n, 3)
        Random walk of the accelerometer's zero.
    """

    field_mg: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    force_g: NDArray[np.float64]
    temperature_c: NDArray[np.float64]
    axes: NDArray[np.float64]
    there_mg: NDArray[np.float64]
    wander_g: NDArray[np.float64]


BRIDGE: Final = (
    "sensitivity", "sensitivity_tempco_per_c", "offset_mg", "offset_tempco_mg_per_c", "hk_mg",
    "cubic_per_mg2", "hysteresis_mg", "repeatability_mg",
)  # fmt: skip


def drawn_lot(first: int, count: int) -> Lot:
    """Return units first, first + 1, ..., each with the bench of its number."""
    units = [draw_unit(f"GU{number:04d}", number) for number in range(first, first + count)]
    accelerometers = [unit.accelerometer for unit in units]
    return Lot(
        soft_iron=np.array([unit.magnetics.soft_iron for unit in units]).reshape(-1, 3, 3),
        hard_iron_mg=np.array([unit.magnetics.hard_iron_mg for unit in units]),
        values={
            name: np.array([[getattr(one, name) for one in unit.bridges] for unit in units])
            for name in BRIDGE
        },
        accel_matrix=np.array([one.matrix for one in accelerometers]).reshape(-1, 3, 3),
        accel=np.array(
            [
                [one.bias_g, one.drift_g_per_c, one.quadratic_per_g, one.cubic_per_g2]
                for one in accelerometers
            ]
        ).swapaxes(0, 1),
        ambient_c=np.array([unit.ambient_c for unit in units]),
        benches=drawn_benches(first, count, load_station("default")),
        like=units[0],
    )


def way_of(poses: Sequence[PlannedPose], home: Attitude, start_s: float = 0.0) -> Way:
    """Return the rig's way from an attitude through poses, the azimuth wound as the rig does."""
    shown, side, seconds = [], [], []
    here = np.array([home.azimuth_deg, home.pitch_deg, home.roll_deg])
    present, sides, time_s = home, np.ones(3), start_s
    for pose in poses:
        direction = pose.direction or None
        path = azimuth_path_deg(present.azimuth_deg, pose.attitude.azimuth_deg, direction)
        time_s += travel_time_s(present, pose.attitude, direction) + SETTLE_S + pose.dwell_s
        there = np.array([path[-1], pose.attitude.pitch_deg, pose.attitude.roll_deg])
        share = np.arange(1, STRAIGHT + 1)[:, None] / STRAIGHT
        swings_deg = np.array(SWINGS_DEG)[:, None] * np.sign(there - here)
        shown.append(np.concatenate([here + share * (there - here), there + swings_deg]))
        sides = np.where(there == here, sides, np.sign(there - here))
        side.append(sides)
        seconds.append(time_s)
        here = there
        present = type(home)(azimuth_deg=there[0], pitch_deg=there[1], roll_deg=there[2])
    return Way(
        shown_deg=np.array(shown),
        side=np.array(side),
        seconds=np.array(seconds),
        dwell_s=np.array([pose.dwell_s for pose in poses]),
        back_s=travel_time_s(present, home),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Change:
    """What happens to units between two poses.

    `first` is the first pose after it; `iron_mg`, (units, 3), comes to the hard iron, and the
    magnetometer turns in its housing about the down axis, clockwise, by `turn_deg`, (units,).
    """

    first: int
    iron_mg: NDArray[np.float64]
    turn_deg: NDArray[np.float64]

    def changed_mg(self, field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the field in the turned magnetometer, (units, n, ..., 3), from that pose on."""
        turn_rad = np.deg2rad(self.turn_deg).reshape(-1, *[1] * (field_mg.ndim - 2))
        x, y, z = np.moveaxis(field_mg[:, self.first :], -1, 0)
        cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
        turned = np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1)
        return np.concatenate([field_mg[:, : self.first], turned], axis=1)

    def added_mg(self, sensor_mg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the field with the iron, (units, n, ..., 3), from that pose on."""
        iron_mg = self.iron_mg.reshape(-1, *[1] * (sensor_mg.ndim - 2), 3)
        changed = sensor_mg[:, self.first :] + iron_mg
        return np.concatenate([sensor_mg[:, : self.first], changed], axis=1)


def read(lot: Lot, way: Way, rng: np.random.Generator, change: Change | None = None) -> Readings:
    """Return the readings at the poses."""
    axes = ned_from_seat(lot.benches, way)
    there_mg = field_at_sensor_mg(lot.benches, axes, way.seconds)
    field_mg = np.einsum("untji,untj->unti", axes, there_mg)
    field_mg += lot.benches.iron_mg[:, None, None]
    field_mg = field_mg if change is None else change.changed_mg(field_mg)
    sensor_mg = np.einsum("uij,untj->unti", lot.soft_iron, field_mg)
    sensor_mg += lot.hard_iron_mg[:, None, None]
    sensor_mg = sensor_mg if change is None else change.added_mg(sensor_mg)
    warm_c = _temperature_c(lot, way)[..., None] - REFERENCE_C
    along_mg = _lagging_mg(lot, sensor_mg) + _repeated_mg(lot, sensor_mg, rng)
    half_difference, half_sum = _levels_mg(lot, along_mg, sensor_mg[:, :, -1], warm_c)
    samples = SAMPLES_PER_S * way.dwell_s[:, None]
    white = NOISE_MG**2 * (1.0 - PINK_SHARE**2) + lot.like.mag_mg_per_count**2 / 12.0
    white_mg = np.sqrt(white / (2.0 * samples))
    pink_mg = NOISE_MG * PINK_SHARE
    wander_g = _wander_g(lot, way, rng)
    shape = half_difference.shape
    noise_g = NOISE_G / np.sqrt(samples) * rng.standard_normal(shape)
    return Readings(
        field_mg=half_difference + white_mg * rng.standard_normal(shape),
        offset_mg=half_sum + np.hypot(white_mg, pink_mg) * rng.standard_normal(shape),
        force_g=_level_g(lot, -axes[:, :, -1, 2], warm_c) + wander_g + noise_g,
        temperature_c=warm_c[..., 0] + REFERENCE_C,
        axes=axes[:, :, -1],
        there_mg=there_mg[:, :, -1],
        wander_g=wander_g,
    )


def perfect_readings(
    lot: Lot, readings: Readings, added_mg: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return field and force, (units, n, 3), of the unit by itself at the true attitudes.

    Without noise and repeatability, in the middle of the play, in the site's undisturbed field, at
    the mean temperature and with the mean wander of the readings. `added_mg`, shape (units, 1,
    3), comes to the hard iron.
    """
    site_mg = site_field_mg(lot.benches)
    field_mg = np.einsum("unji,uj->uni", readings.axes, site_mg)
    sensor_mg = np.einsum("uij,unj->uni", lot.soft_iron, field_mg) + lot.hard_iron_mg[:, None]
    if added_mg is not None:
        sensor_mg += added_mg
    warm_c = readings.temperature_c.mean(axis=1)[:, None, None] - REFERENCE_C
    half_difference, _ = _levels_mg(lot, sensor_mg, sensor_mg, warm_c)
    force_g = _level_g(lot, -readings.axes[:, :, 2], warm_c)
    return half_difference, force_g + readings.wander_g.mean(axis=1, keepdims=True)


def _temperature_c(lot: Lot, way: Way) -> NDArray[np.float64]:
    heated = 1.0 - np.exp(-way.seconds / lot.like.heating_s)
    return np.asarray(lot.ambient_c[:, None] + lot.like.self_heating_c * heated)


def _levels_mg(
    lot: Lot,
    along_mg: NDArray[np.float64],
    across_mg: NDArray[np.float64],
    warm_c: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return half the difference and half the sum of set and reset levels, (units, n, 3)."""
    values = {name: value[:, None] for name, value in lot.values.items()}
    h = along_mg + values["cubic_per_mg2"] * along_mg**3
    h = h * values["sensitivity"] * (1.0 + values["sensitivity_tempco_per_c"] * warm_c)
    ratio = across_mg[..., list(ACROSS)] / values["hk_mg"]
    half_difference = h / (1.0 - ratio**2)
    offset_mg = values["offset_mg"] + values["offset_tempco_mg_per_c"] * warm_c
    return half_difference, offset_mg - half_difference * ratio


def _lagging_mg(lot: Lot, sensor_mg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the field behind its play at the poses, (units, n, 3)."""
    play_mg = lot.values["hysteresis_mg"]
    units, count = sensor_mg.shape[:2]
    lagging_mg = sensor_mg[:, 0, 0].copy()
    found = np.empty((units, count, 3))
    for pose in range(count):
        for step in range(STEPS):
            here_mg = sensor_mg[:, pose, step]
            lagging_mg = np.clip(lagging_mg, here_mg - play_mg, here_mg + play_mg)
        found[:, pose] = lagging_mg
    return found


def _repeated_mg(
    lot: Lot, sensor_mg: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the repeatability error at the poses, (units, n, 3)."""
    units, count = sensor_mg.shape[:2]
    steps_mg = np.linalg.norm(np.diff(sensor_mg.reshape(units, -1, 3), axis=1), axis=-1)
    path_mg = np.concatenate([np.full((units, 1), 1e3), steps_mg], axis=1).reshape(units, count, -1)
    kept = np.exp(-path_mg.sum(axis=2) / REPEATABILITY_PATH_MG)[..., None]
    error = np.zeros((units, 3))
    found = np.empty((units, count, 3))
    for pose in range(count):
        drawn = rng.standard_normal((units, 3))
        share = kept[:, pose]
        error = share * error + np.sqrt(1.0 - share**2) * drawn
        found[:, pose] = error
    return found * lot.values["repeatability_mg"][:, None]


def _level_g(
    lot: Lot, force_g: NDArray[np.float64], warm_c: NDArray[np.float64]
) -> NDArray[np.float64]:
    seen = np.einsum("uij,unj->uni", lot.accel_matrix, force_g)
    bias, drift, quadratic, cubic = (one[:, None] for one in lot.accel)
    return np.asarray(seen + bias + drift * warm_c + seen**2 * (quadratic + cubic * seen))


def _wander_g(lot: Lot, way: Way, rng: np.random.Generator) -> NDArray[np.float64]:
    steps_s = np.diff(way.seconds, prepend=0.0)[:, None]
    step_g = lot.like.accel_wander_g * np.sqrt(steps_s / WANDER_S)
    drawn = rng.standard_normal((len(lot.ambient_c), len(way.seconds), 3))
    return np.cumsum(step_g * drawn, axis=1)
