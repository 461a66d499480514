"""The dip of Cho & Park's site: by the pitch of the largest reading, and from its latitude.

The paper holds 48.72 deg for true, found as the pitch at which x reads most. That maximum is
flat: one degree beside it x falls by 0.015 %. And it shows what two axes cannot: how far soft
iron, which turns the vertical field into x or y, spoils a heading from two axes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.geomagnetic import compare_dips, dip_from_latitude_deg, earth_field
from bench.calibration.tilt import heading_deg
from bench.calibration.two_axis import estimated_z_mg
from bench.pose import Attitude
from bench.reproduction.cho_park_table import HORIZONTAL_MG, READING_SD_MG, REPEATS, SITE_DIP_DEG
from bench.reproduction.setup import Setup
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.geomagnetic import DipComparison
    from bench.reproduction.laboratory import Laboratory, OpenLaboratory

SEEK_DEG: Final = np.arange(-68.0, -29.0, 1.0)
ROLL_DEG: Final = 30.0
SEOUL_DEG: Final = 37.5
SEOUL_LONGITUDE_DEG: Final = 127.0
YEAR: Final = 2026.0
"""The paper's year, 2004, lies before the model."""
LIMIT_AZIMUTH_DEG: Final = np.arange(0.0, 360.0, 15.0)


def dips_of_seoul() -> DipComparison:
    """Return (25) for Seoul's latitude and geomagnetic latitude, and the model's dip."""
    return compare_dips(SEOUL_DEG, SEOUL_LONGITUDE_DEG, 0.0, YEAR)


def dips_over_latitude() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return latitudes, (25) and the model's dip along Seoul's meridian, each shape (n,)."""
    latitude_deg = np.arange(-90.0, 91.0, 2.0)
    model_deg = [
        earth_field(float(latitude), SEOUL_LONGITUDE_DEG, 0.0, YEAR).dip_deg
        for latitude in latitude_deg
    ]
    return latitude_deg, dip_from_latitude_deg(latitude_deg), np.array(model_deg)


def pitch_of_largest_x_deg(lab: Laboratory) -> float:
    """Return how far the nose must go down, facing north, for x to read most."""
    poses = [Attitude(azimuth_deg=0.0, pitch_deg=float(pitch)) for pitch in SEEK_DEG]
    largest = int(lab.measure(poses)["field_mg"][:, 0].argmax())
    return float(-SEEK_DEG[largest])


def spread_of_largest_x_deg(seed: int) -> float:
    """Return the standard deviation of that pitch, from repeats with the stated noise."""
    exact_mg = HORIZONTAL_MG / np.cos(np.deg2rad(SITE_DIP_DEG))
    x_mg = exact_mg * np.cos(np.deg2rad(SEEK_DEG + SITE_DIP_DEG))
    noise_mg = np.random.default_rng(seed).normal(0.0, READING_SD_MG, (REPEATS, len(SEEK_DEG)))
    return float(SEEK_DEG[(x_mg + noise_mg).argmax(axis=1)].std())


def soft_iron_limit_deg(open_laboratory: OpenLaboratory, share: float) -> float:
    """Return the largest heading error at a roll of 30 deg that vertical soft iron leaves.

    Parameters
    ----------
    open_laboratory : callable
    share : float
        Part of the vertical field that the iron turns into x. The level turn takes it for a
        constant; tilted, the vertical field of the body is another.
    """
    iron = (1.0, 0.0, share, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    setup = Setup(part="CB-AMR2", horizontal_mg=HORIZONTAL_MG, dip_deg=SITE_DIP_DEG, soft_iron=iron)
    with open_laboratory(setup) as lab:
        level = lab.measure([Attitude(azimuth_deg=float(a)) for a in LIMIT_AZIMUTH_DEG])
        rolled = lab.measure(
            [Attitude(azimuth_deg=float(a), roll_deg=ROLL_DEG) for a in LIMIT_AZIMUTH_DEG]
        )
    offset_mg = level["field_mg"].mean(axis=0) * [1.0, 1.0, 0.0]
    corrected = rolled["field_mg"] - offset_mg
    corrected[:, 2] = estimated_z_mg(
        corrected, 0.0, ROLL_DEG, horizontal_mg=HORIZONTAL_MG, dip_deg=SITE_DIP_DEG
    )
    found_deg = heading_deg(corrected, 0.0, ROLL_DEG)
    return float(np.abs(wrap_180_deg(found_deg - rolled["rig_azimuth_deg"])).max())
