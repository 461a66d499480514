"""What may stand in a station file, and what must."""

from __future__ import annotations

import math
from datetime import date  # noqa: TC003  (pydantic reads it)
from typing import Annotated, Final, Self

from pydantic import Field, StringConstraints, model_validator

from bench.quantity import Degrees, Metres, Milligauss
from bench.typed_yaml import FileModel

STRONGEST_MG: Final = 1000.0
"""Strongest field of a station; the Earth's is at most 700 mG."""
MOST_TILT_DEG: Final = 10.0
"""Largest pitch and roll of a seat against the rig's inner axis."""
MOST_IRON_MG: Final = 100.0
"""Strongest iron of a fixture, each axis."""
_UNCERTAINTIES: Final = (
    "horizontal_uncertainty",
    "dip_uncertainty",
    "field_azimuth_uncertainty",
    "rig_angle_uncertainty",
)


class ModelGate(FileModel):
    """Gate of the station's field against the World Magnetic Model; it never judges a unit."""

    latitude: Degrees
    """Geodetic latitude, north positive."""
    longitude: Degrees
    """Longitude, east positive."""
    altitude: Metres = 0.0
    """Height above the ellipsoid."""
    date: date
    """Day for which the model is evaluated."""
    field_tolerance: Milligauss = 30.0
    """Largest difference of the horizontal field; buildings bend it."""
    dip_tolerance: Degrees = 3.0
    """Largest difference of the dip."""


class NotNegative(FileModel):
    """Base of sections whose uncertainties and tolerances are not below zero."""

    @model_validator(mode="after")
    def _uncertainties_are_possible(self) -> Self:
        for name in type(self).model_fields:
            value = getattr(self, name)
            guarded = name.endswith(("_uncertainty", "change")) and value is not None
            if guarded and value < 0.0:
                message = f"{name} must not be negative; instead received {value:g}"
                raise ValueError(message)
        return self


class SeatEntry(NotNegative):
    """The seat that holds the unit; `verify` measures it by reversal of a golden unit."""

    index: Degrees = 0.0
    """Turn of the seat about its down axis against the rig's zero, clockwise."""
    pitch: Degrees = 0.0
    """Pitch of the seat against the rig's inner axis, nose up."""
    roll: Degrees = 0.0
    """Roll of the seat against the rig's inner axis, right side down."""
    iron: tuple[Milligauss, Milligauss, Milligauss] = (0.0, 0.0, 0.0)
    """Field of the fixture's own iron at the unit: forward, right, down of the seat."""
    index_uncertainty: Degrees = 0.1
    """U (k = 2) of the index."""
    level_uncertainty: Degrees = 0.05
    """U (k = 2) of the seat's pitch and of its roll against the rig's inner axis."""
    iron_uncertainty: Milligauss = 0.2
    """U (k = 2) of the iron's field, forward and right."""
    iron_down_uncertainty: Milligauss | None = None
    """U (k = 2) of its down part; none: as the others."""
    verified: date | None = None
    """Day of the last reversal; none: never."""
    golden: str = ""
    """Serial of the golden unit of that reversal."""

    @model_validator(mode="after")
    def _seat_is_possible(self) -> Self:
        for name, largest_deg in (
            ("index", 180.0),
            ("pitch", MOST_TILT_DEG),
            ("roll", MOST_TILT_DEG),
        ):
            value_deg = getattr(self, name)
            if not abs(value_deg) <= largest_deg:
                message = (
                    f"{name} must be from -{largest_deg:g} deg to {largest_deg:g} deg; "
                    f"instead received {value_deg:g} deg"
                )
                raise ValueError(message)
        strongest_mg = max(abs(value_mg) for value_mg in self.iron)
        if strongest_mg > MOST_IRON_MG:
            message = (
                f"iron must be at most {MOST_IRON_MG:g} mG on each axis; "
                f"instead received {strongest_mg:g} mG"
            )
            raise ValueError(message)
        return self


