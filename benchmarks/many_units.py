"""Good units on their rigs in numpy: what `devices` simulates tick by tick, one reading a pose.

Units and rigs are drawn by `devices`; a leg between poses is walked in a few straight steps, so
that hysteresis and repeatability remember the way. Left out: frames, the ring-down after a stop
(the bench waits for it), and the converter's steps beyond their variance, which the noise dithers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.travel import SETTLE_S, azimuth_path_deg, travel_time_s
from devices.accelerometer import NOISE_G
from devices.bridge import ACROSS, REFERENCE_C, REPEATABILITY_PATH_MG
from devices.field import EarthField
from devices.mechanics import draw_encoder
from devices.rig import BACKLASH_DEG, draw_rig
from devices.unit import NOISE_MG, PINK_SHARE, ModuleUnit, draw_unit
from devices.world import SlowDrift

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
ENCODER_STREAM: Final = 0x5E7


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
    """Units, each on its own rig; arrays of shape (units, ...).

    `values` holds the bridges' parameters by their names in `BridgeParameters`, (units, 3);
    `accel` bias, drift, quadratic and cubic terms, (4, units, 3); `geometry` the angles of
    `RigGeometry` in rad, (units, 5); `encoders` amplitudes by axis, (units, 3, 3, 3): order,
    cosine and sine in degrees; `like` is one of them, for what all have alike.
    """

    soft_iron: NDArray[np.float64]
    hard_iron_mg: NDArray[np.float64]
    values: dict[str, NDArray[np.float64]]
    accel_matrix: NDArray[np.float64]
    accel: NDArray[np.float64]
    ambient_c: NDArray[np.float64]
    geometry: NDArray[np.float64]
    encoders: NDArray[np.float64]
    like: ModuleUnit


BRIDGE: Final = (
    "sensitivity", "sensitivity_tempco_per_c", "hk_mg", "cubic_per_mg2", "hysteresis_mg",
    "repeatability_mg",
)  # fmt: skip


def drawn_lot(first: int, count: int) -> Lot:
    """Return units first, first + 1, ..., each with the rig of its number."""
    units = [draw_unit(f"GU{number:04d}", number) for number in range(first, first + count)]
    rigs = [draw_rig(number).geometry for number in range(first, first + count)]
    encoders = []
    for number in range(first, first + count):
        rng = np.random.default_rng((ENCODER_STREAM, number))
        encoders.append([draw_encoder(rng).harmonics for _ in range(3)])
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
        geometry=np.deg2rad(
            [
                (
                    rig.base_level_north_deg,
                    rig.base_level_east_deg,
                    rig.azimuth_pitch_squareness_deg,
                    rig.pitch_roll_squareness_deg,
                    rig.wobble_deg,
                )
                for rig in rigs
            ]
        ),
        encoders=np.array(encoders),
        like=units[0],
    )


def way_of(poses: Sequence[PlannedPose], home: Attitude) -> Way:
    """Return the rig's way from an attitude through poses, the azimuth wound as the rig does."""
    shown, side, seconds = [], [], []
    here = np.array([home.azimuth_deg, home.pitch_deg, home.roll_deg])
    present, sides, time_s = home, np.ones(3), 0.0
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


