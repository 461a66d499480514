"""Magnetometer and accelerometer without the rig's angles, many units at once.

Maximum likelihood of 13 parameters: the matrix's nine elements (which now also turn the
magnetometer into the accelerometer's axes), the offset, and the field's dip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.consistency import correlation, drift, growth, largest_chi2
from bench.calibration.fit import Cause
from bench.calibration.grid_error import correction_rows, grid_axes, grid_field, predicted_deg
from bench.calibration.least_squares import Inverse, Minimum, inverted
from bench.calibration.saturation import saturated
from bench.calibration.sphere_fits import (
    SphereFits,
    joined,
    neutral_where_refused,
    require_vectors,
)
from bench.calibration.tilt_readings import (
    SMALLEST_FORCE_G,
    UNKNOWNS,
    Readings,
    drift_rows,
    readings_of,
    tilt_minimum,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

SMALLEST: Final = 8
BLOCK: Final = 256
"""Units at a time, so that their derivatives stay in the processor's cache."""
SMALLEST_TILT: Final = 0.02
"""RMS of the force's second and third direction, about 1 deg, below which the poses are level
or of one tilt, or turn about one axis only."""
LEVEL_RANK: Final = 8
SMALLEST_MIRROR: Final = 100.0
"""Sum of squares, in standard deviations, by which the poses must contradict the mirror image."""
LARGEST_AXIS_RATIO: Final = 5.0
LARGEST_RESIDUAL: Final = 0.03
"""Part of the field that residuals may be."""
NOTED_RESIDUAL: Final = 0.005
LARGEST_CHI2: Final = 100.0
"""chi2_reduced beyond which residuals of NOTED_RESIDUAL are no noise: ten times what is assumed."""
LARGEST_PREDICTED_DEG: Final = 3.0
LARGEST_DIP_DIFFERENCE_DEG: Final = 20.0
"""Difference from the station's dip beyond which a sensor is mirrored, not the site disturbed."""
LARGEST_SINE: Final = 0.9998
"""Sine of 88.9 deg: nearer to a pole there is no horizontal field."""
LARGEST_DRIFT_DEG: Final = 1.0
"""Heading error RMS that a drift over the run may leave."""
CAUSES: Final[tuple[Cause | None, ...]] = (
    None,
    Cause.TOO_FEW,
    Cause.NO_TURN,
    Cause.NO_ACCELERATION,
    Cause.TILT_TOO_SMALL,
    Cause.SATURATED,
    Cause.NOT_OBSERVABLE,
    Cause.DEGENERATE,
    Cause.RESIDUAL_TOO_LARGE,
    Cause.NOT_CONVERGED,
    Cause.FIELD_DISTURBED,
)
"""Causes by the code that the kernel returns; code 0 is no cause: accepted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TiltAidedFits(SphereFits):
    """Sphere fits with the dip, their covariance of `tilt_aided.PARAMETERS` (13).

    Where residuals are correlated, the covariance is also that of fewer readings; where they
    show a drift of field, dip or offset, it holds what that would change.

    Attributes
    ----------
    dip_deg : ndarray, shape (...)
    correlation : ndarray, shape (...)
        Of each pose's residuals with the next pose's; 0 where noise alone explains it.
    drift_deg : ndarray, shape (...)
        RMS change of the heading if field, dip and offset are let drift; 0 if they do not.
    mirror : ndarray, shape (...)
        By how much, as a sum of squares in standard deviations, the mirror image fits worse; 0
        where the poses tilt about one axis only.
    """

    dip_deg: NDArray[np.float64]
    correlation: NDArray[np.float64]
    drift_deg: NDArray[np.float64]
    mirror: NDArray[np.float64]


def tilt_aided_batch(
    field_mg: ArrayLike,
    accel_g: ArrayLike,
    field_sd_mg: float,
    accel_sd_g: float,
    *,
    station_field_mg: ArrayLike | None = None,
    raw_force: bool = False,
    noise_known: bool = True,
) -> TiltAidedFits:
    """Fit matrix, offset and dip of many units.

    Parameters
    ----------
    field_mg, accel_g : array-like, shape (..., n, 3)
        Raw readings of the magnetometer; specific force as it is, raw or corrected. n is the
        same for all units.
    field_sd_mg, accel_sd_g : float
        Standard deviations of one reading, each axis.
    station_field_mg : array-like, shape (3,), optional
        Its strength is the sphere's radius; without it that of a matrix of determinant one. A
        dip far from the station's is refused: a mirrored sensor, or a force of the wrong sign,
        fits as well with matrix and dip negated, 180 deg off.
    raw_force : bool
        Whether the force may be off by a bias and by gains. What they explain is then no drift;
        what they cost is not in the covariance (`tilt_force.force_cost`).
    noise_known : bool
        Whether the standard deviations are more than a guess: a unit whose residuals they cannot
        explain (`consistency.largest_chi2`) is then refused with RESIDUAL_TOO_LARGE. Which poses
        are to blame, `fit_tilt_aided` names.

    Returns
    -------
    TiltAidedFits

    Raises
    ------
    ValueError
        If the shapes are others or differ, or a value is not finite.
    """
    readings = require_vectors("field_mg", field_mg)
    force = require_vectors("accel_g", accel_g)
    if force.shape != readings.shape:
        message = f"accel_g must have the shape {readings.shape}; instead received {force.shape}"
        raise ValueError(message)
    station = None if station_field_mg is None else np.asarray(station_field_mg, dtype=float)
    units = readings.reshape(-1, *readings.shape[-2:])
    forces = force.reshape(units.shape)
    blocks = [
        _fitted(
            units[first : first + BLOCK],
            forces[first : first + BLOCK],
            (field_sd_mg, accel_sd_g),
            station,
            raw_force=raw_force,
            noise_known=noise_known,
        )
        for first in range(0, len(units), BLOCK)
    ]
    return joined(blocks, readings.shape[:-2])


def _fitted(
    field_mg: NDArray[np.float64],
    accel_g: NDArray[np.float64],
    noise: tuple[float, float],
    station_mg: NDArray[np.float64] | None,
    *,
    raw_force: bool,
    noise_known: bool,
) -> TiltAidedFits:
    readings = readings_of(field_mg, accel_g, *noise)
    best = tilt_minimum(readings)
    found = inverted(best.normal)
    matrix = best.parameters[:, :9].reshape(-1, 3, 3)
    gains = np.linalg.svd(matrix, compute_uv=False)
    proper = (np.linalg.det(matrix) > 0.0) & (gains[:, 0] <= LARGEST_AXIS_RATIO * gains[:, 2])
    proper &= np.isfinite(best.chi2)
    given = {"raw_force": raw_force, "noise_known": noise_known}
    fits = _in_mg(readings, best, found, proper, station_mg, **given)
    count = field_mg.shape[1]
    spread = _spread(readings.down)
    forceless = np.linalg.norm(accel_g, axis=-1).min(axis=-1) < SMALLEST_FORCE_G
    too_large = _too_large(fits)
    if noise_known:
        too_large |= _unexplained(readings, best, raw_force=raw_force)
    conditions = {
        Cause.TOO_FEW: np.full(len(field_mg), count < SMALLEST),
        Cause.NO_TURN: readings.cloud.still,
        Cause.NO_ACCELERATION: forceless,
        Cause.TILT_TOO_SMALL: spread[:, 1] < SMALLEST_TILT,
        Cause.SATURATED: saturated(field_mg).any(axis=-1),
        Cause.NOT_OBSERVABLE: fits.mirror < SMALLEST_MIRROR,
        Cause.DEGENERATE: ~readings.cloud.usable
        | (best.converged & (~proper | _other_dip(fits, station_mg))),
        Cause.RESIDUAL_TOO_LARGE: proper & too_large,
        Cause.NOT_CONVERGED: ~best.converged,
        Cause.FIELD_DISTURBED: fits.drift_deg > LARGEST_DRIFT_DEG,
    }
    codes = [np.int8(CAUSES.index(cause)) for cause in conditions]
    cause = np.select(list(conditions.values()), codes, np.int8(0))
    weak = (found.rank < UNKNOWNS) | ~(fits.predicted_rms_deg <= LARGEST_PREDICTED_DEG)
    weak |= np.abs(best.parameters[:, 12]) > LARGEST_SINE
    cause = np.where((cause == 0) & weak, CAUSES.index(Cause.NOT_OBSERVABLE), cause)
    rank = np.where(spread[:, 1] < SMALLEST_TILT, np.minimum(found.rank, LEVEL_RANK), found.rank)
    return neutral_where_refused(fits, cause.astype(np.int8), rank)


def _too_large(fits: TiltAidedFits) -> NDArray[np.bool_]:
    """Return whether the residuals are too large a part of the field, shape (b,)."""
    relative = fits.residual_rms_mg / fits.field_mg
    noted = (relative > NOTED_RESIDUAL) & (fits.chi2_reduced > LARGEST_CHI2)
    return np.asarray((relative > LARGEST_RESIDUAL) | noted)


def _unexplained(readings: Readings, best: Minimum, *, raw_force: bool) -> NDArray[np.bool_]:
    """Return whether the noise does not explain the residuals, shape (b,).

    What a raw force may be off explains them too: its coefficients are let free here.
    """
    dof = 2 * readings.down.shape[1] - UNKNOWNS
    if not raw_force:
        return np.asarray(best.chi2 / max(dof, 1) > largest_chi2(dof))
    residual, jacobian = readings.rows(best.parameters, np.arange(len(best.chi2)))
    loose = readings.force_columns(best.parameters)
    turned = np.swapaxes(np.concatenate([jacobian, loose], axis=-1), 1, 2)
    found = inverted(turned @ np.swapaxes(turned, 1, 2))
    slope = turned @ residual[..., None]
    drop = (np.swapaxes(slope, 1, 2) @ found.covariance @ slope)[:, 0, 0]
    dofs = residual.shape[1] - found.rank
    limits = np.array([largest_chi2(int(one)) for one in dofs])
    return np.asarray((best.chi2 - drop) / np.maximum(dofs, 1) > limits)


def _other_dip(fits: TiltAidedFits, station_mg: NDArray[np.float64] | None) -> NDArray[np.bool_]:
    if station_mg is None:
        return np.zeros(fits.dip_deg.shape, dtype=bool)
    station_deg = np.rad2deg(np.arctan2(station_mg[2], np.hypot(*station_mg[:2])))
    return np.asarray(np.abs(fits.dip_deg - station_deg) > LARGEST_DIP_DIFFERENCE_DEG)


def _spread(down: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the RMS extents, shape (b, 3), of the directions from the largest to the smallest."""
    values = np.linalg.eigvalsh(np.swapaxes(down, 1, 2) @ down / down.shape[1])
    return np.asarray(np.sqrt(np.maximum(values[:, ::-1], 0.0)))


