"""Station files: what the bench holds for true about its place, its rig and its field.

The file is the station's own calibration: the field's strength, dip and azimuth against
the rig's zero, each with its expanded uncertainty. A run may estimate them beside the
coefficients, but only to compare them with this record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING, Annotated, Final, Self

from pydantic import StringConstraints, model_validator

from bench.errors import BenchNotReady
from bench.quantity import Degrees, Metres, Milligauss
from bench.shipped import file_sha256, find_file
from bench.typed_yaml import FileModel, load_model

if TYPE_CHECKING:
    from pathlib import Path

STRONGEST_MG: Final = 1000.0
"""Strongest field of a station; the Earth's is at most 700 mG."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Station:
    """The station of a run; `u_` values are expanded uncertainties (k = 2).

    `field_azimuth_deg` is the azimuth of magnetic north counted clockwise from the rig's
    zero: magnetic heading = rig azimuth - field azimuth.
    """

    name: str
    horizontal_mg: float
    dip_deg: float
    declination_deg: float
    field_azimuth_deg: float
    u_horizontal_mg: float
    u_dip_deg: float
    u_field_azimuth_deg: float
    u_rig_deg: float
    model_gate: ModelGate | None
    sha256: str
    path: Path


def load_station(name: str, *, beside: Path | None = None) -> Station:
    """Return a shipped station (by name) or any file's (by path).

    Raises
    ------
    ConfigError
        One sentence with file, line and column if it cannot be used.
    """
    path = find_file("stations", name, beside=beside)
    file = load_model(path, StationFile)
    return Station(
        name=file.name,
        horizontal_mg=file.horizontal,
        dip_deg=file.dip,
        declination_deg=file.declination,
        field_azimuth_deg=file.field_azimuth,
        u_horizontal_mg=file.horizontal_uncertainty,
        u_dip_deg=file.dip_uncertainty,
        u_field_azimuth_deg=file.field_azimuth_uncertainty,
        u_rig_deg=file.rig_angle_uncertainty,
        model_gate=file.model_gate,
        sha256=file_sha256(path),
        path=path,
    )


def check_model_gate(station: Station, horizontal_mg: float, dip_deg: float) -> None:
    """Check a station's record against what a field model says for its place and date.

    Parameters
    ----------
    station : Station
        Its `model_gate` holds the tolerances; without one nothing is checked.
    horizontal_mg, dip_deg : float
        Horizontal field and dip of the model.

    Raises
    ------
    BenchNotReady
        If they differ by more than the tolerances.
    """
    gate = station.model_gate
    if gate is None:
        return
    field_change_mg = abs(station.horizontal_mg - horizontal_mg)
    dip_change_deg = abs(station.dip_deg - dip_deg)
    if field_change_mg > gate.field_tolerance or dip_change_deg > gate.dip_tolerance:
        message = (
            f"{station.path}: field of station {station.name} must lie within "
            f"{gate.field_tolerance:g} mG and {gate.dip_tolerance:g} deg of the model's "
            f"{horizontal_mg:.1f} mG and {dip_deg:.2f} deg; instead received "
            f"{station.horizontal_mg:.1f} mG and {station.dip_deg:.2f} deg"
        )
        raise BenchNotReady(message)
