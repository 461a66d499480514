"""The seat that holds the unit, and its iron: in the readings, not in the unit.

In the seat raw = W (v + s) + b with s the fixture's field, so that every method that is linear in
the readings finds the offset b + W s. The unit's own is W s less, which is exact, where a
correction of the readings would have to know W before the fit. A method that finds W but for a
rotation (the ellipsoid) leaves as much of s as that rotation turns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from bench.calibration.tilt import heading_deg, ned_from_body

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit


class SeatPosition(Protocol):
    """The part of a station's seat that readings are corrected by (`bench.station.Seat`)."""

    @property
    def index_deg(self) -> float:
        """Turn about down, clockwise."""
        ...

    @property
    def pitch_deg(self) -> float:
        """Nose up."""
        ...

    @property
    def roll_deg(self) -> float:
        """Right side down."""
        ...

    @property
    def iron_mg(self) -> tuple[float, float, float]:
        """Field of the fixture's iron: forward, right, down of the seat."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatFound:
    """Index, level and iron of a seat; of a square one without iron by default."""

    index_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    iron_mg: tuple[float, float, float] = (0.0, 0.0, 0.0)


SQUARE: SeatPosition = SeatFound()


def without_fixture(fit: Fit, data: CalibrationData) -> Fit:
    """Return a fit of readings in the seat as that of the unit alone.

    The uncertainty of the fixture's field is not part of the fit's covariance: it is the
    station's, shared by all units.
    """
    if data.fixture_mg is None or fit.offset_mg is None or fit.matrix is None:
        return fit
    return replace(fit, offset_mg=fit.offset_mg - np.linalg.solve(fit.matrix, data.fixture_mg))


def perfect_heading_deg(data: CalibrationData) -> NDArray[np.float64]:
    """Return the heading, shape (n,), of a perfect module that feels the fixture's iron too.

    Raises
    ------
    ValueError
        If the data lack an angle, the station's field or the fixture's.
    """
    azimuth_deg, pitch_deg, roll_deg = data.azimuth_deg, data.pitch_deg, data.roll_deg
    if azimuth_deg is None or pitch_deg is None or roll_deg is None:
        message = "azimuth_deg, pitch_deg and roll_deg must be given for a seat with iron"
        raise ValueError(message)
    if data.station_field_mg is None or data.fixture_mg is None:
        message = "station_field_mg and fixture_mg must be given for a seat with iron"
        raise ValueError(message)
    turns = ned_from_body(azimuth_deg, pitch_deg, roll_deg)
    field_mg = np.swapaxes(turns, 1, 2) @ data.station_field_mg + data.fixture_mg
    return heading_deg(field_mg, pitch_deg, roll_deg)
