"""The magnetometer's coefficients of very many units on common poses: one matrix product.

In a known field raw = W v + b is linear, and the best linear estimate is the same matrix for all
units that stood on the same poses, weighted as for a perfect unit. The weights of a unit with
soft iron of 10 % differ from that by as much, which costs less than 1 % of accuracy: an
error of a weight counts only in second order. For a study or a whole batch of a production; what
is written to a unit comes from `truth_aided`, which estimates the field's direction too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import Cause
from bench.calibration.least_squares import inverted
from bench.calibration.sphere_fits import require_vectors
from bench.calibration.truth_model import LARGEST_AXIS_RATIO, LARGEST_RESIDUAL, common_poses
from bench.calibration.truth_rows import TruthModel, truth_rows

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bench.calibration.truth_model import RigPoses

UNKNOWNS: Final = 12
BLOCK: Final = 1024
CAUSES: Final[tuple[Cause | None, ...]] = (
    None,
    Cause.NOT_OBSERVABLE,
    Cause.DEGENERATE,
    Cause.RESIDUAL_TOO_LARGE,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearFits:
    """Coefficients of many units; the leading axes (...) are units.

    Attributes
    ----------
    matrix, offset_mg : ndarray, shape (..., 3, 3) and (..., 3)
        corrected = matrix @ (raw - offset_mg); 1 and 0 where refused.
    residual_rms_mg : ndarray, shape (...)
    covariance : ndarray, shape (12, 12)
        Of W row by row and b of raw = W v + b, the same for all units: the weights' own.
    cause : ndarray of int8, shape (...)
        Index into CAUSES; 0 is accepted.
    """

    matrix: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    residual_rms_mg: NDArray[np.float64]
    covariance: NDArray[np.float64]
    cause: NDArray[np.int8]


def truth_aided_linear(
    attitudes_deg: ArrayLike,
    field_mg: ArrayLike,
    *,
    field_sd_mg: float,
    rig_sd_deg: float,
    station_field_mg: ArrayLike,
) -> LinearFits:
    """Fit gain, misalignment and offset of many units on common poses in a known field.

    Parameters
    ----------
    attitudes_deg : array-like, shape (n, 3)
        Azimuth, pitch and roll of the rig, the same for all units.
    field_mg : array-like, shape (..., n, 3)
    field_sd_mg, rig_sd_deg : float
        Standard deviations of a reading, each axis, and of each rig angle.
    station_field_mg : array-like, shape (3,)
        Field in the rig's frame, taken as exact.

    Raises
    ------
    ValueError
        If shapes do not match or a value is not finite.
    """
    readings = require_vectors("field_mg", field_mg)
    poses = common_poses(attitudes_deg, readings)
    estimator, design, covariance, rank = _estimator(
        poses, np.asarray(station_field_mg, dtype=float), field_sd_mg, rig_sd_deg
    )
    raw = readings.reshape(-1, design.shape[0])
    found = np.empty((len(raw), UNKNOWNS))
    residual_mg = np.empty(len(raw))
    for first in range(0, len(raw), BLOCK):
        rows = slice(first, first + BLOCK)
        found[rows] = raw[rows] @ estimator
        off = raw[rows] - found[rows] @ design.T
        residual_mg[rows] = np.sqrt(np.einsum("bm,bm->b", off, off) / design.shape[0])
    shape = readings.shape[:-2]
    strength_mg = float(np.linalg.norm(station_field_mg))
    matrix, cause = _judged(found[:, :9].reshape(-1, 3, 3), residual_mg, strength_mg, rank)
    offset_mg = np.where(cause[:, None] == 0, found[:, 9:], 0.0)
    return LinearFits(
        matrix=matrix.reshape((*shape, 3, 3)),
        offset_mg=offset_mg.reshape((*shape, 3)),
        residual_rms_mg=residual_mg.reshape(shape),
        covariance=covariance,
        cause=cause.reshape(shape),
    )


def _estimator(
    poses: RigPoses,
    station_mg: NDArray[np.float64],
    field_sd_mg: float,
    rig_sd_deg: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], int]:
    """Return the estimator (3 n, 12), the design (3 n, 12), the covariance and the rank."""
    model = TruthModel(
        poses=poses,
        strength=float(np.linalg.norm(station_mg)),
        field_sd=field_sd_mg,
        accel_sd=None,
        rig_sd_rad=float(np.deg2rad(rig_sd_deg)),
    )
    dip_rad = np.arctan2(station_mg[2], np.hypot(station_mg[0], station_mg[1]))
    direction = [np.arctan2(station_mg[1], station_mg[0]), dip_rad]
    perfect = np.concatenate([np.eye(3).ravel(), np.zeros(3), direction])
    rows = truth_rows(model, perfect[None])
    rig = rows.rig[0]
    noise = np.linalg.inv(rig @ np.swapaxes(rig, 1, 2) + field_sd_mg**2 * np.eye(3))
    design = rows.jacobian[0, :, :, :UNKNOWNS]
    weighted = (noise @ design).reshape(-1, UNKNOWNS)
    design = design.reshape(-1, UNKNOWNS)
    found = inverted(design.T @ weighted)
    return weighted @ found.covariance, design, found.covariance, int(found.rank)


def _judged(
    gain: NDArray[np.float64], residual_mg: NDArray[np.float64], strength_mg: float, rank: int
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Return the inverse of the gains by cofactors, 1 where refused, and the causes."""
    x, y, z = gain[:, 0], gain[:, 1], gain[:, 2]
    cofactors = np.stack([_cross(y, z), _cross(z, x), _cross(x, y)], axis=2)
    determinant = (x * cofactors[:, :, 0]).sum(axis=1)
    largest = np.sqrt(np.einsum("bij,bij->b", gain, gain))
    flat = ~(np.abs(determinant) * LARGEST_AXIS_RATIO**2 > (largest / np.sqrt(3.0)) ** 3)
    moved = residual_mg > LARGEST_RESIDUAL * strength_mg
    unseen = np.full(len(gain), rank < UNKNOWNS)
    cause = np.select([unseen, flat, moved], [np.int8(1), np.int8(2), np.int8(3)], np.int8(0))
    safe = np.where(cause == 0, determinant, 1.0)
    matrix = cofactors / safe[:, None, None]
    matrix[cause != 0] = np.eye(3)
    return matrix, np.asarray(cause, dtype=np.int8)


def _cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    turned = one[:, [1, 2, 0]] * other[:, [2, 0, 1]]
    turned -= one[:, [2, 0, 1]] * other[:, [1, 2, 0]]
    return turned
