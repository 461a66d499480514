"""Both sensors' coefficients of many units on the same planned poses, without a loop over units.

The solution is that of `bench.calibration.truth_iteration`; here it is judged, unit by unit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.consistency import growth, largest_chi2
from bench.calibration.fit import Cause
from bench.calibration.grid_error import grid_axes, grid_field, grid_force, predicted_deg
from bench.calibration.least_squares import Inverse, inverted
from bench.calibration.prediction import DOWN
from bench.calibration.saturation import saturated
from bench.calibration.sphere_fits import joined, require_vectors
from bench.calibration.truth_iteration import model_of, settled_units
from bench.calibration.truth_model import (
    LARGEST_PREDICTED_DEG,
    LARGEST_RESIDUAL,
    SMALLEST,
    common_poses,
    observed,
)
from bench.calibration.truth_rows import NormalEquations, TruthModel, gain_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

BLOCK: Final = 64
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
        that exceeds 1, and more where known noise does not explain it (`consistency.growth`).
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
    noise_known: bool = True,
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
    noise_known : bool
        Whether the standard deviations are more than a guess: a unit whose residuals they cannot
        explain (`consistency.largest_chi2`) is then refused with RESIDUAL_TOO_LARGE. Which poses
        are to blame, `fit_truth_aided` names.

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
    model = model_of(
        poses,
        station,
        field_sd_mg=field_sd_mg,
        accel_sd_g=None if accel_g is None else accel_sd_g,
        rig_sd_deg=rig_sd_deg,
    )
    units = raw.reshape(-1, *raw.shape[-2:])
    starts = range(0, len(units), BLOCK)
    blocks = [
        _fitted(model, units[first : first + BLOCK], station, noise_known=noise_known)
        for first in starts
    ]
    return joined(blocks, readings.shape[:-2])


def _fitted(
    model: TruthModel,
    raw: NDArray[np.float64],
    station_mg: NDArray[np.float64],
    *,
    noise_known: bool,
) -> TruthAidedFits:
    both = len(model.sensors) == 2
    seen = observed(model.poses.turned(station_mg))[0]
    seen += observed(model.poses.turned(DOWN))[0] if both else 12
    few, blind = raw.shape[1] < SMALLEST, seen < 24
    solution = settled_units(model, raw, station_mg, unfit=few or blind)
    found = inverted(solution.here.normal)
    fits = _in_mg(model, solution.parameters, solution.here, found, noise_known=noise_known)
    unknowns = solution.parameters.shape[1]
    moved = fits.residual_rms_mg > LARGEST_RESIDUAL * model.strength
    if noise_known:
        moved |= fits.chi2_reduced > largest_chi2(raw[0].size - unknowns)
    conditions = {
        Cause.TOO_FEW: np.full(len(raw), few),
        Cause.NOT_OBSERVABLE: (found.rank < unknowns) | blind,
        Cause.SATURATED: saturated(raw[..., :3]).any(axis=-1),
        Cause.DEGENERATE: solution.degenerate,
        Cause.NOT_CONVERGED: ~solution.converged,
        Cause.RESIDUAL_TOO_LARGE: moved,
    }
    codes = [np.int8(CAUSES.index(cause)) for cause in conditions]
    cause = np.select(list(conditions.values()), codes, np.int8(0))
    weak = ~(fits.predicted_rms_deg <= LARGEST_PREDICTED_DEG)
    cause = np.where((cause == 0) & weak, CAUSES.index(Cause.NOT_OBSERVABLE), cause)
    return _neutral_where_refused(fits, cause.astype(np.int8))


def heading_rows(model: TruthModel, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heading's derivative, (b, k, p), over the verification grid by all parameters."""
    axes = grid_axes()
    sine = np.sin(parameters[:, 13])
    field, gradient = grid_field(axes, np.full(len(sine), model.strength), sine)
    rows = np.zeros((len(sine), len(axes), parameters.shape[1]))
    rows[..., :12] = coefficient_rows(field, gradient, gain_of(parameters, 0))
    if len(model.sensors) == 2:
        force, gradient = grid_force(axes, sine)
        rows[..., 14:26] = coefficient_rows(force, gradient, gain_of(parameters, 1))
    return rows


def coefficient_rows(
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
    *,
    noise_known: bool,
) -> TruthAidedFits:
    units, count, equations = here.residual.shape
    unknowns = parameters.shape[1]
    dof = max(equations * count - unknowns, 1)
    chi2 = here.chi2 / dof
    noise = growth(chi2, dof) if noise_known else np.maximum(chi2, 1.0)
    covariance = found.covariance * noise[:, None, None]
    rms_deg, max_deg = predicted_deg(heading_rows(model, parameters), covariance)
    to_deg = np.ones(unknowns)
    to_deg[[12, 13, 26, 27][: 2 * len(model.sensors)]] = np.rad2deg(1.0)
    both = len(model.sensors) == 2
    level = parameters[:, 26:28] if both else np.zeros((units, 2))
    return TruthAidedFits(
        gain=gain_of(parameters, 0),
        offset_mg=parameters[:, 9:12],
        accel_gain=gain_of(parameters, 1) if both else np.tile(np.eye(3), (units, 1, 1)),
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
