"""Turns of the rig and what the experiments of Caruso's paper read in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import CalibrationData
from bench.calibration.tilt import heading_deg, ned_from_body
from bench.pose import Attitude
from bench.reproduction.result import Published, Reproduction
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike, NDArray

    from bench.reproduction.result import PaperFigure
    from bench.reproduction.setup import Setup

PAPER: Final = "caruso"
HORIZONTAL_MG: Final = 200.0
"""'The magnetic fields in the X and Y horizontal plane will typically be in the 200 mgauss range.'
"""
COUNT_16_MG: Final = 1600.0 / 2.0**16
"""One count of 16 bits over +-800 mG, the converter of all setups that name no other."""


COUNTS: Final = (0.02, "counts of 0.024 mG are 0.007 deg in 200 mG")
"""Tolerance in deg, with its reason, of a heading that has no other error."""
EVERYWHERE_DEG: Final = np.arange(0.0, 361.0, 2.0)
"""Headings of exact curves."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Swing:
    """Heading errors of a swing: rig azimuth and errors, each shape (n,)."""

    azimuth_deg: NDArray[np.float64]
    error_deg: NDArray[np.float64]


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


def exact_error_deg(
    dip_deg: float, attitude_deg: tuple[float, float], assumed_deg: tuple[float, float]
) -> NDArray[np.float64]:
    """Return exact errors at all headings of a module at one tilt that is taken for another.

    Parameters
    ----------
    dip_deg : float
    attitude_deg, assumed_deg : (float, float)
        Pitch and roll, true and as the tilt compensation has them.
    """
    down = float(np.tan(np.deg2rad(dip_deg)))
    body = ned_from_body(EVERYWHERE_DEG, *attitude_deg).transpose(0, 2, 1) @ [1.0, 0.0, down]
    return wrap_180_deg(heading_deg(body, *assumed_deg) - EVERYWHERE_DEG)


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


def claimed_zero(
    where: str,
    quantity: str,
    unit: str,
    ours: float,
    tolerance: tuple[float, str],
    *,
    exact: float | None = None,
    note: str = "",
) -> Published:
    """Return a number that the paper holds to be zero.

    Parameters
    ----------
    tolerance : (float, str)
        Tolerance and its reason.
    exact : float, optional
        What physics gives where it is not zero.
    """
    return Published(
        where=where,
        quantity=quantity,
        unit=unit,
        published=0.0,
        ours=ours,
        tolerance=tolerance[0],
        reason=tolerance[1],
        exact=exact,
        note=note,
    )


def section(
    numbers: list[Published], figures: list[PaperFigure], remarks: list[str]
) -> Reproduction:
    """Return one section of the paper."""
    return Reproduction(paper=PAPER, title="", numbers=numbers, figures=figures, remarks=remarks)
