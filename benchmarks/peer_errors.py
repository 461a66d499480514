"""Heading error that coefficients leave, and what the product's estimators give on readings.

The magnetometer alone cannot see the rotation of what it corrects. Where an estimator has no
more than that, the rotation nearest to M W, of its own unit, is taken out before the heading is
computed, as a mounting that is known would do; a mirror image is no rotation and stays.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from estimators import (
    ACCEL_SD_G,
    RIG_SD_DEG,
    Readings,
    Unit,
    station_mg,
    truth_aided,
)

from bench.calibration.ellipsoid_batch import ellipsoid_batch, ellipsoid_coefficients
from bench.calibration.tilt import ned_from_body, tilt_compensated_heading_deg
from bench.calibration.tilt_aided_batch import tilt_aided_batch
from bench.calibration.truth_aided_linear import truth_aided_linear
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

HEADINGS_DEG: Final = np.arange(0.0, 360.0, 10.0)
TILTS_DEG: Final = ((0.0, 0.0), (30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -30.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What one estimator did on a set of readings, trial by trial.

    Attributes
    ----------
    rms_deg : ndarray, shape (k,)
        Heading error over the grid; NaN where there are no coefficients.
    refused : ndarray of bool, shape (k,)
        A cause, or an exception.
    seconds : float
        Processor time of one unit.
    """

    rms_deg: NDArray[np.float64]
    refused: NDArray[np.bool_]
    seconds: float

    @property
    def nothing(self) -> NDArray[np.bool_]:
        """Trials without refusal whose coefficients are no numbers."""
        return np.isnan(self.rms_deg) & ~self.refused

    def error_deg(self) -> float:
        """Return the RMS over all trials that have coefficients; NaN where none has."""
        known = self.rms_deg[~np.isnan(self.rms_deg)]
        return float(np.sqrt((known**2).mean())) if len(known) else float("nan")


@cache
def grid_deg() -> NDArray[np.float64]:
    """Return 36 headings level and at +-30 deg of pitch and of roll, shape (180, 3)."""
    return np.array([(heading, *tilt) for tilt in TILTS_DEG for heading in HEADINGS_DEG])


