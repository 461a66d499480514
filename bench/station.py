"""Station files: what the bench holds for true about its place, its rig and its field.

The file is the station's own calibration: the field's strength, dip and azimuth against
the rig's zero, each with its expanded uncertainty. A run may estimate them beside the
coefficients, but only to compare them with this record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.errors import BenchNotReady
from bench.quantity import format_quantity
from bench.shipped import file_sha256, find_file
from bench.station_file import RigEntry, StationFile
from bench.typed_yaml import load_model

if TYPE_CHECKING:
    from datetime import date
    from pathlib import Path

    from bench.station_file import ModelGate, ReferenceEntry, SeatEntry


@dataclass(frozen=True, slots=True, kw_only=True)
class Seat:
    """The seat that holds the unit, against the rig's inner axis; `u_` are expanded (k = 2).

    `index_deg` is its turn about down, clockwise: forward of the seat points to rig azimuth +
    index. `pitch_deg` and `roll_deg` are its level. `iron_mg` is the field of the fixture's own
    iron in the seat's frame, shape (3,); `u_iron_mg` is that of its forward and right part.
    """

    index_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    iron_mg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    u_index_deg: float = 0.0
    u_level_deg: float = 0.0
    u_iron_mg: float = 0.0
    u_iron_down_mg: float = 0.0
    verified: date | None = None
    golden: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What else is uncertain at a station, expanded (k = 2).

    `u_one_cycle_deg`, `u_two_cycle_deg` and `u_fine_deg` are parts of each encoder's error;
    `u_squareness_deg` of the axes, `u_base_level_deg` of the base; `u_drift_mg` is the field's
    change over a run and `u_gradient_mg` its difference between the axes' crossing and the sensor.
    """

    u_one_cycle_deg: float = 0.0
    u_two_cycle_deg: float = 0.0
    u_fine_deg: float = 0.0
    u_squareness_deg: float = 0.0
    u_base_level_deg: float = 0.0
    u_drift_mg: float = 0.0
    u_gradient_mg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceSensor:
    """The station's reference magnetometer: its address, and the change that spoils a pose."""

    address: int
    change_mg: float


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
    seat: Seat
    surroundings: Surroundings
    reference: ReferenceSensor | None
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
        seat=_seat(file.seat),
        surroundings=_surroundings(file),
        reference=_reference(file.reference),
        model_gate=file.model_gate,
        sha256=file_sha256(path),
        path=path,
    )


def _seat(entry: SeatEntry) -> Seat:
    down_mg = entry.iron_down_uncertainty
    return Seat(
        index_deg=entry.index,
        pitch_deg=entry.pitch,
        roll_deg=entry.roll,
        iron_mg=entry.iron,
        u_index_deg=entry.index_uncertainty,
        u_level_deg=entry.level_uncertainty,
        u_iron_mg=entry.iron_uncertainty,
        u_iron_down_mg=entry.iron_uncertainty if down_mg is None else down_mg,
        verified=entry.verified,
        golden=entry.golden,
    )


def _surroundings(file: StationFile) -> Surroundings:
    rig = file.rig
    if rig is None:
        third_deg = file.rig_angle_uncertainty / math.sqrt(3.0)
        rig = RigEntry(
            one_cycle_uncertainty=format_quantity(third_deg, "deg"),
            two_cycle_uncertainty=format_quantity(third_deg, "deg"),
            fine_uncertainty=format_quantity(third_deg, "deg"),
        )
    return Surroundings(
        u_one_cycle_deg=rig.one_cycle_uncertainty,
        u_two_cycle_deg=rig.two_cycle_uncertainty,
        u_fine_deg=rig.fine_uncertainty,
        u_squareness_deg=rig.squareness_uncertainty,
        u_base_level_deg=rig.base_level_uncertainty,
        u_drift_mg=file.surroundings.drift_uncertainty,
        u_gradient_mg=file.surroundings.gradient_uncertainty,
    )


def _reference(entry: ReferenceEntry | None) -> ReferenceSensor | None:
    if entry is None:
        return None
    return ReferenceSensor(address=entry.address, change_mg=entry.change)


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
