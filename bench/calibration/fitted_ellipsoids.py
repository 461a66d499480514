"""Ellipsoids of some units from start to minimum, with all by which they are to be judged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.saturation import saturated
from bench.calibration.sphere_minimum import UNKNOWNS, Weighed, weighed_minimum
from bench.calibration.sphere_model import symmetric
from bench.calibration.sphere_prediction import predicted_rms_deg
from bench.calibration.taubin import (
    LARGEST_AXIS_RATIO,
    Normalised,
    TaubinStarts,
    normalised,
    taubin_batch,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bench.calibration.least_squares import Minimum


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedEllipsoids:
    """What some units were found to be, in normalised coordinates, not yet judged.

    Attributes
    ----------
    sd : ndarray, shape (b,)
        Noise.
    best, covariance, full_rank
        As `sphere_minimum.weighed_minimum`.
    matrix : ndarray, shape (b, 3, 3)
        1 where the minimum is no ellipsoid, not `proper`.
    determinant : ndarray, shape (b,)
        Cube root of the matrix's.
    rms_deg : ndarray, shape (b,)
        Predicted heading error.
    held : ndarray of bool, shape (b,)
        Whether an axis is saturated.
    """

    cloud: Normalised
    sd: NDArray[np.float64]
    starts: TaubinStarts
    best: Minimum
    matrix: NDArray[np.float64]
    proper: NDArray[np.bool_]
    determinant: NDArray[np.float64]
    covariance: NDArray[np.float64]
    full_rank: NDArray[np.bool_]
    chi2_reduced: NDArray[np.float64]
    rms_deg: NDArray[np.float64]
    held: NDArray[np.bool_]

    @property
    def told(self) -> NDArray[np.bool_]:
        """Whether the readings determine one ellipsoid and no other."""
        return self.full_rank & self.starts.told_apart

    @property
    def ellipsoid(self) -> NDArray[np.bool_]:
        """Whether start and minimum are ellipsoids."""
        return self.starts.found & (self.proper | ~self.best.converged)


def fitted_ellipsoids(
    field_mg: NDArray[np.float64],
    field_sd_mg: float,
    sine: float,
    minimum: Callable[..., Weighed] = weighed_minimum,
) -> FittedEllipsoids:
    """Fit readings, shape (b, n, 3), and predict the heading error.

    Parameters
    ----------
    field_mg : ndarray, shape (b, n, 3)
    field_sd_mg : float
    sine : float
        Of the dip that the prediction is for.
    minimum : callable
        `weighed_minimum`, or `one_step`.
    """
    cloud = normalised(field_mg)
    sd = field_sd_mg / cloud.scale_mg
    starts = taubin_batch(cloud.points)
    best, covariance, full_rank = minimum(cloud.points, starts, sd)
    matrix = symmetric(best.parameters[:, :6])
    values = np.linalg.eigvalsh(matrix)
    proper = (values[:, 0] > 0.0) & (values[:, 2] <= LARGEST_AXIS_RATIO * values[:, 0])
    if not proper.all():
        values = np.where(proper[:, None], values, 1.0)
        matrix = np.where(proper[:, None, None], matrix, np.eye(3))
    chi2_reduced = best.chi2 / max(field_mg.shape[1] - UNKNOWNS, 1)
    rms_deg = predicted_rms_deg(sine, matrix, covariance)
    rms_deg *= np.sqrt(np.maximum(chi2_reduced, 1.0))
    return FittedEllipsoids(
        cloud=cloud,
        sd=sd,
        starts=starts,
        best=best,
        matrix=matrix,
        proper=proper,
        determinant=np.cbrt(np.multiply.reduce(values, axis=1)),
        covariance=covariance,
        full_rank=full_rank,
        chi2_reduced=chi2_reduced,
        rms_deg=rms_deg,
        held=np.asarray(saturated(field_mg).any(axis=-1)),
    )
