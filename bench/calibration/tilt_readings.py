"""Readings of magnetometer and accelerometer of a block of units, and where they fit best."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.least_squares import Minimum, minimised
from bench.calibration.sphere_model import tilt_rows
from bench.calibration.taubin import Normalised, normalised, taubin_batch
from bench.calibration.tilt_start import ellipsoid_start, sphere_start

if TYPE_CHECKING:
    from numpy.typing import NDArray

UNKNOWNS: Final = 13
SMALLEST_FORCE_G: Final = 0.1
LEAST_NOISE: Final = 2e-5
"""Part of the field below which no noise is assumed: 0.01 mG in 500 mG."""
PATIENCE: Final = 3.0
"""chi2_reduced from which the second start is tried too."""
POSES_OF_A_JUMP: Final = 20
FORCE_UNKNOWNS: Final = 12
FORCE_STEP: Final = 1e-5
"""Change of the force, in g, by which its derivatives are taken."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """Normalised readings and unit vectors down of a block of units, with the noise of both."""

    cloud: Normalised
    down: NDArray[np.float64]
    sd: NDArray[np.float64]
    down_sd: float

    def extended(self, field_mg: NDArray[np.float64], accel_g: NDArray[np.float64]) -> Readings:
        """Return other readings (b, n, 3) of the same units, in this one's normalisation."""
        points = field_mg - self.cloud.centre_mg[:, None, :]
        points = points / self.cloud.scale_mg[:, None, None]
        return replace(self, cloud=replace(self.cloud, points=points), down=_down(accel_g))

    def rows(
        self, parameters: NDArray[np.float64], units: NDArray[np.intp]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return whitened residuals (b, 2 n), all r1 first, and Jacobian (b, 2 n, 13)."""
        residual, jacobian = tilt_rows(
            parameters[:, :9].reshape(-1, 3, 3),
            parameters[:, 9:12],
            parameters[:, 12],
            self.cloud.points[units],
            self.down[units],
            self.sd[units],
            self.down_sd,
        )
        count = 2 * residual.shape[2]
        return residual.reshape(-1, count), jacobian.reshape(-1, count, UNKNOWNS)

    def force_columns(
        self, parameters: NDArray[np.float64], gain: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Return derivatives (b, 2 n, 12) of the residuals by the accelerometer's coefficients.

        They are W row by row and b of raw = W force + b, the same in every pose of a unit.

        Parameters
        ----------
        parameters : ndarray, shape (b, 13)
        gain : ndarray, shape (3, 3), optional
            W with which the force was corrected; 1 where it is raw.
        """
        units = np.arange(len(parameters))
        here = self.rows(parameters, units)[0]
        back = np.eye(3) if gain is None else np.linalg.inv(gain)
        columns = []
        for change in FORCE_STEP * np.eye(FORCE_UNKNOWNS):
            raw_g = -self.down @ change[:9].reshape(3, 3).T + change[9:]
            moved = replace(self, down=_down(-self.down - raw_g @ back.T))
            columns.append((moved.rows(parameters, units)[0] - here) / FORCE_STEP)
        return np.stack(columns, axis=-1)


def readings_of(
    field_mg: NDArray[np.float64],
    accel_g: NDArray[np.float64],
    field_sd_mg: float,
    accel_sd_g: float,
) -> Readings:
    """Return the readings (b, n, 3) of a block normalised, and gravity's direction in them."""
    cloud = normalised(field_mg)
    return Readings(
        cloud=cloud,
        down=_down(accel_g),
        sd=np.maximum(field_sd_mg / cloud.scale_mg, LEAST_NOISE),
        down_sd=accel_sd_g,
    )


def _down(accel_g: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(accel_g, axis=-1, keepdims=True)
    return np.asarray(-accel_g / np.maximum(lengths, SMALLEST_FORCE_G))


def tilt_minimum(readings: Readings) -> Minimum:
    """Return the minimum from the ellipsoid's start, or from the sphere's where that is lower."""
    cloud = readings.cloud
    starts = taubin_batch(cloud.points)
    best = minimised(readings.rows, ellipsoid_start(starts, cloud.points, readings.down))
    dof = max(2 * cloud.points.shape[1] - UNKNOWNS, 1)
    again = np.flatnonzero(~best.converged | ~starts.found | (best.chi2 > PATIENCE * dof))
    if not len(again):
        return best

    def rows(
        parameters: NDArray[np.float64], units: NDArray[np.intp]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return readings.rows(parameters, again[units])

    other = minimised(rows, sphere_start(cloud.points[again], readings.down[again]))
    determinant = np.linalg.det(other.parameters[:, :9].reshape(-1, 3, 3))
    lower = (other.chi2 < best.chi2[again]) & other.converged & (determinant > 0.0)
    kept = again[lower]
    for mine, its in zip(
        (best.parameters, best.normal, best.chi2, best.converged),
        (other.parameters, other.normal, other.chi2, other.converged),
        strict=True,
    ):
        mine[kept] = its[lower]
    return best


def drift_rows(
    parameters: NDArray[np.float64], jacobian: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return derivatives by a drift of offset, field strength and dip, shape (b, 2 n, q).

    A drift at an even rate, q = 5; where there are poses enough also a jump half-way, q = 10.
    """
    time = np.tile(np.linspace(-1.0, 1.0, jacobian.shape[1] // 2), 2)[:, None]
    strength = jacobian[..., :9] @ parameters[:, :9, None]
    rates = np.concatenate([jacobian[..., 9:], strength], axis=-1)
    if jacobian.shape[1] < 2 * POSES_OF_A_JUMP:
        return rates * time
    return np.concatenate([rates * time, rates * np.sign(time)], axis=-1)
