"""Earth's field by the World Magnetic Model 2025, through pygeomag.

It gives declination (true = magnetic + declination, east positive) and gates the station's
record. It never judges a heading: its declination alone has a standard deviation of about 0.3
to 0.4 deg at middle latitudes, and a building's iron is not in it.

References
----------
.. [1] NOAA NCEI and BGS, "The US/UK World Magnetic Model for 2025-2030": error model.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING, Final

import numpy as np

from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

MODEL: Final = "WMM2025"
EPOCH: Final = 2025.0
LAST: Final = 2030.0
MG_PER_NT: Final = 0.01
WEAK_HORIZONTAL_MG: Final = 60.0
"""Horizontal field of the model's caution zone (6000 nT)."""
_COEFFICIENTS: Final = "wmm/WMM_2025.COF"


@dataclass(frozen=True, slots=True, kw_only=True)
class GeomagneticField:
    """Field of the model at one place and date; `_sd` are the model's standard deviations."""

    model: str
    year: float
    declination_deg: float
    declination_sd_deg: float
    dip_deg: float
    dip_sd_deg: float
    horizontal_mg: float
    horizontal_sd_mg: float
    total_mg: float
    total_sd_mg: float
    ned_mg: tuple[float, float, float]

    @property
    def weak(self) -> bool:
        """Whether the horizontal field is too weak for a compass to be trusted."""
        return self.horizontal_mg < WEAK_HORIZONTAL_MG


def decimal_year(day: date) -> float:
    """Return the year with the day as a fraction.

    >>> decimal_year(date(2026, 1, 1)), round(decimal_year(date(2026, 7, 2)), 4)
    (2026.0, 2026.4986)
    """
    first, following = date(day.year, 1, 1), date(day.year + 1, 1, 1)
    return day.year + (day - first).days / (following - first).days


def earth_field(
    latitude_deg: float, longitude_deg: float, altitude_km: float, year: float
) -> GeomagneticField:
    """Return the field of WMM2025 at a geodetic position.

    Parameters
    ----------
    latitude_deg, longitude_deg : float
        Geodetic, north and east positive.
    altitude_km : float
        Above the WGS 84 ellipsoid, -1 to 850.
    year : float
        Decimal year, 2025.0 to 2030.0 (`decimal_year`).

    Raises
    ------
    ValueError
        If position or date is outside the model.

    Examples
    --------
    >>> field = earth_field(80.0, 0.0, 0.0, 2025.0)  # first row of the model's test values
    >>> round(field.declination_deg, 2), round(field.dip_deg, 2), round(field.total_mg, 2)
    (1.28, 83.21, 551.78)
    """
    _require("latitude_deg", latitude_deg, -90.0, 90.0, "deg")
    _require("longitude_deg", longitude_deg, -180.0, 360.0, "deg")
    _require("altitude_km", altitude_km, -1.0, 850.0, "km")
    _require("year", year, EPOCH, LAST, "")
    from pygeomag import GeoMag

    result = GeoMag(coefficients_file=_COEFFICIENTS).calculate(
        latitude_deg, longitude_deg, altitude_km, year
    )
    sd = result.calculate_uncertainty()
    return GeomagneticField(
        model=MODEL,
        year=year,
        declination_deg=float(result.d),
        declination_sd_deg=float(sd.d),
        dip_deg=float(result.i),
        dip_sd_deg=float(sd.i),
        horizontal_mg=float(result.h) * MG_PER_NT,
        horizontal_sd_mg=float(sd.h) * MG_PER_NT,
        total_mg=float(result.f) * MG_PER_NT,
        total_sd_mg=float(sd.f) * MG_PER_NT,
        ned_mg=(
            float(result.x) * MG_PER_NT,
            float(result.y) * MG_PER_NT,
            float(result.z) * MG_PER_NT,
        ),
    )


def true_heading_deg(magnetic_deg: ArrayLike, declination_deg: float) -> NDArray[np.float64]:
    """Return true headings in [0, 360): magnetic plus declination, east positive.

    Caruso prints 'add if westerly, subtract if easterly', the wrong way round; Cho & Park (3),
    (18) count their declination positive to the west.

    >>> true_heading_deg(358.0, 4.0).item()
    2.0
    """
    return wrap_360_deg(np.asarray(magnetic_deg, dtype=float) + declination_deg)


def _require(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:
        message = f"{name} must be {low:g} to {high:g}; instead received {value:g} {unit}"
        raise ValueError(message.rstrip())
