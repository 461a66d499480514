"""Normal equations of the rig's model at the parameters of many units.

Parameters in order: magnetometer's W by rows and b, field azimuth, dip; accelerometer's W by
rows and b, base level north and east (angles in rad): 28, or 14 of one sensor alone.

With D the sensors' variances and P (6 x 3) the derivative of a pose's readings by its three rig
angles times their standard deviation, the inverse of D + P P^T is
D^-1 - D^-1 P (1 + P^T D^-1 P)^-1 P^T D^-1: only 3 x 3 matrices are factorised.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.prediction import DOWN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.truth_model import RigPoses


class Triad(Enum):
    """One of the module's two triads."""

    MAGNETOMETER = "magnetometer"
    ACCELEROMETER = "accelerometer"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TruthModel:
    """What all units share: poses, field strength and noise; a sensor that is not there has None.

    Without an accelerometer the base counts as level.
    """

    poses: RigPoses
    strength: float
    field_sd: float | None
    accel_sd: float | None
    rig_sd_rad: float

    @property
    def sensors(self) -> tuple[Triad, ...]:
        """Return the sensors, each with 14 parameters, in their order."""
        given = zip(Triad, (self.field_sd, self.accel_sd), strict=True)
        return tuple(sensor for sensor, sd in given if sd is not None)

    @property
    def weight(self) -> NDArray[np.float64]:
        """Return 1/sd of a pose's readings, shape (e,)."""
        found = [sd for sd in (self.field_sd, self.accel_sd) if sd is not None]
        return 1.0 / np.repeat(found, 3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TruthRows:
    """The model's readings, (b, n, e), their derivatives by parameters and by rig angles.

    `rig` holds the derivative times the angles' standard deviation, `weight` is 1/sd, shape (e,).
    """

    modelled: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    rig: NDArray[np.float64]
    weight: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NormalEquations:
    """J^T S^-1 J, its right side J^T S^-1 r with r = raw - model, and r^T S^-1 r, by unit."""

    normal: NDArray[np.float64]
    slope: NDArray[np.float64]
    chi2: NDArray[np.float64]
    residual: NDArray[np.float64]


def truth_normal(
    model: TruthModel, parameters: NDArray[np.float64], raw: NDArray[np.float64]
) -> NormalEquations:
    """Return the normal equations of units at their parameters.

    Parameters
    ----------
    model : TruthModel
    parameters : ndarray, shape (b, 28) or (b, 14)
    raw : ndarray, shape (b, n, 6) or (b, n, 3)
        Readings of the model's sensors, magnetometer first.
    """
    rows = truth_rows(model, parameters)
    residual = raw - rows.modelled
    weight = rows.weight
    white, jacobian = residual * weight, rows.jacobian * weight[:, None]
    across = _rig_factor(rows) @ np.swapaxes(rows.rig * weight[:, None], 2, 3)
    units, count, equations = raw.shape
    seen = (across @ jacobian).reshape(units, 3 * count, -1)
    known = (across @ white[..., None]).reshape(units, 3 * count, 1)
    flat = jacobian.reshape(units, equations * count, -1)
    white = white.reshape(units, equations * count, 1)
    turned, hidden = np.swapaxes(flat, 1, 2), np.swapaxes(seen, 1, 2)
    return NormalEquations(
        normal=turned @ flat - hidden @ seen,
        slope=(turned @ white - hidden @ known)[..., 0],
        chi2=(white**2).sum(axis=(1, 2)) - (known**2).sum(axis=(1, 2)),
        residual=residual,
    )


def truth_information(model: TruthModel, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what each pose adds to the normal matrix, shape (b, n, p, p)."""
    rows = truth_rows(model, parameters)
    jacobian = rows.jacobian * rows.weight[:, None]
    across = _rig_factor(rows) @ np.swapaxes(rows.rig * rows.weight[:, None], 2, 3)
    seen = across @ jacobian
    return np.asarray(np.swapaxes(jacobian, 2, 3) @ jacobian - np.swapaxes(seen, 2, 3) @ seen)


def truth_rows(model: TruthModel, parameters: NDArray[np.float64]) -> TruthRows:
    """Return the model's readings and their derivatives at parameters, shape (b, p)."""
    units, count = len(parameters), len(model.poses.body_from_rig)
    equations = 3 * len(model.sensors)
    jacobian = np.zeros((units, count, equations, parameters.shape[1]))
    modelled = np.empty((units, count, equations))
    rig = np.empty((units, count, equations, 3))
    back = _rig_from_ned(model, parameters)
    for place, sensor in enumerate(model.sensors):
        rows = slice(3 * place, 3 * place + 3)
        at = 14 * place
        across = np.swapaxes(gain_of(parameters, place), 1, 2)
        vector, changes = _direction(model, parameters, sensor, back)
        vectors = _turned(model, vector)
        for axis in range(3):
            jacobian[:, :, 3 * place + axis, at + 3 * axis : at + 3 * axis + 3] = vectors
            jacobian[:, :, 3 * place + axis, at + 9 + axis] = 1.0
        for column, change in changes:
            jacobian[:, :, rows, column] = _turned(model, change) @ across
        modelled[..., rows] = vectors @ across + parameters[:, None, at + 9 : at + 12]
        turns = np.cross(vectors[:, :, None, :], model.poses.axes_body)
        rig[:, :, rows] = np.swapaxes(turns @ across[:, None], 2, 3) * model.rig_sd_rad
    return TruthRows(modelled=modelled, jacobian=jacobian, rig=rig, weight=model.weight)


def gain_of(parameters: NDArray[np.float64], place: int) -> NDArray[np.float64]:
    """Return W, shape (b, 3, 3), of the sensor at a place in the model's order."""
    return parameters[:, 14 * place : 14 * place + 9].reshape(-1, 3, 3)


def _rig_factor(rows: TruthRows) -> NDArray[np.float64]:
    """Return F, shape (b, n, 3, 3), with F^T F = (1 + P^T D^-1 P)^-1."""
    white = rows.rig * rows.weight[:, None]
    inner = np.eye(3) + np.swapaxes(white, 2, 3) @ white
    return np.asarray(np.linalg.inv(np.linalg.cholesky(inner)))


def _rig_from_ned(model: TruthModel, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turn by which the base is out of level, shape (b, 3, 3), by Rodrigues' formula."""
    units = len(parameters)
    if Triad.ACCELEROMETER not in model.sensors:
        return np.broadcast_to(np.eye(3), (units, 3, 3))
    north, east = parameters[:, -2], parameters[:, -1]
    angle = np.hypot(north, east)
    cross = np.zeros((units, 3, 3))
    cross[:, 0, 2], cross[:, 2, 0] = east, -east
    cross[:, 1, 2], cross[:, 2, 1] = -north, north
    first = np.sinc(angle / np.pi)[:, None, None]
    second = 0.5 * np.sinc(angle / (2.0 * np.pi))[:, None, None] ** 2
    return np.asarray(np.eye(3) - first * cross + second * (cross @ cross))


def _direction(
    model: TruthModel, parameters: NDArray[np.float64], sensor: Triad, back: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[tuple[int, NDArray[np.float64]]]]:
    """Return a sensor's vector in the rig's frame, (b, 3), and its changes by column."""
    changes: list[tuple[int, NDArray[np.float64]]] = []
    if sensor is Triad.ACCELEROMETER:
        vector = -back @ DOWN
    else:
        azimuth, dip = parameters[:, 12], parameters[:, 13]
        sa, ca, sd, cd = np.sin(azimuth), np.cos(azimuth), np.sin(dip), np.cos(dip)
        stacked = np.empty((len(parameters), 3, 3))
        stacked[:, 0] = np.stack([cd * ca, -cd * sa, -sd * ca], axis=1)
        stacked[:, 1] = np.stack([cd * sa, cd * ca, -sd * sa], axis=1)
        stacked[:, 2] = np.stack([sd, 0.0 * sd, cd], axis=1)
        rig = model.strength * (back @ stacked)
        vector, changes = rig[..., 0], [(12, rig[..., 1]), (13, rig[..., 2])]
    if Triad.ACCELEROMETER in model.sensors:
        base = parameters.shape[1] - 2
        changes += [(base + axis, np.cross(vector, np.eye(3)[axis])) for axis in (0, 1)]
    return vector, changes


def _turned(model: TruthModel, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rig's vectors (b, 3) in the body at every pose, shape (b, n, 3)."""
    turns = model.poses.body_from_rig
    return np.asarray((vectors @ turns.reshape(-1, 3).T).reshape(-1, len(turns), 3))
