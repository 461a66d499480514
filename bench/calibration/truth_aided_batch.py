"""Both sensors' coefficients of many units on the same planned poses, without a loop over units.

The model and the weights are those of `bench.calibration.truth_solver`: raw = W v + b at known
angles, generalised least squares with the rig's uncertainty carried through both sensors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import Cause
from bench.calibration.grid_error import grid_axes, grid_field, grid_force, predicted_deg
from bench.calibration.least_squares import Inverse, inverted
from bench.calibration.saturation import saturated
from bench.calibration.sphere_fits import joined, require_vectors
from bench.calibration.truth_model import (
    LARGEST_AXIS_RATIO,
    LARGEST_PREDICTED_DEG,
    LARGEST_RESIDUAL,
    common_poses,
    observed,
)
from bench.calibration.truth_rows import NormalEquations, TruthModel, truth_normal, truth_rows

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

ITERATIONS: Final = 12
SETTLED: Final = 1e-4
"""Squared length of the last step in standard deviations."""
BLOCK: Final = 64
SMALLEST: Final = 6
RIDGE: Final = 1e-13
LARGEST_MG: Final = 1e7
DOWN: Final = np.array([0.0, 0.0, 1.0])
CAUSES: Final[tuple[Cause | None, ...]] = (
    None,
    Cause.TOO_FEW,
    Cause.NOT_OBSERVABLE,
    Cause.SATURATED,
    Cause.DEGENERATE,
    Cause.NOT_CONVERGED,
    Cause.RESIDUAL_TOO_LARGE,
)
"""Causes by the code that the kernel returns; code 0 is no cause: accepted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TruthAidedFits:
    """Coefficients of many units; the leading axes (...) are units.

    Attributes
    ----------
    gain, offset_mg : ndarray, shape (..., 3, 3) and (..., 3)
        W and b of raw = W v + b; 1 and 0 where refused.
    accel_gain, accel_offset_g : ndarray, shape (..., 3, 3) and (..., 3)
        The accelerometer's; 1 and 0 without one.
    field_azimuth_deg, dip_deg : ndarray, shape (...)
    base_level_north_deg, base_level_east_deg : ndarray, shape (...)
        0 without an accelerometer.
    covariance : ndarray, shape (..., 28, 28), or (..., 14, 14) without an accelerometer
        In the order of `truth_aided`'s parameters; the weights' own times chi2_reduced where
        that exceeds 1.
    residual_rms_mg, chi2_reduced, condition : ndarray, shape (...)
    predicted_rms_deg, predicted_max_deg : ndarray, shape (...)
    cause : ndarray of int8, shape (...)
        Index into CAUSES; 0 is accepted.
    """

    gain: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    accel_gain: NDArray[np.float64]
    accel_offset_g: NDArray[np.float64]
    field_azimuth_deg: NDArray[np.float64]
    dip_deg: NDArray[np.float64]
    base_level_north_deg: NDArray[np.float64]
    base_level_east_deg: NDArray[np.float64]
    covariance: NDArray[np.float64]
    residual_rms_mg: NDArray[np.float64]
    chi2_reduced: NDArray[np.float64]
    condition: NDArray[np.float64]
    predicted_rms_deg: NDArray[np.float64]
    predicted_max_deg: NDArray[np.float64]
    cause: NDArray[np.int8]


def truth_aided_batch(
    attitudes_deg: ArrayLike,
    field_mg: ArrayLike,
    accel_g: ArrayLike | None,
    *,
    field_sd_mg: float,
    accel_sd_g: float,
    rig_sd_deg: float,
    station_field_mg: ArrayLike,
) -> TruthAidedFits:
    """Fit both sensors, field direction and base level of many units on common poses.

    Parameters
    ----------
    attitudes_deg : array-like, shape (n, 3)
        Azimuth, pitch and roll of the rig, the same for all units.
    field_mg, accel_g : array-like, shape (..., n, 3)
        Raw readings; without `accel_g` only the magnetometer is fitted, on a level base.
    field_sd_mg, accel_sd_g, rig_sd_deg : float
        Standard deviations of a reading, each axis, and of each rig angle.
    station_field_mg : array-like, shape (3,)
        Field in the rig's frame: its strength, and the start of its direction.

    Raises
    ------
    ValueError
        If shapes do not match or a value is not finite.
    """
    readings = require_vectors("field_mg", field_mg)
    poses = common_poses(attitudes_deg, readings)
    raw = readings
    if accel_g is not None:
        raw = np.concatenate([readings, require_vectors("accel_g", accel_g)], axis=-1)
    station = np.asarray(station_field_mg, dtype=float)
    model = TruthModel(
        poses=poses,
        strength=float(np.linalg.norm(station)),
        field_sd=field_sd_mg,
        accel_sd=None if accel_g is None else accel_sd_g,
        rig_sd_rad=float(np.deg2rad(rig_sd_deg)),
    )
    units = raw.reshape(-1, *raw.shape[-2:])
    starts = range(0, len(units), BLOCK)
    blocks = [_fitted(model, units[first : first + BLOCK], station) for first in starts]
    return joined(blocks, readings.shape[:-2])


