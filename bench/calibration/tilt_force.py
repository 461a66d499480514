"""The specific force that the tilt-aided fit leans on, and what its own uncertainty costs.

Where the rig's angles are known the force is corrected by the `accelerometer` fit of the same
readings. Else it is raw, and what an accelerometer out of the box may be off by counts as its
uncertainty. Either way that uncertainty is not noise: it is the same in every pose, leaves no
residual, and is carried through the fit and through the tilt of a later heading together. A
constant bias turns both alike and cancels in part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.accelerometer import METHOD, fit_accelerometer
from bench.calibration.grid_error import correction_rows, grid_axes, grid_field, grid_force
from bench.calibration.least_squares import inverted
from bench.calibration.prediction import COVERAGE_FACTOR, model_jacobian
from bench.calibration.tilt_readings import readings_of, tilt_minimum

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData
    from bench.calibration.tilt_aided_batch import TiltAidedFits

RAW: Final = "raw"
RAW_BIAS_SD_G: Final = 0.03
RAW_GAIN_SD: Final = 0.015
"""Standard deviations of each bias, and of each gain and misalignment, of a raw accelerometer."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Force:
    """Specific force with the coefficients that corrected it; `source` names their method.

    Attributes
    ----------
    accel_g : ndarray, shape (n, 3)
        Corrected as far as it could be.
    gain, offset_g : ndarray, shape (3, 3) and (3,)
        Of raw = gain @ force + offset; 1 and 0 where the force is raw.
    spread : ndarray, shape (12, k)
        Square root of their covariance: gain row by row, then offset.
    """

    accel_g: NDArray[np.float64]
    gain: NDArray[np.float64]
    offset_g: NDArray[np.float64]
    spread: NDArray[np.float64]
    source: str

    @property
    def raw(self) -> bool:
        """Whether nothing corrected it."""
        return self.source == RAW


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceCost:
    """What the force's uncertainty adds to a fit.

    Attributes
    ----------
    covariance : ndarray, shape (13, 13)
        Of the parameters, noise included.
    rms_deg, max_deg : float
        Heading error to expect over the verification grid, noise and tilt included.
    """

    covariance: NDArray[np.float64]
    rms_deg: float
    max_deg: float


def force_of(data: CalibrationData, accel_g: NDArray[np.float64]) -> Force:
    """Return the force corrected by the `accelerometer` fit, or raw where that refuses."""
    fit = fit_accelerometer(data)
    if fit.refused or fit.accel_matrix is None or fit.accel_offset_g is None:
        sd = np.repeat([RAW_GAIN_SD, RAW_BIAS_SD_G], [9, 3])
        return Force(
            accel_g=accel_g, gain=np.eye(3), offset_g=np.zeros(3), spread=np.diag(sd), source=RAW
        )
    assert fit.covariance is not None  # noqa: S101
    values, vectors = np.linalg.eigh(fit.covariance[:12, :12])
    return Force(
        accel_g=fit.corrected_g(accel_g),
        gain=np.asarray(np.linalg.inv(fit.accel_matrix)),
        offset_g=fit.accel_offset_g,
        spread=vectors * np.sqrt(np.maximum(values, 0.0)),
        source=METHOD,
    )


def force_cost(
    data: CalibrationData, kept: NDArray[np.bool_], force: Force, fits: TiltAidedFits
) -> ForceCost:
    """Return covariance and prediction of an accepted fit with the force's uncertainty in them."""
    shift = _shift(data, kept, force, fits)
    strength, sine = fits.field_mg, np.sin(np.deg2rad(fits.dip_deg))
    rows = correction_rows(*grid_field(grid_axes(), strength, sine), fits.matrix)
    force_g, gradient_deg = grid_force(grid_axes(), sine)
    tilt = model_jacobian(gradient_deg, force_g, force.gain)
    together = rows @ shift[:12] + tilt @ force.spread
    noise = ((rows @ fits.covariance[:12, :12]) * rows).sum(axis=1)
    variance = np.maximum(noise, 0.0) + (together**2).sum(axis=1)
    return ForceCost(
        covariance=fits.covariance + shift @ shift.T,
        rms_deg=float(np.sqrt(variance.mean())),
        max_deg=COVERAGE_FACTOR * float(np.sqrt(variance.max())),
    )


def _shift(
    data: CalibrationData, kept: NDArray[np.bool_], force: Force, fits: TiltAidedFits
) -> NDArray[np.float64]:
    """Return by how much each part of the force's uncertainty moves the parameters, (13, k)."""
    here = readings_of(
        data.field_mg[None, kept], force.accel_g[None, kept], data.field_sd_mg, data.accel_sd_g
    )
    best = tilt_minimum(here)
    _, jacobian = here.rows(best.parameters, np.array([0]))
    back = inverted(best.normal).covariance[0] @ jacobian[0].T
    columns = -back @ here.force_columns(best.parameters, force.gain)[0] @ force.spread
    scale_mg = float(here.cloud.scale_mg[0])
    dip_scale = np.rad2deg(1.0 / np.cos(np.deg2rad(float(fits.dip_deg))))
    units = [float(fits.field_mg) / scale_mg, scale_mg, dip_scale]
    return np.asarray(columns * np.repeat(units, [9, 3, 1])[:, None])
