"""Model of one unit in several mountings of one seat: raw = W v + b, v in the unit's frame.

The seat is turned against the rig's inner axis by R and carries iron s that turns with it; the
unit sits in the seat by Q. So v_unit = Q^T (R^T v_inner + s), where v_inner is the field that the
rig's angles turn, and likewise the force without s. The coefficients W, b are the unit's own and
the same in all mountings; they are those of the unit without the fixture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.mountings import SEAT_FROM_UNIT
from bench.calibration.prediction import DOWN
from bench.calibration.tilt import ned_from_body
from bench.calibration.truth_model import base_rotation, field_direction, rig_poses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData
    from bench.calibration.mountings import Mounting
    from bench.calibration.truth_model import RigPoses

SEAT_NAMES: Final = ("roll", "pitch", "index", "iron_x", "iron_y", "iron_z")
"""The seat's parameters, the last six of the model's 34."""
UNKNOWNS: Final = 34
SEAT: Final = slice(28, 34)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mounted:
    """All poses of all mountings, one row a pose.

    Attributes
    ----------
    raw : ndarray, shape (n, 6)
        Magnetometer in mG, then accelerometer in g.
    angles_deg : ndarray, shape (n, 3)
        Azimuth, pitch and roll of the rig.
    mounting : ndarray of int, shape (n,)
        Index into `names`: which mounting of the run.
    unit_from_seat : ndarray, shape (n, 3, 3)
    noise : ndarray, shape (6,)
        Standard deviation of one row.
    strength_mg : float
        Strength of the station's field: it holds the common gain.
    """

    raw: NDArray[np.float64]
    angles_deg: NDArray[np.float64]
    poses: RigPoses
    names: tuple[Mounting, ...]
    mounting: NDArray[np.intp]
    unit_from_seat: NDArray[np.float64]
    noise: NDArray[np.float64]
    strength_mg: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeatState:
    """Parameters of the model; angles in rad, `inner_from_seat` is R."""

    gain: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    accel_gain: NDArray[np.float64]
    accel_offset_g: NDArray[np.float64]
    azimuth_rad: float
    dip_rad: float
    north_rad: float
    east_rad: float
    inner_from_seat: NDArray[np.float64]
    iron_mg: NDArray[np.float64]

    def stepped(self, step: NDArray[np.float64]) -> SeatState:
        """Return the state after a step of all 34 parameters; the seat turns in its own frame."""
        return replace(
            self,
            gain=self.gain + step[:9].reshape(3, 3),
            offset_mg=self.offset_mg + step[9:12],
            accel_gain=self.accel_gain + step[12:21].reshape(3, 3),
            accel_offset_g=self.accel_offset_g + step[21:24],
            azimuth_rad=self.azimuth_rad + float(step[24]),
            dip_rad=self.dip_rad + float(step[25]),
            north_rad=self.north_rad + float(step[26]),
            east_rad=self.east_rad + float(step[27]),
            inner_from_seat=self.inner_from_seat @ _turn(step[28:31]),
            iron_mg=self.iron_mg + step[31:34],
        )

    def seat_deg(self) -> tuple[float, float, float]:
        """Return index, pitch and roll of the seat: R = Rz(index) Ry(pitch) Rx(roll)."""
        turn = self.inner_from_seat
        return (
            float(np.rad2deg(np.arctan2(turn[1, 0], turn[0, 0]))),
            float(np.rad2deg(-np.arcsin(turn[2, 0]))),
            float(np.rad2deg(np.arctan2(turn[2, 1], turn[2, 2]))),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeatRows:
    """The model at a state.

    Attributes
    ----------
    modelled : ndarray, shape (n, 6)
    jacobian : ndarray, shape (n, 6, 34)
    field_unit_mg, force_unit_g : ndarray, shape (n, 3)
        What the unit is in.
    to_field, to_force : ndarray, shape (n, 3, 3)
        From a change of the field or force in the rig's inner frame to the raw readings.
    field_inner_mg, force_inner_g : ndarray, shape (n, 3)
    """

    modelled: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    field_unit_mg: NDArray[np.float64]
    force_unit_g: NDArray[np.float64]
    to_field: NDArray[np.float64]
    to_force: NDArray[np.float64]
    field_inner_mg: NDArray[np.float64]
    force_inner_g: NDArray[np.float64]


def mounted(parts: Sequence[tuple[Mounting, CalibrationData]], strength_mg: float) -> Mounted:
    """Return the poses of several mountings as one; every part has acceleration and rig angles."""
    raw, angles, number, turns = [], [], [], []
    for index, (name, data) in enumerate(parts):
        assert data.accel_g is not None  # noqa: S101
        assert data.azimuth_deg is not None  # noqa: S101
        assert data.pitch_deg is not None  # noqa: S101
        assert data.roll_deg is not None  # noqa: S101
        raw.append(np.hstack([data.field_mg, data.accel_g]))
        angles.append(np.stack([data.azimuth_deg, data.pitch_deg, data.roll_deg], axis=1))
        number += [index] * len(data)
        turns += [SEAT_FROM_UNIT[name].T] * len(data)
    angles_deg = np.concatenate(angles).astype(float)
    first = parts[0][1]
    return Mounted(
        raw=np.concatenate(raw),
        angles_deg=angles_deg,
        poses=rig_poses(*angles_deg.T),
        names=tuple(name for name, _ in parts),
        mounting=np.array(number, dtype=np.intp),
        unit_from_seat=np.array(turns),
        noise=np.repeat([first.field_sd_mg, first.accel_sd_g], 3),
        strength_mg=strength_mg,
    )


def seat_rows(state: SeatState, data: Mounted) -> SeatRows:
    """Return the model's readings and their derivatives by its 34 parameters.

    Parameters in order: W by rows, b; the accelerometer's W by rows, b; field azimuth, dip, base
    level north and east; then `SEAT_NAMES`. Angles are in rad.
    """
    back = base_rotation(state.north_rad, state.east_rad).T
    seat_from_inner = state.inner_from_seat.T
    unit_from_inner = data.unit_from_seat @ seat_from_inner
    field_rig, force_rig, by_direction = _vectors(state, back, data.strength_mg)
    field_inner, force_inner = data.poses.turned(field_rig), data.poses.turned(force_rig)
    field_seat, force_seat = field_inner @ seat_from_inner.T, force_inner @ seat_from_inner.T
    field_unit = _each(data.unit_from_seat, field_seat + state.iron_mg)
    force_unit = _each(data.unit_from_seat, force_seat)
    jacobian = _by_coefficients(field_unit, force_unit)
    to_field, to_force = state.gain @ unit_from_inner, state.accel_gain @ unit_from_inner
    for column, change in zip((24, 25), by_direction, strict=True):
        jacobian[:, :3, column] = _each(to_field, data.poses.turned(change))
    for axis in range(2):
        tilt = np.eye(3)[axis]
        at = 26 + axis
        jacobian[:, :3, at] = _each(to_field, data.poses.turned(np.cross(field_rig, tilt)))
        jacobian[:, 3:, at] = _each(to_force, data.poses.turned(np.cross(force_rig, tilt)))
    jacobian[:, :, SEAT] = _by_seat(state, data, field_seat, force_seat)
    modelled = np.hstack(
        [
            field_unit @ state.gain.T + state.offset_mg,
            force_unit @ state.accel_gain.T + state.accel_offset_g,
        ]
    )
    return SeatRows(
        modelled=modelled,
        jacobian=jacobian,
        field_unit_mg=field_unit,
        force_unit_g=force_unit,
        to_field=to_field,
        to_force=to_force,
        field_inner_mg=field_inner,
        force_inner_g=force_inner,
    )


def _by_coefficients(
    field_unit: NDArray[np.float64], force_unit: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the jacobian, shape (n, 6, 34), with the unit's 24 coefficients filled in."""
    jacobian = np.zeros((len(field_unit), 6, UNKNOWNS))
    for axis in range(3):
        jacobian[:, axis, 3 * axis : 3 * axis + 3] = field_unit
        jacobian[:, axis, 9 + axis] = 1.0
        jacobian[:, 3 + axis, 12 + 3 * axis : 15 + 3 * axis] = force_unit
        jacobian[:, 3 + axis, 21 + axis] = 1.0
    return jacobian