def linear_start(
    model: TruthModel, raw: NDArray[np.float64], station_mg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the parameters of unweighted linear fits at the station's field, level base."""
    directions = [station_mg, -DOWN][: model.sensors]
    parts = []
    for sensor, direction in enumerate(directions):
        vectors = model.poses.turned(direction)
        regressors = np.column_stack([vectors, np.ones(len(vectors))])
        inverse = np.linalg.pinv(regressors)
        found = inverse @ raw[:, :, 3 * sensor : 3 * sensor + 3]
        parts += [np.swapaxes(found[:, :3], 1, 2).reshape(-1, 9), found[:, 3]]
        angles = np.zeros((len(raw), 2))
        if sensor == 0:
            angles[:, 0] = np.arctan2(station_mg[1], station_mg[0])
            angles[:, 1] = np.arctan2(station_mg[2], np.hypot(station_mg[0], station_mg[1]))
        parts.append(angles)
    return np.concatenate(parts, axis=1)


def _solved(
    model: TruthModel,
    raw: NDArray[np.float64],
    start: NDArray[np.float64],
    neutral: NDArray[np.float64],
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
        away = ~(np.abs(parameters).max(axis=1) < LARGEST_MG) | ~_regular(model, parameters)
        lost = lost | away
        parameters = np.where(away[:, None], neutral, parameters)
        if away.any():
            raw = np.where(away[:, None, None], truth_rows(model, parameters).modelled, raw)
        here = truth_normal(model, parameters, raw)
        settled = (size < SETTLED) & ~away
        if settled.all():
            break
    return parameters, here, settled & ~lost


def _neutral(model: TruthModel, station_mg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the parameters, shape (p,), of a perfect unit in the station's field."""
    north, east, down = station_mg
    parts = [np.eye(3).ravel(), np.zeros(3)]
    parts.append(np.array([np.arctan2(east, north), np.arctan2(down, np.hypot(north, east))]))
    if model.sensors == 2:
        parts += [np.eye(3).ravel(), np.zeros(5)]
    return np.concatenate(parts)


def _regular(model: TruthModel, parameters: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which units' gains, of each sensor, are finite and span three axes."""
    regular = np.asarray(np.isfinite(parameters).all(axis=1))
    safe = np.where(regular[:, None], parameters, 0.0)
    for sensor in range(model.sensors):
        gains = np.linalg.svd(_gain(safe, sensor), compute_uv=False)
        regular &= gains[:, 2] * LARGEST_AXIS_RATIO > gains[:, 0]
    return np.asarray(regular)


def _fitted(
    model: TruthModel, raw: NDArray[np.float64], station_mg: NDArray[np.float64]
) -> TruthAidedFits:
    neutral = _neutral(model, station_mg)
    seen = observed(model.poses.turned(station_mg))[0]
    seen += observed(model.poses.turned(DOWN))[0] if model.sensors == 2 else 12
    few, blind = raw.shape[1] < SMALLEST, seen < 24
    beyond = np.abs(raw).max(axis=(1, 2)) > LARGEST_MG
    start = linear_start(model, np.where(beyond[:, None, None], 0.0, raw), station_mg)
    degenerate = beyond | ~_regular(model, start)
    unfit = degenerate | few | blind
    start = np.where(unfit[:, None], neutral, start)
    perfect = truth_rows(model, neutral[None]).modelled
    parameters, here, settled = _solved(
        model, np.where(unfit[:, None, None], perfect, raw), start, neutral
    )
    found = inverted(here.normal)
    fits = _in_mg(model, parameters, here, found)
    conditions = {
        Cause.TOO_FEW: np.full(len(raw), few),
        Cause.NOT_OBSERVABLE: (found.rank < start.shape[1]) | blind,
        Cause.SATURATED: saturated(raw[..., :3]).any(axis=-1),
        Cause.DEGENERATE: degenerate,
        Cause.NOT_CONVERGED: ~settled,
        Cause.RESIDUAL_TOO_LARGE: fits.residual_rms_mg > LARGEST_RESIDUAL * model.strength,
    }
    codes = [np.int8(CAUSES.index(cause)) for cause in conditions]
    cause = np.select(list(conditions.values()), codes, np.int8(0))
    weak = ~(fits.predicted_rms_deg <= LARGEST_PREDICTED_DEG)
    cause = np.where((cause == 0) & weak, CAUSES.index(Cause.NOT_OBSERVABLE), cause)
    return _neutral_where_refused(fits, cause.astype(np.int8))


def _gain(parameters: NDArray[np.float64], sensor: int) -> NDArray[np.float64]:
    return parameters[:, 14 * sensor : 14 * sensor + 9].reshape(-1, 3, 3)


def heading_rows(model: TruthModel, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heading's derivative, (b, k, p), over the verification grid by all parameters."""
    axes = grid_axes()
    sine = np.sin(parameters[:, 13])
    field, gradient = grid_field(axes, np.full(len(sine), model.strength), sine)
    rows = np.zeros((len(sine), len(axes), parameters.shape[1]))
    rows[..., :12] = _by_sensor(field, gradient, _gain(parameters, 0))
    if model.sensors == 2:
        force, gradient = grid_force(axes, sine)
        rows[..., 14:26] = _by_sensor(force, gradient, _gain(parameters, 1))
    return rows


def _by_sensor(
    vectors: NDArray[np.float64], gradient: NDArray[np.float64], gain: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return derivatives (b, k, 12) by W row by row and b of raw = W v + b with raw held."""
    back = -gradient @ np.linalg.inv(gain)
    by_gain = back[..., :, None] * vectors[..., None, :]
    return np.concatenate([by_gain.reshape(*by_gain.shape[:-2], 9), back], axis=-1)


def _in_mg(
    model: TruthModel,
    parameters: NDArray[np.float64],
    here: NormalEquations,
    found: Inverse,
) -> TruthAidedFits:
    units, count, equations = here.residual.shape
    unknowns = parameters.shape[1]
    dof = max(equations * count - unknowns, 1)
    chi2 = here.chi2 / dof
    covariance = found.covariance * np.maximum(chi2, 1.0)[:, None, None]
    rms_deg, max_deg = predicted_deg(heading_rows(model, parameters), covariance)
    to_deg = np.ones(unknowns)
    to_deg[[12, 13, 26, 27][: 2 * model.sensors]] = np.rad2deg(1.0)
    both = model.sensors == 2
    level = parameters[:, 26:28] if both else np.zeros((units, 2))
    return TruthAidedFits(
        gain=_gain(parameters, 0),
        offset_mg=parameters[:, 9:12],
        accel_gain=_gain(parameters, 1) if both else np.tile(np.eye(3), (units, 1, 1)),
        accel_offset_g=parameters[:, 23:26] if both else np.zeros((units, 3)),
        field_azimuth_deg=np.rad2deg(parameters[:, 12]),
        dip_deg=np.rad2deg(parameters[:, 13]),
        base_level_north_deg=np.rad2deg(level[:, 0]),
        base_level_east_deg=np.rad2deg(level[:, 1]),
        covariance=covariance * to_deg[:, None] * to_deg,
        residual_rms_mg=np.sqrt((here.residual[..., :3] ** 2).mean(axis=(1, 2))),
        chi2_reduced=chi2,
        condition=found.condition,
        predicted_rms_deg=rms_deg,
        predicted_max_deg=max_deg,
        cause=np.zeros(units, dtype=np.int8),
    )


def _neutral_where_refused(fits: TruthAidedFits, cause: NDArray[np.int8]) -> TruthAidedFits:
    refused = cause != 0
    one, wide = refused[:, None], refused[:, None, None]
    return replace(
        fits,
        gain=np.where(wide, np.eye(3), fits.gain),
        offset_mg=np.where(one, 0.0, fits.offset_mg),
        accel_gain=np.where(wide, np.eye(3), fits.accel_gain),
        accel_offset_g=np.where(one, 0.0, fits.accel_offset_g),
        covariance=np.where(wide, 0.0, fits.covariance),
        predicted_rms_deg=np.where(refused, 0.0, fits.predicted_rms_deg),
        predicted_max_deg=np.where(refused, 0.0, fits.predicted_max_deg),
        cause=cause,
    )
