"""The Earth's field at the station."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from datetime import date

    from devices.rotation import Vector

_NT_PER_MG = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EarthField:
    """A uniform field, given as a geomagnetic chart gives it.

    Attributes
    ----------
    horizontal_mg : float
        Horizontal strength in mG, greater than 0.
    dip_deg : float
        Inclination below the horizon, within (-90, 90) degrees.
    declination_deg : float
        Azimuth of the field against the rig's zero (north), east positive.

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    horizontal_mg: float = 250.0
    dip_deg: float = 60.0
    declination_deg: float = 0.0

    def __post_init__(self) -> None:
        if not (self.horizontal_mg > 0.0 and math.isfinite(self.horizontal_mg)):
            message = (
                f"horizontal_mg must be greater than 0; instead received {self.horizontal_mg} mG"
            )
            raise ValueError(message)
        if not -90.0 < self.dip_deg < 90.0:
            message = f"dip_deg must be within (-90, 90); instead received {self.dip_deg} deg"
            raise ValueError(message)
        if not math.isfinite(self.declination_deg):
            message = f"declination_deg must be finite; instead received {self.declination_deg} deg"
            raise ValueError(message)

    @property
    def ned_mg(self) -> Vector:
        """Field in NED, mG."""
        declination_rad = math.radians(self.declination_deg)
        down_mg = self.horizontal_mg * math.tan(math.radians(self.dip_deg))
        return (
            self.horizontal_mg * math.cos(declination_rad),
            self.horizontal_mg * math.sin(declination_rad),
            down_mg,
        )

    @property
    def total_mg(self) -> float:
        """Strength of the whole field, mG."""
        return self.horizontal_mg / math.cos(math.radians(self.dip_deg))

    @classmethod
    def from_wmm(
        cls, latitude_deg: float, longitude_deg: float, altitude_km: float, day: date
    ) -> EarthField:
        """Return the World Magnetic Model's field at a place (WGS 84) on a day.

        The NED frame is then the true one: `declination_deg` is the model's declination.
        """
        from pygeomag import GeoMag  # noqa: PLC0415  (lazy: only this constructor needs it)

        new_year = day.replace(month=1, day=1)
        days = (day.replace(month=12, day=31) - new_year).days + 1
        year = day.year + (day - new_year).days / days
        result = GeoMag().calculate(
            glat=latitude_deg, glon=longitude_deg, alt=altitude_km, time=year
        )
        return cls(
            horizontal_mg=float(result.h) / _NT_PER_MG,
            dip_deg=float(result.i),
            declination_deg=float(result.d),
        )