def read(
    lot: Lot, way: Way, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the readings (field in mG, force in g) at the poses, each (units, n, 3)."""
    axes = _ned_from_body(lot, way)
    t_s = np.repeat(way.seconds, STEPS)
    drift = np.array([SlowDrift().field_ned_mg(float(t)) for t in t_s])
    field_mg = np.einsum(
        "untji,ntj->unti", axes, (EarthField().ned_mg + drift).reshape(-1, STEPS, 3)
    )
    sensor_mg = np.einsum("uij,untj->unti", lot.soft_iron, field_mg)
    sensor_mg += lot.hard_iron_mg[:, None, None]
    heated = 1.0 - np.exp(-way.seconds / lot.like.heating_s)
    warm_c = lot.ambient_c[:, None] + lot.like.self_heating_c * heated - REFERENCE_C
    return (
        _field_mg(lot, sensor_mg, warm_c[..., None], way, rng),
        _force_g(lot, -axes[:, :, -1, 2], warm_c[..., None], way, rng),
    )


def _field_mg(
    lot: Lot,
    sensor_mg: NDArray[np.float64],
    warm_c: NDArray[np.float64],
    way: Way,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    values = {name: value[:, None] for name, value in lot.values.items()}
    h = _lagging_mg(lot, sensor_mg) + _repeated_mg(lot, sensor_mg, rng)
    h = h + values["cubic_per_mg2"] * h**3
    h = h * values["sensitivity"] * (1.0 + values["sensitivity_tempco_per_c"] * warm_c)
    across_mg = sensor_mg[:, :, -1, list(ACROSS)]
    reading = h / (1.0 - (across_mg / values["hk_mg"]) ** 2)
    samples = 2.0 * SAMPLES_PER_S * way.dwell_s[:, None]
    white = NOISE_MG**2 * (1.0 - PINK_SHARE**2) + lot.like.mag_mg_per_count**2 / 12.0
    return np.asarray(reading + np.sqrt(white / samples) * rng.standard_normal(reading.shape))


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


def _force_g(
    lot: Lot,
    force_g: NDArray[np.float64],
    warm_c: NDArray[np.float64],
    way: Way,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    seen = np.einsum("uij,unj->uni", lot.accel_matrix, force_g)
    bias, drift, quadratic, cubic = (one[:, None] for one in lot.accel)
    steps_s = np.diff(way.seconds, prepend=0.0)[:, None]
    shape = seen.shape
    step_g = lot.like.accel_wander_g * np.sqrt(steps_s / WANDER_S)
    wander = np.cumsum(step_g * rng.standard_normal(shape), axis=1)
    noise = NOISE_G / np.sqrt(SAMPLES_PER_S * way.dwell_s[:, None]) * rng.standard_normal(shape)
    bent = seen**2 * (quadratic + cubic * seen)
    return np.asarray(seen + bias + drift * warm_c + bent + wander + noise)


def _ned_from_body(lot: Lot, way: Way) -> NDArray[np.float64]:
    """Return the seat's true rotation, shape (units, n, steps, 3, 3)."""
    shown_deg = way.shown_deg[None]
    angle_deg = shown_deg - 0.5 * BACKLASH_DEG * way.side[None, :, None]
    for order, cosine, sine in np.moveaxis(lot.encoders, (2, 3), (0, 1)):
        phase_rad = np.deg2rad(order[:, None, None] * shown_deg)
        angle_deg = angle_deg - cosine[:, None, None] * np.cos(phase_rad)
        angle_deg = angle_deg - sine[:, None, None] * np.sin(phase_rad)
    azimuth, pitch, roll = np.deg2rad(np.moveaxis(angle_deg, -1, 0))
    north, east, pitch_skew, roll_skew, wobble = lot.geometry.T[:, :, None, None]
    one, none = np.ones_like(north), np.zeros_like(north)
    base = _turned((one, none, none), north) @ _turned((none, one, none), east)
    return np.asarray(
        base
        @ _turned((none, none, one), azimuth)
        @ _turned((one, none, none), wobble)
        @ _turned((none, np.cos(pitch_skew), np.sin(pitch_skew)), pitch)
        @ _turned((np.cos(roll_skew), np.sin(roll_skew), none), roll)
    )


def _turned(
    axis: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    angle_rad: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the rotations, (..., 3, 3), by angles about unit axes (Rodrigues)."""
    x, y, z = np.broadcast_arrays(*axis)
    none = np.zeros_like(x)
    cross = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=-1).reshape(*x.shape, 3, 3)
    sine, cosine = np.sin(angle_rad)[..., None, None], np.cos(angle_rad)[..., None, None]
    return np.asarray(np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross))
