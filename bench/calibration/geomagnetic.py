"""Earth's field by the World Magnetic Model 2025, through pygeomag.

It gives declination (true = magnetic + declination, east positive) and gates the station's
record. It never judges a heading: its declination alone has a standard deviation of about 0.3
to 0.4 deg at middle latitudes, and a building's iron is not in it.

References
----------
.. [1] NOAA NCEI and BGS, "The US/UK World Magnetic Model for 2025-2030": error model.
.. [2] S. Y. Cho and C. G. Park, ETRI Journal 27(3), 2005, (25): dip of a dipole.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Final

import numpy as np

from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

EPOCH: Final = 2025.0
LAST: Final = 2030.0
MG_PER_NT: Final = 0.01
_COEFFICIENTS: Final = "wmm/WMM_2025.COF"


@dataclass(frozen=True, slots=True, kw_only=True)
class GeomagneticField:
    """Field of the model at one place and date; `_sd` are the model's standard deviations."""

    year: float
    declination_deg: float
    declination_sd_deg: float
    dip_deg: float
    dip_sd_deg: float
    horizontal_mg: float
    total_mg: float
    ned_mg: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class DipComparison:
    """Dip of one place and date by latitude, by geomagnetic latitude and by the model, in degrees.

    Attributes
    ----------
    geographic_deg : float
        (25) with the latitude, as Cho & Park use it: right for a dipole along the Earth's axis.
    geomagnetic_deg : float
        (25) with the latitude from the dipole's pole, as the formula means it.
    model_deg : float
        World Magnetic Model.
    geomagnetic_latitude_deg : float
    """

    geographic_deg: float
    geomagnetic_deg: float
    model_deg: float
    geomagnetic_latitude_deg: float


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
        year=year,
        declination_deg=float(result.d),
        declination_sd_deg=float(sd.d),
        dip_deg=float(result.i),
        dip_sd_deg=float(sd.i),
        horizontal_mg=float(result.h) * MG_PER_NT,
        total_mg=float(result.f) * MG_PER_NT,
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


def dip_from_latitude_deg(latitude_deg: ArrayLike) -> NDArray[np.float64]:
    """Return the dip, shape (...), of a dipole: tan(dip) = 2 tan(latitude) [2]_ (25).

    Parameters
    ----------
    latitude_deg : array-like, shape (...)
        The formula's own is the *geomagnetic* latitude (`geomagnetic_latitude_deg`).

    Examples
    --------
    >>> dip_from_latitude_deg([0.0, 37.5, 90.0]).round(2).tolist()
    [0.0, 56.91, 90.0]
    """
    latitude_rad = np.deg2rad(np.asarray(latitude_deg, dtype=float))
    return np.asarray(np.rad2deg(np.arctan2(2.0 * np.sin(latitude_rad), np.cos(latitude_rad))))


def geomagnetic_pole_deg(year: float) -> tuple[float, float]:
    """Return latitude and longitude of the geomagnetic north pole: that of the model's dipole.

    From the coefficients of degree 1 and their yearly change.

    >>> latitude_deg, longitude_deg = geomagnetic_pole_deg(2025.0)
    >>> round(latitude_deg, 1), round(longitude_deg, 1)
    (80.8, -72.8)
    """
    _require("year", year, EPOCH, LAST, "")
    north = -_dipole_nt(year)
    horizontal = float(np.hypot(north[0], north[1]))
    latitude_rad, longitude_rad = np.arctan2(north[2], horizontal), np.arctan2(north[1], north[0])
    return float(np.rad2deg(latitude_rad)), float(np.rad2deg(longitude_rad))


def geomagnetic_latitude_deg(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike, year: float
) -> NDArray[np.float64]:
    """Return geomagnetic latitudes, shape (...): angles from the dipole's equator.

    The Earth is taken as a sphere, as (25) does; geodetic latitudes differ from geocentric ones
    by 0.19 deg or less.

    >>> round(float(geomagnetic_latitude_deg(37.5, 127.0, 2025.0)), 2)
    28.78
    """
    latitude_rad = np.deg2rad(np.asarray(latitude_deg, dtype=float))
    longitude_rad = np.deg2rad(np.asarray(longitude_deg, dtype=float))
    dipole = -_dipole_nt(year)
    x, y, z = dipole / np.linalg.norm(dipole)
    across = x * np.cos(longitude_rad) + y * np.sin(longitude_rad)
    sine = across * np.cos(latitude_rad) + z * np.sin(latitude_rad)
    return np.asarray(np.rad2deg(np.arcsin(np.clip(sine, -1.0, 1.0))))


def compare_dips(
    latitude_deg: float, longitude_deg: float, altitude_km: float, year: float
) -> DipComparison:
    """Return the three dips of a place and date side by side; arguments as of `earth_field`.

    Examples
    --------
    >>> seoul = compare_dips(37.5, 127.0, 0.0, 2026.9)
    >>> dips_deg = seoul.geographic_deg, seoul.geomagnetic_deg, seoul.model_deg
    >>> [round(dip_deg, 1) for dip_deg in dips_deg]
    [56.9, 47.8, 54.6]
    """
    model = earth_field(latitude_deg, longitude_deg, altitude_km, year)
    magnetic_deg = float(geomagnetic_latitude_deg(latitude_deg, longitude_deg, year))
    return DipComparison(
        geographic_deg=float(dip_from_latitude_deg(latitude_deg)),
        geomagnetic_deg=float(dip_from_latitude_deg(magnetic_deg)),
        model_deg=model.dip_deg,
        geomagnetic_latitude_deg=magnetic_deg,
    )


def _dipole_nt(year: float) -> NDArray[np.float64]:
    """Return (g11, h11, g10): the dipole's direction, which points south."""
    at_epoch, by_year = _degree_one()
    return at_epoch + (year - EPOCH) * by_year


@cache
def _degree_one() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (g11, h11, g10) in nT at the model's epoch, and their change a year."""
    text = (files("pygeomag") / _COEFFICIENTS).read_text(encoding="utf-8")
    rows = {tuple(line.split()[:2]): line.split()[2:] for line in text.splitlines()[1:]}
    (g10, _, g10_year, _), (g11, h11, g11_year, h11_year) = (
        (float(value) for value in rows["1", order]) for order in "01"
    )
    return np.array([g11, h11, g10]), np.array([g11_year, h11_year, g10_year])


def _require(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:
        message = f"{name} must be {low:g} to {high:g}; instead received {value:g} {unit}"
        raise ValueError(message.rstrip())