def heading_rms_deg(
    field_mg: NDArray[np.float64], force_g: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the RMS over the grid, shape (k,), of corrected field and force (k, 180, 3)."""
    heading_deg = tilt_compensated_heading_deg(field_mg, force_g)
    error_deg = wrap_180_deg(heading_deg - grid_deg()[:, 0])
    return np.asarray(np.sqrt((error_deg**2).mean(axis=-1)))


def corrected_on_grid(
    unit: Unit,
    matrix: NDArray[np.float64],
    offset_mg: NDArray[np.float64],
    *,
    rotation_removed: bool,
) -> NDArray[np.float64]:
    """Return the unit's readings without noise over the grid, corrected, shape (k, 180, 3)."""
    raw_mg = _on_grid()[0] @ unit.gain.T + unit.offset_mg
    corrected = (raw_mg - offset_mg[:, None, :]) @ np.swapaxes(matrix, 1, 2)
    if rotation_removed:
        corrected = corrected @ nearest_rotation(matrix @ unit.gain)
    return np.asarray(corrected)


def nearest_rotation(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation, without mirror, nearest to each matrix, shape (..., 3, 3)."""
    left, _, right = np.linalg.svd(matrix)
    left[..., :, 2] *= np.sign(np.linalg.det(left @ right))[..., None]
    return np.asarray(left @ right)


def peer_outcome(unit: Unit, found: dict[str, NDArray[Any]], name: str) -> Outcome:
    """Return the outcome of what a peer's process wrote for a set of readings."""
    matrix, offset_mg = found[f"{name}_matrix"], found[f"{name}_offset_mg"]
    finite = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(offset_mg).all(axis=1)
    corrected = corrected_on_grid(unit, matrix[finite], offset_mg[finite], rotation_removed=True)
    rms_deg = np.full(len(matrix), np.nan)
    rms_deg[finite] = heading_rms_deg(corrected, _on_grid()[1])
    seconds = float(found[f"{name}_seconds"].min()) / len(matrix)
    return Outcome(rms_deg=rms_deg, refused=found[f"{name}_raised"], seconds=seconds)


def ellipsoid_outcome(unit: Unit, readings: Readings, sd_mg: float) -> Outcome:
    """Return what the product's ellipsoid leaves, its rotation removed as that of the peers."""
    return _field_outcome(unit, lambda: ellipsoid(readings, sd_mg), rotation_removed=True)


def coefficients_outcome(unit: Unit, readings: Readings, sd_mg: float) -> Outcome:
    """Return what the ellipsoid's coefficients leave where nothing but them is asked for."""
    return _field_outcome(unit, lambda: coefficients(readings, sd_mg), rotation_removed=True)


def tilt_aided_outcome(unit: Unit, readings: Readings, sd_mg: float) -> Outcome:
    """Return what the product's tilt_aided leaves, rotation and all."""
    return _field_outcome(unit, lambda: tilt_aided(readings, sd_mg), rotation_removed=False)


def _field_outcome(unit: Unit, fit: Callable[[], Any], *, rotation_removed: bool) -> Outcome:
    """Return what offset and matrix leave on perfect forces."""
    fits, seconds = _timed(fit)
    corrected = corrected_on_grid(
        unit, fits.matrix, fits.offset_mg, rotation_removed=rotation_removed
    )
    return _outcome(corrected, _on_grid()[1], fits.cause, seconds)


def truth_aided_outcome(unit: Unit, readings: Readings, sd_mg: float) -> Outcome:
    """Return what the product's truth_aided leaves, with its own accelerometer coefficients."""
    fits, seconds = _timed(lambda: truth_aided(readings, sd_mg))
    matrix = np.linalg.inv(fits.gain)
    corrected = corrected_on_grid(unit, matrix, fits.offset_mg, rotation_removed=False)
    raw_g = _on_grid()[1] @ unit.accel_gain.T + unit.accel_offset_g
    back = np.swapaxes(np.linalg.inv(fits.accel_gain), 1, 2)
    force_g = (raw_g - fits.accel_offset_g[:, None, :]) @ back
    return _outcome(corrected, force_g, fits.cause, seconds)


def truth_linear_outcome(unit: Unit, readings: Readings, sd_mg: float) -> Outcome:
    """Return what the product's truth_aided_linear leaves, rotation and all."""
    fits, seconds = _timed(lambda: truth_linear(readings, sd_mg))
    corrected = corrected_on_grid(unit, fits.matrix, fits.offset_mg, rotation_removed=False)
    return _outcome(corrected, _on_grid()[1], fits.cause, seconds)


def ellipsoid(readings: Readings, sd_mg: float) -> Any:
    """Fit S1."""
    return ellipsoid_batch(readings.field_mg, sd_mg, station_field_mg=station_mg())


def coefficients(readings: Readings, sd_mg: float) -> Any:
    """Fit S1, coefficients and refusals alone."""
    return ellipsoid_coefficients(readings.field_mg, sd_mg, station_field_mg=station_mg())


def tilt_aided(readings: Readings, sd_mg: float) -> Any:
    """Fit S2."""
    force_g = readings.accel_g
    return tilt_aided_batch(
        readings.field_mg, force_g, sd_mg, ACCEL_SD_G, station_field_mg=station_mg()
    )


def truth_linear(readings: Readings, sd_mg: float) -> Any:
    """Fit T in a known field on common poses: the magnetometer alone."""
    return truth_aided_linear(
        readings.attitudes_deg,
        readings.field_mg,
        field_sd_mg=sd_mg,
        rig_sd_deg=RIG_SD_DEG,
        station_field_mg=station_mg(),
    )


@cache
def _on_grid() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    axes = ned_from_body(*grid_deg().T)
    return np.einsum("nji,j->ni", axes, station_mg()), -axes[:, 2]


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    start_s = time.process_time()
    fits = work()
    return fits, (time.process_time() - start_s) / len(fits.cause)


def _outcome(
    corrected_mg: NDArray[np.float64],
    force_g: NDArray[np.float64],
    cause: NDArray[np.int8],
    seconds: float,
) -> Outcome:
    refused = cause != 0
    rms_deg = np.where(refused, np.nan, heading_rms_deg(corrected_mg, force_g))
    return Outcome(rms_deg=rms_deg, refused=refused, seconds=seconds)