def _mirror(readings: Readings, best: Minimum) -> NDArray[np.float64]:
    """Return by how much the half turn about the forces' common normal fits worse, shape (b,).

    Forces in one plane of normal m do not tell w from its half turn 2 m (m.w) - w with the dip
    negated. Off the plane the vertical field then differs by 2 (g.m)(m.w).
    """
    down, points = readings.down, readings.cloud.points
    extents, normals = np.linalg.eigh(np.swapaxes(down, 1, 2) @ down / down.shape[1])
    normal = normals[:, :, :1]
    matrix = best.parameters[:, :9].reshape(-1, 3, 3)
    inside = (points - best.parameters[:, None, 9:12]) @ np.swapaxes(matrix, 1, 2)
    differs = 2.0 * (down @ normal)[..., 0] * (inside @ normal)[..., 0]
    gain = np.linalg.norm(matrix, axis=(1, 2)) / np.sqrt(3.0)
    variance = (readings.sd * gain) ** 2 + readings.down_sd**2
    dof = max(2 * points.shape[1] - UNKNOWNS, 1)
    variance = variance * np.maximum(best.chi2 / dof, 1.0)
    flat = extents[:, 0] < SMALLEST_TILT**2
    return np.where(flat, 0.0, (differs**2).sum(axis=1) / np.maximum(variance, 1e-300))


