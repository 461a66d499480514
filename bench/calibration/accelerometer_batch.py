"""Accelerometers of many units on the same planned poses, without a loop over units.

Bias, gain, misalignment and the base's level, by the iteration that the truth-aided fit uses for
both sensors (`bench.calibration.truth_iteration`). `accelerometer` is this kernel on one unit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.consistency import largest_chi2
from bench.calibration.fit import Cause
from bench.calibration.grid_error import grid_axes, grid_force, predicted_deg
from bench.calibration.least_squares import inverted
from bench.calibration.prediction import DEFAULT_FIELD_MG, DOWN
from bench.calibration.sphere_fits import joined, require_vectors
from bench.calibration.truth_aided_batch import coefficient_rows
from bench.calibration.truth_iteration import Settled, model_of, settled_units
from bench.calibration.truth_model import common_poses, observed
from bench.calibration.truth_rows import TruthModel, gain_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

UNKNOWNS: Final = 14
SMALLEST: Final = 5
BLOCK: Final = 128
SMALLEST_STEP: Final = 1e-14
"""Squared length of the last step, so small that a unit's numbers do not depend on its block's."""
LARGEST_RESIDUAL_G: Final = 0.15
CAUSES: Final[tuple[Cause | None, ...]] = (
    None,
    Cause.TOO_FEW,
    Cause.NOT_OBSERVABLE,
    Cause.DEGENERATE,
    Cause.NOT_CONVERGED,
    Cause.RESIDUAL_TOO_LARGE,
)
"""Causes by the code that the kernel returns; code 0 is no cause: accepted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AccelerometerFits:
    """Coefficients of many units; the leading axes (...) are units.

    Attributes
    ----------
    gain, offset_g : ndarray, shape (..., 3, 3) and (..., 3)
        W and b of raw = W force + b; 1 and 0 where refused.
    base_level_north_deg, base_level_east_deg : ndarray, shape (...)
        Rotations of the rig's base about its north and east axes.
    covariance : ndarray, shape (..., 14, 14)
        In the order of `truth_aided.ACCELEROMETER_PARAMETERS`; the weights' own times
        chi2_reduced where that exceeds 1; 0 where refused.
    residual_rms_g, chi2_reduced, condition : ndarray, shape (...)
    rank : ndarray of int, shape (...)
    predicted_rms_deg, predicted_max_deg : ndarray, shape (...)
        The accelerometer's part of the heading error over the verification grid.
    cause : ndarray of int8, shape (...)
        Index into CAUSES; 0 is accepted.
    """

    gain: NDArray[np.float64]
    offset_g: NDArray[np.float64]
    base_level_north_deg: NDArray[np.float64]
    base_level_east_deg: NDArray[np.float64]
    covariance: NDArray[np.float64]
    residual_rms_g: NDArray[np.float64]
    chi2_reduced: NDArray[np.float64]
    condition: NDArray[np.float64]
    rank: NDArray[np.intp]
    predicted_rms_deg: NDArray[np.float64]
    predicted_max_deg: NDArray[np.float64]
    cause: NDArray[np.int8]


def accelerometer_batch(
    attitudes_deg: ArrayLike,
    accel_g: ArrayLike,
    *,
    accel_sd_g: float,
    rig_sd_deg: float,
    station_field_mg: ArrayLike | None = None,
    noise_known: bool = True,
) -> AccelerometerFits:
    """Fit bias, gain and misalignment of many units' accelerometers on common poses.

    Parameters
    ----------
    attitudes_deg : array-like, shape (n, 3)
        Azimuth, pitch and roll of the rig, the same for all units.
    accel_g : array-like, shape (..., n, 3)
        Raw specific force.
    accel_sd_g, rig_sd_deg : float
        Standard deviations of a reading, each axis, and of each rig angle.
    station_field_mg : array-like, shape (3,), optional
        Field whose dip the prediction assumes; 60 deg without.
    noise_known : bool
        Whether the standard deviations are more than a guess: residuals that they cannot explain
        (`consistency.largest_chi2`) are then refused with RESIDUAL_TOO_LARGE.

    Raises
    ------
    ValueError
        If shapes do not match or a value is not finite.
    """
    force = require_vectors("accel_g", accel_g)
    station = DEFAULT_FIELD_MG if station_field_mg is None else station_field_mg
    field_mg = np.asarray(station, dtype=float)
    model = model_of(
        common_poses(attitudes_deg, force),
        field_mg,
        field_sd_mg=None,
        accel_sd_g=accel_sd_g,
        rig_sd_deg=rig_sd_deg,
    )
    units = force.reshape(-1, *force.shape[-2:])
    blocks = [
        _fitted(model, units[first : first + BLOCK], field_mg, noise_known=noise_known)
        for first in range(0, len(units), BLOCK)
    ]
    return joined(blocks, force.shape[:-2])


