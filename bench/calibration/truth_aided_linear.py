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

from bench.calibration.consistency import largest_chi2
from bench.calibration.fit import Cause
from bench.calibration.grid_error import predicted_deg
from bench.calibration.least_squares import inverted
from bench.calibration.saturation import saturated
from bench.calibration.sphere_fits import require_vectors
from bench.calibration.truth_aided_batch import heading_rows
from bench.calibration.truth_iteration import LARGEST, model_of, perfect_unit
from bench.calibration.truth_model import (
    LARGEST_AXIS_RATIO,
    LARGEST_PREDICTED_DEG,
    LARGEST_RESIDUAL,
    SMALLEST,
    common_poses,
)
from bench.calibration.truth_rows import truth_rows

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
    Cause.TOO_FEW,
    Cause.SATURATED,
)
"""Causes by the code that the kernel returns; code 0 is no cause: accepted."""
UNSEEN: Final = np.int8(1)
DEGENERATE: Final = np.int8(2)
MOVED: Final = np.int8(3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearFits:
    """Coefficients of many units; the leading axes (...) are units.

    Attributes
    ----------
    matrix, offset_mg : ndarray, shape (..., 3, 3) and (..., 3)
        corrected = matrix @ (raw - offset_mg); 1 and 0 where refused.
    residual_rms_mg : ndarray, shape (...)
    predicted_rms_deg : ndarray, shape (...)
        Heading error to expect over the verification grid, 0 where refused: a perfect unit's on
        the poses, times the noise found and the RMS of the matrix's gains.
    covariance : ndarray, shape (12, 12)
        Of W row by row and b of raw = W v + b, the same for all units: the weights' own.
    cause : ndarray of int8, shape (...)
        Index into CAUSES; 0 is accepted.
    """

    matrix: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    residual_rms_mg: NDArray[np.float64]
    predicted_rms_deg: NDArray[np.float64]
    covariance: NDArray[np.float64]
    cause: NDArray[np.int8]


def truth_aided_linear(
    attitudes_deg: ArrayLike,
    field_mg: ArrayLike,
    *,
    field_sd_mg: float,
    rig_sd_deg: float,
    station_field_mg: ArrayLike,
    noise_known: bool = True,
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
    noise_known : bool
        Whether the standard deviations are more than a guess: a unit whose residuals they cannot
        explain (`consistency.largest_chi2`) is then refused, as SATURATED where an axis was held
        and else as RESIDUAL_TOO_LARGE. Which poses are to blame, `fit_truth_aided` names.

    Raises
    ------
    ValueError
        If shapes do not match or a value is not finite.
    """
    readings = require_vectors("field_mg", field_mg)
    poses = common_poses(attitudes_deg, readings)
    known = _known(poses, np.asarray(station_field_mg, dtype=float), field_sd_mg, rig_sd_deg)
    raw = readings.reshape(-1, len(known.design))
    with np.errstate(over="ignore", invalid="ignore"):  # what runs over is lost, and refused
        found, square, moved = _estimated(known, raw, noise_known=noise_known)
    lost = ~(np.abs(found).max(axis=1) <= LARGEST) | ~(square <= LARGEST**2)
    found[lost], square[lost] = 0.0, 0.0
    residual_mg = np.sqrt(square / len(known.design))
    moved |= residual_mg > LARGEST_RESIDUAL * float(np.linalg.norm(station_field_mg))
    matrix, cause = _judged(found[:, :9].reshape(-1, 3, 3), moved, known.rank)
    noise = np.sqrt(np.maximum(square / (field_sd_mg**2 * known.dof), 1.0))
    expected_deg = known.predicted_deg * noise * np.sqrt(np.einsum("bij,bij->b", matrix, matrix))
    cause[(cause == 0) & ~(expected_deg <= LARGEST_PREDICTED_DEG)] = UNSEEN
    suspects = np.flatnonzero(cause == MOVED)
    held = saturated(raw.reshape(len(raw), -1, 3)[suspects]).any(axis=-1)
    cause[suspects[held]] = CAUSES.index(Cause.SATURATED)
    cause[lost] = DEGENERATE
    if readings.shape[-2] < SMALLEST:
        cause[:] = CAUSES.index(Cause.TOO_FEW)
    refused, shape = cause != 0, readings.shape[:-2]
    matrix[refused] = np.eye(3)
    return LinearFits(
        matrix=matrix.reshape((*shape, 3, 3)),
        offset_mg=np.where(refused[:, None], 0.0, found[:, 9:]).reshape((*shape, 3)),
        residual_rms_mg=residual_mg.reshape(shape),
        predicted_rms_deg=np.where(refused, 0.0, expected_deg).reshape(shape),
        covariance=known.covariance,
        cause=cause.reshape(shape),
    )


def _estimated(
    known: _Known, raw: NDArray[np.float64], *, noise_known: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return estimates (b, 12), sums of squares of what is left, and if noise explains them not."""
    found = np.empty((len(raw), UNKNOWNS))
    square = np.empty(len(raw))
    moved = np.zeros(len(raw), dtype=bool)
    for first in range(0, len(raw), BLOCK):
        rows = slice(first, first + BLOCK)
        found[rows] = raw[rows] @ known.estimator
        off = raw[rows] - found[rows] @ known.design.T
        square[rows] = np.einsum("bm,bm->b", off, off)
        if noise_known:
            moved[rows] = known.contradicted(off, square[rows])
    return found, square, moved


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Known:
    """What is the same for all units.

    Estimator and design (3 n, 12), the inverse of each pose's noise (n, 3, 3), that of the
    sensor alone, the covariance, the rank, and a perfect unit's heading error over root 3.
    """

    estimator: NDArray[np.float64]
    design: NDArray[np.float64]
    weights: NDArray[np.float64]
    field_sd_mg: float
    covariance: NDArray[np.float64]
    rank: int
    predicted_deg: float

    @property
    def dof(self) -> int:
        """Readings less unknowns, at least 1."""
        return max(len(self.design) - UNKNOWNS, 1)

    def contradicted(
        self, off_mg: NDArray[np.float64], square: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return whether the noise does not explain residuals (b, 3 n) of sums of squares (b,).

        The rig's part of the noise makes it larger than the sensor's alone: only units that are
        beyond that are looked at closely.
        """
        limit = self.dof * largest_chi2(len(self.design) - UNKNOWNS)
        beyond = square > limit * self.field_sd_mg**2
        units = np.flatnonzero(beyond)
        off = off_mg.reshape(len(off_mg), -1, 3)[units]
        chi2 = np.einsum("bni,nij,bnj->b", off, self.weights, off, optimize=True)
        beyond[units] = chi2 > limit
        return np.asarray(beyond)


def _known(
    poses: RigPoses, station_mg: NDArray[np.float64], field_sd_mg: float, rig_sd_deg: float
) -> _Known:
    model = model_of(
        poses, station_mg, field_sd_mg=field_sd_mg, accel_sd_g=None, rig_sd_deg=rig_sd_deg
    )
    perfect = perfect_unit(model, station_mg)[None]
    rows = truth_rows(model, perfect)
    rig = rows.rig[0]
    weights = np.linalg.inv(rig @ np.swapaxes(rig, 1, 2) + field_sd_mg**2 * np.eye(3))
    design = rows.jacobian[0, :, :, :UNKNOWNS]
    weighted = (weights @ design).reshape(-1, UNKNOWNS)
    design = design.reshape(-1, UNKNOWNS)
    found = inverted(design.T @ weighted)
    rows_deg = heading_rows(model, perfect)[:, :, :UNKNOWNS]
    return _Known(
        estimator=weighted @ found.covariance,
        design=design,
        weights=weights,
        field_sd_mg=field_sd_mg,
        covariance=found.covariance,
        rank=int(found.rank),
        predicted_deg=float(predicted_deg(rows_deg, found.covariance[None])[0][0]) / np.sqrt(3.0),
    )


def _judged(
    gain: NDArray[np.float64], moved: NDArray[np.bool_], rank: int
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Return the inverse of the gains by cofactors, where accepted, and the causes."""
    x, y, z = gain[:, 0], gain[:, 1], gain[:, 2]
    cofactors = np.stack([_cross(y, z), _cross(z, x), _cross(x, y)], axis=2)
    determinant = (x * cofactors[:, :, 0]).sum(axis=1)
    largest = np.sqrt(np.einsum("bij,bij->b", gain, gain))
    flat = ~(np.abs(determinant) * LARGEST_AXIS_RATIO**2 > (largest / np.sqrt(3.0)) ** 3)
    unseen = np.full(len(gain), rank < UNKNOWNS)
    cause = np.select([unseen, flat, moved], [UNSEEN, DEGENERATE, MOVED], np.int8(0))
    safe = np.where(cause == 0, determinant, 1.0)
    return cofactors / safe[:, None, None], np.asarray(cause, dtype=np.int8)


def _cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    turned = one[:, [1, 2, 0]] * other[:, [2, 0, 1]]
    turned -= one[:, [2, 0, 1]] * other[:, [1, 2, 0]]
    return turned
