"""What the kernels on the sphere return: coefficients of many units, and their joining."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from _typeshed import DataclassInstance
    from numpy.typing import ArrayLike, NDArray


Fits = TypeVar("Fits", bound="SphereFits")
Units = TypeVar("Units", bound="DataclassInstance")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SphereCoefficients:
    """What many units are given: `SphereFits` without what judges them."""

    offset_mg: NDArray[np.float64]
    matrix: NDArray[np.float64]
    field_mg: NDArray[np.float64]
    cause: NDArray[np.int8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SphereFits:
    """Coefficients of many units; the leading axes (...) are units.

    corrected = matrix @ (raw - offset_mg) lies on a sphere of radius `field_mg`. A refused unit
    keeps offset 0, matrix 1 and covariance 0 beside its cause, never a NaN.

    Attributes
    ----------
    offset_mg, matrix : ndarray, shape (..., 3) and (..., 3, 3)
    field_mg : ndarray, shape (...)
    covariance : ndarray, shape (..., p, p)
        Of the method's PARAMETERS; the weights' own times chi2_reduced where that exceeds 1.
    residual_rms_mg, chi2_reduced, condition : ndarray, shape (...)
        RMS distance from the ellipsoid, sum of squares over the degrees of freedom, condition
        of the scaled Jacobian.
    rank : ndarray of int, shape (...)
    predicted_rms_deg, predicted_max_deg : ndarray, shape (...)
        Heading error to expect over the verification grid.
    cause : ndarray of int8, shape (...)
        Index into the method's CAUSES; 0 is accepted.
    """

    offset_mg: NDArray[np.float64]
    matrix: NDArray[np.float64]
    field_mg: NDArray[np.float64]
    covariance: NDArray[np.float64]
    residual_rms_mg: NDArray[np.float64]
    chi2_reduced: NDArray[np.float64]
    condition: NDArray[np.float64]
    rank: NDArray[np.intp]
    predicted_rms_deg: NDArray[np.float64]
    predicted_max_deg: NDArray[np.float64]
    cause: NDArray[np.int8]


def require_vectors(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return values as a finite array of shape (..., n, 3).

    Raises
    ------
    ValueError
        If the shape is another or a value is not finite.
    """
    vectors = np.asarray(values, dtype=float)
    if vectors.ndim < 2 or vectors.shape[-1] != 3 or not vectors.size:
        message = f"{name} must have the shape (..., n, 3); instead received {vectors.shape}"
        raise ValueError(message)
    if not np.isfinite(vectors).all():
        message = f"{name} must be finite; instead received a value that is not"
        raise ValueError(message)
    return vectors


def joined(blocks: Sequence[Units], shape: tuple[int, ...]) -> Units:
    """Return blocks of fits, each with one unit axis, as one with unit axes of a shape."""
    shaped = {}
    for one in fields(blocks[0]):
        parts = [getattr(block, one.name) for block in blocks]
        whole = parts[0] if len(parts) == 1 else np.concatenate(parts)
        shaped[one.name] = whole.reshape((*shape, *whole.shape[1:]))
    return type(blocks[0])(**shaped)


def neutral_where_refused(fits: Fits, cause: NDArray[np.int8], rank: NDArray[np.intp]) -> Fits:
    """Return the fits with cause and rank, and offset 0, matrix 1, covariance 0 where refused."""
    refused = cause != 0

    def finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(np.isfinite(values), values, 0.0)

    return replace(
        fits,
        offset_mg=np.where(refused[:, None], 0.0, fits.offset_mg),
        matrix=np.where(refused[:, None, None], np.eye(3), fits.matrix),
        covariance=np.where(refused[:, None, None], 0.0, fits.covariance),
        residual_rms_mg=finite(fits.residual_rms_mg),
        chi2_reduced=finite(fits.chi2_reduced),
        rank=rank,
        predicted_rms_deg=np.where(refused, 0.0, fits.predicted_rms_deg),
        predicted_max_deg=np.where(refused, 0.0, fits.predicted_max_deg),
        cause=cause,
    )
