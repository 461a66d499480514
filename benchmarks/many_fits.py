"""The truth-aided calibration of many units on common poses, as a run makes it of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.acceptance.site import field_rig_mg
from bench.calibration.cross_axis import cross_axis_of
from bench.calibration.crossed_field import without_cross_axis
from bench.calibration.fit import (
    POSE_ACCEL_SD_G,
    POSE_FIELD_SD_MG,
    POSE_RIG_SD_DEG,
    CalibrationData,
    Fit,
)
from bench.calibration.tilt import tilt_compensated_heading_deg
from bench.calibration.truth_aided_batch import CAUSES, TruthAidedFits, truth_aided_batch
from bench.station import load_station

if TYPE_CHECKING:
    from many_units import Readings
    from numpy.typing import NDArray

STATION: Final = load_station("default")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibrated:
    """Coefficients of many units; `hk_mg`, (units, 3), took the cross-axis term out before."""

    fits: TruthAidedFits
    hk_mg: NDArray[np.float64]

    def heading_deg(
        self, field_mg: NDArray[np.float64], force_g: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the headings that the units make of raw readings, (units, n, 3) each."""
        fits = self.fits
        back = np.linalg.inv(fits.gain).swapaxes(1, 2)
        accel_back = np.linalg.inv(fits.accel_gain).swapaxes(1, 2)
        bridge_mg = without_crossed(field_mg, self.hk_mg)
        heading_deg = tilt_compensated_heading_deg(
            (bridge_mg - fits.offset_mg[:, None]) @ back,
            (force_g - fits.accel_offset_g[:, None]) @ accel_back,
        )
        return np.asarray(heading_deg)

    def fit_of(self, unit: int) -> Fit:
        """Return one unit's coefficients as the bench holds them."""
        fits, cause = self.fits, CAUSES[int(self.fits.cause[unit])]
        if cause is not None:
            return Fit(method="truth_aided", cause=cause)
        return Fit(
            method="truth_aided",
            offset_mg=fits.offset_mg[unit],
            matrix=np.linalg.inv(fits.gain[unit]),
            accel_offset_g=fits.accel_offset_g[unit],
            accel_matrix=np.linalg.inv(fits.accel_gain[unit]),
            hk_mg=self.hk_mg[unit],
        )


def calibrated(shown_deg: NDArray[np.float64], readings: Readings, count: int) -> Calibrated:
    """Fit the first poses of readings.

    Parameters
    ----------
    shown_deg : ndarray, shape (n, 3)
        Azimuth, pitch and roll that the rig shows at the poses.
    readings : Readings
    count : int
        Poses to fit.
    """
    data = [data_of(shown_deg, readings, unit, count) for unit in range(len(readings.field_mg))]
    hk_mg = np.array([cross_axis_of(one).hk_mg for one in data])
    fits = truth_aided_batch(
        shown_deg[:count],
        without_crossed(readings.field_mg[:, :count], hk_mg),
        readings.force_g[:, :count],
        field_sd_mg=POSE_FIELD_SD_MG,
        accel_sd_g=POSE_ACCEL_SD_G,
        rig_sd_deg=POSE_RIG_SD_DEG,
        station_field_mg=field_rig_mg(STATION),
    )
    return Calibrated(fits=fits, hk_mg=hk_mg)


def data_of(
    shown_deg: NDArray[np.float64], readings: Readings, unit: int, count: int
) -> CalibrationData:
    """Return what a run's fits would take of one unit's first poses."""
    azimuth_deg, pitch_deg, roll_deg = shown_deg[:count].T
    return CalibrationData(
        field_mg=readings.field_mg[unit, :count],
        accel_g=readings.force_g[unit, :count],
        azimuth_deg=azimuth_deg,
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
        field_sd_mg=POSE_FIELD_SD_MG,
        accel_sd_g=POSE_ACCEL_SD_G,
        rig_sd_deg=POSE_RIG_SD_DEG,
        noise_known=True,
        offset_mg=readings.offset_mg[unit, :count],
        station_field_mg=field_rig_mg(STATION),
    )


def without_crossed(
    field_mg: NDArray[np.float64], hk_mg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return readings, (units, n, 3), without each unit's own cross-axis term."""
    rows = zip(field_mg, hk_mg, strict=True)
    return np.array([without_cross_axis(one, hk) for one, hk in rows])
