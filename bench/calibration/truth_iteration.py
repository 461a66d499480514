"""Gauss-Newton of the rig's model for many units on the same poses, without a loop over units.

The model and the weights are those of `bench.calibration.truth_solver`: raw = W v + b at known
angles, generalised least squares with the rig's uncertainty carried through the sensors. A unit
that cannot be fitted goes on with the readings of a perfect one, so that nothing needs exceptions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.prediction import DOWN
from bench.calibration.truth_model import LARGEST_AXIS_RATIO, RigPoses
from bench.calibration.truth_rows import (
    NormalEquations,
    Triad,
    TruthModel,
    gain_of,
    truth_normal,
    truth_rows,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

ITERATIONS: Final = 12
SETTLED: Final = 1e-4
"""Squared length of the last step, in standard deviations, of a unit that converged."""
RIDGE: Final = 1e-13
LARGEST: Final = 1e7
"""No sensor reads more, in mG or g."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Settled:
    """Parameters (b, p) of units, the normal equations there, and how they came about.

    `degenerate`: the readings do not span three axes, or are beyond any sensor's range; these
    and `unfit` units hold the perfect unit's parameters.
    """

    parameters: NDArray[np.float64]
    here: NormalEquations
    converged: NDArray[np.bool_]
    degenerate: NDArray[np.bool_]


def model_of(
    poses: RigPoses,
    station_field_mg: NDArray[np.float64],
    *,
    field_sd_mg: float | None,
    accel_sd_g: float | None,
    rig_sd_deg: float,
) -> TruthModel:
    """Return the model of sensors in a station's field; a sensor's sd is None without it."""
    return TruthModel(
        poses=poses,
        strength=float(np.linalg.norm(station_field_mg)),
        field_sd=field_sd_mg,
        accel_sd=accel_sd_g,
        rig_sd_rad=float(np.deg2rad(rig_sd_deg)),
    )


def perfect_unit(model: TruthModel, station_mg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the parameters, shape (p,), of a perfect unit in the station's field, level base."""
    north, east, down = station_mg
    direction = [np.arctan2(east, north), np.arctan2(down, np.hypot(north, east))]
    angles = {Triad.MAGNETOMETER: direction, Triad.ACCELEROMETER: [0.0, 0.0]}
    parts = [[*np.eye(3).ravel(), 0.0, 0.0, 0.0, *angles[sensor]] for sensor in model.sensors]
    return np.concatenate(parts)


def settled_units(
    model: TruthModel,
    raw: NDArray[np.float64],
    station_mg: NDArray[np.float64],
    *,
    unfit: bool = False,
    smallest_step: float = SETTLED,
) -> Settled:
    """Return the generalised least squares solution of units from their linear fits.

    Parameters
    ----------
    model : TruthModel
    raw : ndarray, shape (b, n, e)
        Readings of the model's sensors.
    station_mg : ndarray, shape (3,)
        Field in the rig's frame, where the iteration starts.
    unfit : bool
        Whether the poses serve no unit.
    smallest_step : float
        Squared length, in standard deviations, of every unit's step at which to stop.
    """
    neutral = perfect_unit(model, station_mg)
    beyond = np.abs(raw).max(axis=(1, 2)) > LARGEST
    start = linear_start(model, np.where(beyond[:, None, None], 0.0, raw), station_mg)
    degenerate = beyond | ~_regular(model, start)
    out = degenerate | unfit
    start = np.where(out[:, None], neutral, start)
    perfect = truth_rows(model, neutral[None]).modelled
    raw = np.where(out[:, None, None], perfect, raw)
    parameters, here, converged = _iterated(model, raw, start, neutral, smallest_step)
    return Settled(parameters=parameters, here=here, converged=converged, degenerate=degenerate)


def linear_start(
    model: TruthModel, raw: NDArray[np.float64], station_mg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the parameters of unweighted linear fits at the station's field, level base."""
    directions = {Triad.MAGNETOMETER: station_mg, Triad.ACCELEROMETER: -DOWN}
    start = np.tile(perfect_unit(model, station_mg), (len(raw), 1))
    for place, sensor in enumerate(model.sensors):
        vectors = model.poses.turned(directions[sensor])
        inverse = np.linalg.pinv(np.column_stack([vectors, np.ones(len(vectors))]))
        found = inverse @ raw[:, :, 3 * place : 3 * place + 3]
        at = 14 * place
        start[:, at : at + 9] = np.swapaxes(found[:, :3], 1, 2).reshape(-1, 9)
        start[:, at + 9 : at + 12] = found[:, 3]
    return start


def _iterated(
    model: TruthModel,
    raw: NDArray[np.float64],
    start: NDArray[np.float64],
    neutral: NDArray[np.float64],
    smallest_step: float,
) -> tuple[NDArray[np.float64], NormalEquations, NDArray[np.bool_]]:
    """Return parameters, normal equations there, and which units settled.

    A unit that runs away goes on from the neutral parameters with the readings that they give.
    """
    parameters = start
    settled = lost = np.zeros(len(raw), dtype=bool)
    here = truth_normal(model, parameters, raw)
    for _ in range(ITERATIONS):
        scale = np.sqrt(np.maximum(np.diagonal(here.normal, axis1=1, axis2=2), 1e-300))
        scaled = here.normal / (scale[:, :, None] * scale[:, None, :])
        scaled = scaled + RIDGE * np.eye(parameters.shape[1])
        step = np.linalg.solve(scaled, (here.slope / scale)[..., None])[..., 0]
        size = np.einsum("bp,bp->b", step, here.slope / scale)
        parameters = parameters + step / scale
        away = ~(np.abs(parameters).max(axis=1) < LARGEST) | ~_regular(model, parameters)
        lost = lost | away
        parameters = np.where(away[:, None], neutral, parameters)
        if away.any():
            raw = np.where(away[:, None, None], truth_rows(model, parameters).modelled, raw)
        here = truth_normal(model, parameters, raw)
        settled = (size < SETTLED) & ~away
        if (size < smallest_step).all():
            break
    return parameters, here, settled & ~lost


def _regular(model: TruthModel, parameters: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which units' gains, of each sensor, are finite and span three axes."""
    regular = np.asarray(np.isfinite(parameters).all(axis=1))
    safe = np.where(regular[:, None], parameters, 0.0)
    for place in range(len(model.sensors)):
        gains = np.linalg.svd(gain_of(safe, place), compute_uv=False)
        regular &= gains[:, 2] * LARGEST_AXIS_RATIO > gains[:, 0]
    return np.asarray(regular)