class RigEntry(NotNegative):
    """What the rig's angles are worth; U (k = 2), the same error whenever an angle comes back."""

    one_cycle_uncertainty: Degrees
    """Part of an encoder's error that has one cycle a turn (eccentricity), at any angle."""
    two_cycle_uncertainty: Degrees
    """Part that has two cycles a turn (ellipticity)."""
    fine_uncertainty: Degrees
    """The rest: graduation and resolution."""
    squareness_uncertainty: Degrees = 0.02
    """Squareness of azimuth to pitch axis and of pitch to roll axis, and the wobble."""
    base_level_uncertainty: Degrees = 0.02
    """Level of the base about north and about east."""


class SurroundingsEntry(NotNegative):
    """What changes about the field at the seat; U (k = 2), each axis."""

    drift_uncertainty: Milligauss = 0.2
    """Change of the field over one run."""
    gradient_uncertainty: Milligauss = 0.1
    """Difference of the field between the axes' crossing and the sensor, which moves about it."""


class ReferenceEntry(NotNegative):
    """The station's reference magnetometer: a second node that watches the field through a run."""

    address: Annotated[int, Field(ge=0, le=0xFD)] = 0x90
    """J1939 source address."""
    change: Milligauss = 0.6
    """Change of the field during a run, any axis, from which on a pose is spoiled."""

    @model_validator(mode="after")
    def _noise_is_no_change(self) -> Self:
        if self.change == 0.0:
            message = "change must be above zero: every pose would be spoiled; instead received 0"
            raise ValueError(message)
        return self


class StationFile(FileModel):
    """A station file."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=60)]
    """Name of the station in every record."""
    horizontal: Milligauss
    """Horizontal field at the seat."""
    dip: Degrees
    """Dip at the seat, positive down."""
    declination: Degrees = 0.0
    """East declination: true heading = magnetic heading + declination."""
    field_azimuth: Degrees = 0.0
    """Azimuth of magnetic north against the rig's zero, clockwise."""
    horizontal_uncertainty: Milligauss
    """U (k = 2) of the horizontal field."""
    dip_uncertainty: Degrees
    """U (k = 2) of the dip."""
    field_azimuth_uncertainty: Degrees
    """U (k = 2) of the field's azimuth."""
    rig_angle_uncertainty: Degrees
    """U (k = 2) of each of the rig's angles."""
    seat: SeatEntry = SeatEntry()
    """The seat's own errors; without this section it counts as not verified."""
    rig: RigEntry | None = None
    """Parts of the rig's angle errors; none: thirds of rig_angle_uncertainty, as powers add."""
    surroundings: SurroundingsEntry = SurroundingsEntry()
    """What changes about the field."""
    reference: ReferenceEntry | None = None
    """The reference magnetometer; none: the station has none."""
    model_gate: ModelGate | None = None
    """Gate against the World Magnetic Model; none: not checked."""

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        if not 1.0 <= self.horizontal <= 800.0:
            message = (
                f"horizontal must be from 1 mG to 800 mG; instead received {self.horizontal:g} mG"
            )
            raise ValueError(message)
        if not -89.0 <= self.dip <= 89.0:
            message = f"dip must be from -89 deg to 89 deg; instead received {self.dip:g} deg"
            raise ValueError(message)
        strength_mg = self.horizontal / math.cos(math.radians(self.dip))
        if strength_mg > STRONGEST_MG:
            message = (
                f"field of horizontal and dip must be at most {STRONGEST_MG:g} mG; "
                f"instead received {strength_mg:.0f} mG"
            )
            raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _angles_and_uncertainties_are_possible(self) -> Self:
        for name in ("declination", "field_azimuth"):
            if not abs(getattr(self, name)) <= 360.0:
                message = (
                    f"{name} must be from -360 deg to 360 deg; "
                    f"instead received {getattr(self, name):g} deg"
                )
                raise ValueError(message)
        for name in _UNCERTAINTIES:
            if getattr(self, name) < 0.0:
                message = f"{name} must not be negative; instead received {getattr(self, name):g}"
                raise ValueError(message)
        return self