def _in_mg(
    readings: Readings,
    best: Minimum,
    found: Inverse,
    proper: NDArray[np.bool_],
    station_mg: NDArray[np.float64] | None,
    *,
    raw_force: bool,
    noise_known: bool,
) -> TiltAidedFits:
    cloud, parameters = readings.cloud, best.parameters
    unit = np.where(proper[:, None, None], parameters[:, :9].reshape(-1, 3, 3), np.eye(3))
    sine = np.clip(parameters[:, 12], -LARGEST_SINE, LARGEST_SINE)
    strength = cloud.scale_mg / np.linalg.det(unit) ** (1.0 / 3.0)
    if station_mg is not None:
        strength = np.full(len(unit), float(np.linalg.norm(station_mg)))
    factor = strength / cloud.scale_mg
    chi2 = best.chi2 / max(2 * cloud.points.shape[1] - UNKNOWNS, 1)
    dip_rad = np.arcsin(sine)
    scales = [factor, cloud.scale_mg, np.rad2deg(1.0 / np.cos(dip_rad))]
    to_units = np.repeat(np.stack(scales, axis=1), [9, 3, 1], axis=1)
    told = noise_known and not raw_force
    noise = growth(chi2, 2 * cloud.points.shape[1] - UNKNOWNS) if told else np.maximum(chi2, 1.0)
    covariance, shift, together, rms = _uncertainty(
        readings, best, found, noise, to_units, raw_force=raw_force
    )
    matrix = unit * factor[:, None, None]
    rows = correction_rows(*grid_field(grid_axes(), strength, sine), matrix)
    rms_deg, max_deg = predicted_deg(rows, covariance[:, :12, :12])
    drift_deg = np.sqrt(((rows @ shift[:, :12, None]) ** 2).mean(axis=(1, 2)))
    return TiltAidedFits(
        offset_mg=cloud.centre_mg + cloud.scale_mg[:, None] * parameters[:, 9:12],
        matrix=matrix,
        field_mg=strength,
        covariance=covariance,
        residual_rms_mg=rms * readings.sd * cloud.scale_mg,
        chi2_reduced=chi2,
        condition=found.condition,
        rank=found.rank,
        predicted_rms_deg=rms_deg,
        predicted_max_deg=max_deg,
        cause=np.zeros(len(unit), dtype=np.int8),
        dip_deg=np.rad2deg(dip_rad),
        correlation=together,
        drift_deg=drift_deg,
        mirror=_mirror(readings, best),
    )


def _uncertainty(
    readings: Readings,
    best: Minimum,
    found: Inverse,
    noise: NDArray[np.float64],
    to_units: NDArray[np.float64],
    *,
    raw_force: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return covariance and shift by a drift (b, 13) in the fit's units, correlation, RMS of r1."""
    residual, jacobian = readings.rows(best.parameters, np.arange(len(noise)))
    by_pose = residual.reshape(len(noise), 2, -1)
    together = correlation(by_pose)
    by_drift = drift_rows(best.parameters, jacobian)
    spread = found.covariance
    if raw_force:
        loose = readings.force_columns(best.parameters)
        jacobian = np.concatenate([jacobian, loose], axis=-1)
        spread = inverted(np.swapaxes(jacobian, 1, 2) @ jacobian).covariance
    shift = drift(residual, jacobian, spread, by_drift).shift[:, :UNKNOWNS] * to_units
    noise = noise * (1.0 + together) / (1.0 - together)
    covariance = found.covariance * to_units[:, :, None] * to_units[:, None, :]
    covariance = covariance * noise[:, None, None] + shift[:, :, None] * shift[:, None, :]
    return covariance, shift, together, np.sqrt((by_pose[:, 0] ** 2).mean(axis=1))
