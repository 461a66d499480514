"""Disturbed poses of the ellipsoid: found, named and left out, never only weighted down."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.disturbed import Disturbance, disturbed_poses
from bench.calibration.ellipsoid_specific import ellipsoid_specific
from bench.calibration.sphere_minimum import sphere_minimum, sphere_rows_of
from bench.calibration.taubin import normalised, taubin_batch

if TYPE_CHECKING:
    from numpy.typing import NDArray


def off_the_ellipsoid(
    field_mg: NDArray[np.float64], field_sd_mg: float, kept: NDArray[np.bool_]
) -> tuple[Disturbance, ...] | None:
    """Return the poses, of all, that contradict the rest under the ellipsoid of the kept ones.

    None where these have none.

    Disturbed poses can turn the best quadric into a hyperboloid: the search then starts from the
    ellipsoid-specific fit.

    Parameters
    ----------
    field_mg : ndarray, shape (n, 3)
    field_sd_mg : float
    kept : ndarray of bool, shape (n,)
    """
    cloud = normalised(field_mg[None, kept])
    starts = taubin_batch(cloud.points)
    if not starts.found[0]:
        starts = ellipsoid_specific(cloud.points)
    sd = field_sd_mg / cloud.scale_mg
    best = sphere_minimum(cloud.points, starts, sd)
    if not np.isfinite(best.chi2[0]):
        return None
    every = (field_mg[None] - cloud.centre_mg) / cloud.scale_mg
    residual, jacobian = sphere_rows_of(every, sd)(best.parameters, np.array([0]))
    return disturbed_poses(residual[0][:, None], jacobian[0][:, None])
