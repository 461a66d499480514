"""Poses of the experiments, and what is read in their readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.fit import CalibrationData
from bench.pose import Attitude
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike, NDArray

    from bench.reproduction.setup import Setup


def turn(
    count: int, pitch_deg: float = 0.0, roll_deg: float = 0.0, *, start_deg: float = 0.0
) -> list[Attitude]:
    """Return a turn of evenly spaced headings at one tilt."""
    return [
        Attitude(azimuth_deg=float(azimuth_deg), pitch_deg=pitch_deg, roll_deg=roll_deg)
        for azimuth_deg in start_deg + np.arange(count) * (360.0 / count)
    ]


def headings(azimuths_deg: Iterable[float]) -> list[Attitude]:
    """Return level poses."""
    return [Attitude(azimuth_deg=float(azimuth_deg)) for azimuth_deg in azimuths_deg]


def error_deg(found_deg: ArrayLike, readings: NDArray[np.void]) -> NDArray[np.float64]:
    """Return heading less rig azimuth in (-180, 180], shape (n,)."""
    return wrap_180_deg(np.asarray(found_deg, dtype=float) - readings["rig_azimuth_deg"])


def largest(errors: ArrayLike) -> float:
    """Return the largest magnitude."""
    return float(np.abs(np.asarray(errors, dtype=float)).max())


def rms(errors: ArrayLike) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt((np.asarray(errors, dtype=float) ** 2).mean()))


def calibration_data(readings: NDArray[np.void], setup: Setup) -> CalibrationData:
    """Return what the calibration methods take, with the site's field as the station's."""
    dip_rad = np.deg2rad(setup.dip_deg)
    return CalibrationData(
        field_mg=readings["field_mg"],
        accel_g=readings["accel_g"],
        azimuth_deg=readings["rig_azimuth_deg"],
        pitch_deg=readings["rig_pitch_deg"],
        roll_deg=readings["rig_roll_deg"],
        offset_mg=readings["offset_mg"],
        station_field_mg=setup.horizontal_mg * np.array([1.0, 0.0, float(np.tan(dip_rad))]),
    )
