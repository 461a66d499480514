"""Rigs, seats and fields in numpy: what holds the units of `many_units`, and what it is off by.

Rigs are drawn by `devices`; what the station's record knows only to within an uncertainty is drawn
from that, U/2 being one standard deviation: the seat's index, level and iron, the azimuth of the
field, its drift's phase, and its change over the way from the axes' crossing to the sensor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from devices.field import EarthField
from devices.mechanics import draw_encoder
from devices.rig import BACKLASH_DEG, draw_rig
from devices.world import SlowDrift

if TYPE_CHECKING:
    from many_units import Way
    from numpy.typing import NDArray

    from bench.station import Station

ENCODER_STREAM: Final = 0x5E7
SEAT_STREAM: Final = 0x5EA
GEOMETRY: Final = (
    "base_level_north_deg", "base_level_east_deg", "azimuth_pitch_squareness_deg",
    "pitch_roll_squareness_deg", "wobble_deg",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Benches:
    """One bench a unit; arrays of shape (units, ...), angles in degrees.

    `geometry_deg` holds the angles of `RigGeometry`, (units, 5); `encoders` amplitudes by axis,
    (units, 3, 3, 3): order, cosine and sine. `index_deg`, `level_deg` (pitch, roll) and `iron_mg`
    are the seat's; `field_azimuth_deg` is the true one less the station's; `gradient_mg`,
    (units, 3, 3), turns the seat's attitude into a change of the field, NED, by `lever`, a unit
    vector of the seat; `phases_rad` are the drift's.
    """

    geometry_deg: NDArray[np.float64]
    encoders: NDArray[np.float64]
    index_deg: NDArray[np.float64]
    level_deg: NDArray[np.float64]
    iron_mg: NDArray[np.float64]
    field_azimuth_deg: NDArray[np.float64]
    gradient_mg: NDArray[np.float64]
    lever: NDArray[np.float64]
    phases_rad: NDArray[np.float64]


def drawn_benches(first: int, count: int, station: Station) -> Benches:
    """Return the rigs of numbers first, first + 1, ..., with seats of a station."""
    numbers = range(first, first + count)
    rigs = [draw_rig(number).geometry for number in numbers]
    encoders = []
    for number in numbers:
        rng = np.random.default_rng((ENCODER_STREAM, number))
        encoders.append([draw_encoder(rng).harmonics for _ in range(3)])
    normal = np.array(
        [np.random.default_rng((SEAT_STREAM, number)).standard_normal(19) for number in numbers]
    )
    uniform = np.array(
        [np.random.default_rng((SEAT_STREAM, number, 1)).random(2) for number in numbers]
    )
    seat, around = station.seat, station.surroundings
    u_iron_mg = np.array([seat.u_iron_mg, seat.u_iron_mg, seat.u_iron_down_mg])
    return Benches(
        geometry_deg=np.array([[getattr(rig, name) for name in GEOMETRY] for rig in rigs]),
        encoders=np.array(encoders),
        index_deg=0.5 * seat.u_index_deg * normal[:, 0],
        level_deg=0.5 * seat.u_level_deg * normal[:, 1:3],
        iron_mg=0.5 * u_iron_mg * normal[:, 3:6],
        field_azimuth_deg=0.5 * station.u_field_azimuth_deg * normal[:, 6],
        gradient_mg=0.5 * around.u_gradient_mg * normal[:, 7:16].reshape(-1, 3, 3),
        lever=normal[:, 16:] / np.linalg.norm(normal[:, 16:], axis=1, keepdims=True),
        phases_rad=2.0 * np.pi * uniform,
    )


def site_field_mg(benches: Benches) -> NDArray[np.float64]:
    """Return the site's undisturbed field in the rig's frame, shape (units, 3)."""
    turned = _turned_about("z", np.deg2rad(benches.field_azimuth_deg))
    return np.asarray(turned @ np.array(EarthField().ned_mg))


def field_at_sensor_mg(
    benches: Benches, axes: NDArray[np.float64], t_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the field at the sensor in the rig's frame, (units, n, steps, 3), without iron.

    Parameters
    ----------
    axes : ndarray, shape (units, n, steps, 3, 3)
        True rotations of the seat.
    t_s : ndarray, shape (n,)
        Time of each pose.
    """
    like = SlowDrift()
    turns = 2.0 * np.pi * t_s / np.array(like.periods_s)[:, None]
    sizes = np.sin(turns + benches.phases_rad[:, :, None])
    size_mg = (np.array(like.amplitudes_mg)[:, None] * sizes).sum(axis=1)
    drift_mg = size_mg[:, :, None, None] * np.array(like.direction_ned)
    place = np.einsum("untij,uj->unti", axes, benches.lever)
    off_mg = np.einsum("uij,untj->unti", benches.gradient_mg, place)
    return np.asarray(site_field_mg(benches)[:, None, None] + drift_mg + off_mg)


def ned_from_seat(benches: Benches, way: Way) -> NDArray[np.float64]:
    """Return the seat's true rotation, shape (units, n, steps, 3, 3)."""
    shown_deg = way.shown_deg[None]
    angle_deg = shown_deg - 0.5 * BACKLASH_DEG * way.side[None, :, None]
    for order, cosine, sine in np.moveaxis(benches.encoders, (2, 3), (0, 1)):
        phase_rad = np.deg2rad(order[:, None, None] * shown_deg)
        angle_deg = angle_deg - cosine[:, None, None] * np.cos(phase_rad)
        angle_deg = angle_deg - sine[:, None, None] * np.sin(phase_rad)
    azimuth, pitch, roll = np.deg2rad(np.moveaxis(angle_deg, -1, 0))
    small = np.deg2rad(benches.geometry_deg).T[:, :, None, None]
    north, east, pitch_skew, roll_skew, wobble = small
    one, none = np.ones_like(north), np.zeros_like(north)
    base = _turned((one, none, none), north) @ _turned((none, one, none), east)
    rig = (
        base
        @ _turned((none, none, one), azimuth)
        @ _turned((one, none, none), wobble)
        @ _turned((none, np.cos(pitch_skew), np.sin(pitch_skew)), pitch)
        @ _turned((np.cos(roll_skew), np.sin(roll_skew), none), roll)
    )
    return np.asarray(rig @ seat_from_body(benches)[:, None, None])


def seat_from_body(benches: Benches) -> NDArray[np.float64]:
    """Return the body's rotation in the roll axis's frame, shape (units, 3, 3)."""
    index = _turned_about("z", np.deg2rad(benches.index_deg))
    pitch = _turned_about("y", np.deg2rad(benches.level_deg[:, 0]))
    roll = _turned_about("x", np.deg2rad(benches.level_deg[:, 1]))
    return np.asarray(index @ pitch @ roll)


def _turned_about(axis: str, angle_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = (np.full_like(angle_rad, float(axis == name)) for name in "xyz")
    return _turned((x, y, z), angle_rad)


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