def _fitted(
    model: TruthModel,
    raw: NDArray[np.float64],
    station_mg: NDArray[np.float64],
    *,
    noise_known: bool,
) -> AccelerometerFits:
    rank, condition = observed(model.poses.turned(DOWN))
    few, blind = raw.shape[1] < SMALLEST, rank < 12
    solution = settled_units(
        model, raw, station_mg, unfit=few or blind, smallest_step=SMALLEST_STEP
    )
    fits = _in_degrees(model, solution, station_mg, rank, condition)
    moved = fits.residual_rms_g > LARGEST_RESIDUAL_G
    if noise_known:
        moved |= fits.chi2_reduced > largest_chi2(raw[0].size - UNKNOWNS)
    conditions = {
        Cause.TOO_FEW: np.full(len(raw), few),
        Cause.NOT_OBSERVABLE: np.full(len(raw), blind),
        Cause.DEGENERATE: solution.degenerate,
        Cause.NOT_CONVERGED: ~solution.converged,
        Cause.RESIDUAL_TOO_LARGE: moved,
    }
    codes = [np.int8(CAUSES.index(cause)) for cause in conditions]
    cause = np.select(list(conditions.values()), codes, np.int8(0)).astype(np.int8)
    refused = cause != 0
    one, wide = refused[:, None], refused[:, None, None]
    return replace(
        fits,
        gain=np.where(wide, np.eye(3), fits.gain),
        offset_g=np.where(one, 0.0, fits.offset_g),
        covariance=np.where(wide, 0.0, fits.covariance),
        predicted_rms_deg=np.where(refused, 0.0, fits.predicted_rms_deg),
        predicted_max_deg=np.where(refused, 0.0, fits.predicted_max_deg),
        cause=cause,
    )


def _in_degrees(
    model: TruthModel,
    solution: Settled,
    station_mg: NDArray[np.float64],
    rank: int,
    condition: float,
) -> AccelerometerFits:
    parameters, here = solution.parameters, solution.here
    chi2 = here.chi2 / max(here.residual[0].size - UNKNOWNS, 1)
    covariance = inverted(here.normal).covariance * np.maximum(chi2, 1.0)[:, None, None]
    sine = np.full(len(chi2), float(station_mg[2]) / model.strength)
    force, gradient_deg = grid_force(grid_axes(), sine)
    rows = coefficient_rows(force, gradient_deg, gain_of(parameters, 0))
    rms_deg, max_deg = predicted_deg(rows, covariance[:, :12, :12])
    to_deg = np.ones(UNKNOWNS)
    to_deg[12:] = np.rad2deg(1.0)
    return AccelerometerFits(
        gain=gain_of(parameters, 0),
        offset_g=parameters[:, 9:12],
        base_level_north_deg=np.rad2deg(parameters[:, 12]),
        base_level_east_deg=np.rad2deg(parameters[:, 13]),
        covariance=covariance * to_deg[:, None] * to_deg,
        residual_rms_g=np.sqrt((here.residual**2).mean(axis=(1, 2))),
        chi2_reduced=chi2,
        condition=np.full(len(chi2), condition),
        rank=np.full(len(chi2), rank, dtype=np.intp),
        predicted_rms_deg=rms_deg,
        predicted_max_deg=max_deg,
        cause=np.zeros(len(chi2), dtype=np.int8),
    )