def _by_seat(
    state: SeatState,
    data: Mounted,
    field_seat: NDArray[np.float64],
    force_seat: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the derivatives, shape (n, 6, 6), by the seat's turn and its iron."""
    from_field = state.gain @ data.unit_from_seat
    from_force = state.accel_gain @ data.unit_from_seat
    found = np.zeros((len(data.raw), 6, len(SEAT_NAMES)))
    for axis, turn in enumerate(np.eye(3)):
        found[:, :3, axis] = _each(from_field, np.cross(field_seat, turn))
        found[:, 3:, axis] = _each(from_force, np.cross(force_seat, turn))
    found[:, :3, 3:] = from_field
    return found


def seat_rotation(index_deg: float, pitch_deg: float, roll_deg: float) -> NDArray[np.float64]:
    """Return R = inner_from_seat, shape (3, 3), of a seat's index, pitch and roll."""
    return np.asarray(ned_from_body(index_deg, pitch_deg, roll_deg))


def _vectors(
    state: SeatState, back: NDArray[np.float64], strength_mg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[NDArray[np.float64]]]:
    """Return field and force in the rig's frame, and the field's changes by azimuth and dip."""
    azimuth, dip = state.azimuth_rad, state.dip_rad
    by_azimuth = np.cos(dip) * np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    by_dip = field_direction(azimuth, dip + np.pi / 2.0)
    field = strength_mg * (back @ field_direction(azimuth, dip))
    return field, -back @ DOWN, [strength_mg * (back @ by_azimuth), strength_mg * (back @ by_dip)]


def _each(matrices: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrices (n, 3, 3) times vectors (n, 3), row by row."""
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def _turn(rotation_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation, shape (3, 3), of a rotation vector, by Rodrigues' formula."""
    angle = float(np.linalg.norm(rotation_rad))
    x, y, z = rotation_rad
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))
