from __future__ import annotations

import pytest

from bench.errors import BenchNotReady, ConfigError
from bench.station import check_model_gate, load_station

BODY = """name: hall 2
horizontal: 20 uT
dip: 65 deg
declination: 3 deg
field_azimuth: -12.5 deg
horizontal_uncertainty: 1 mG
dip_uncertainty: 0.05 deg
field_azimuth_uncertainty: 0.05 deg
rig_angle_uncertainty: 0.04 deg
"""
GATE = """model_gate:
  latitude: 48 deg
  longitude: 11 deg
  altitude: 0.5 km
  date: 2026-11-22
  field_tolerance: 20 mG
  dip_tolerance: 2 deg
"""


@pytest.fixture
def station_of(tmp_path):
    def load(text):
        path = tmp_path / "hall.yaml"
        path.write_text(text, encoding="utf-8")
        return load_station(str(path))

    return load


def test_a_station_holds_its_field_in_the_units_of_the_bench(station_of):
    station = station_of(BODY)

    assert (station.horizontal_mg, station.dip_deg) == (200.0, 65.0)
    assert (station.field_azimuth_deg, station.declination_deg) == (-12.5, 3.0)
    assert station.model_gate is None


@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        ("20 uT", "0 mG", "horizontal must be from 1 mG to 800 mG"),
        ("65 deg", "90 deg", "dip must be from -89 deg to 89 deg"),
        ("65 deg", "65", "number with its unit"),
        ("dip:", "dib:", "unknown key 'dib'; did you mean 'dip'?"),
    ],
)
def test_a_station_that_cannot_be_is_refused(station_of, before, after, sentence):
    with pytest.raises(ConfigError) as refusal:
        station_of(BODY.replace(before, after))

    assert sentence in str(refusal.value)


def test_a_station_near_the_models_field_passes_the_gate(station_of):
    check_model_gate(station_of(BODY + GATE), horizontal_mg=210.0, dip_deg=64.0)


@pytest.mark.parametrize(("horizontal_mg", "dip_deg"), [(225.0, 65.0), (200.0, 62.0)])
def test_a_station_far_from_the_models_field_is_not_ready(station_of, horizontal_mg, dip_deg):
    station = station_of(BODY + GATE)

    with pytest.raises(BenchNotReady, match="field of station hall 2 must lie within 20 mG"):
        check_model_gate(station, horizontal_mg, dip_deg)


def test_a_station_without_a_gate_is_not_checked(station_of):
    check_model_gate(station_of(BODY), horizontal_mg=500.0, dip_deg=0.0)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("dip: 65 deg", "dip: 89 deg", "field of horizontal and dip must be at most 1000 mG"),
        ("declination: 3 deg", "declination: 1e300 deg", "declination must be from -360 deg"),
        ("field_azimuth: -12.5", "field_azimuth: 361", "field_azimuth must be from -360 deg"),
        ("angle_uncertainty: 0.04", "angle_uncertainty: -0.04", "must not be negative"),
    ],
)
def test_a_station_that_is_not_on_earth_is_refused(station_of, old, new, sentence):
    with pytest.raises(ConfigError, match=sentence):
        station_of(BODY.replace(old, new))


@pytest.mark.parametrize(
    ("section", "sentence"),
    [
        ("reference: {change: 0 mG}", "change must be above zero"),
        ("reference: {change: -1 mG}", "change must not be negative"),
        ("reference: {address: 254}", "reference.address"),
        ("seat: {index: 181 deg}", "index must be from -180 deg to 180 deg"),
        ("seat: {iron: [101 mG, 0 mG, 0 mG]}", "iron must be at most 100 mG on each axis"),
        ("seat: {iron: [1 mG, 0 mG]}", "seat.iron: value is missing"),
        ("surroundings: {drift_uncertainty: -1 mG}", "drift_uncertainty must not be negative"),
    ],
)
def test_a_section_that_cannot_be_is_refused(station_of, section, sentence):
    with pytest.raises(ConfigError) as refusal:
        station_of(BODY + section + "\n")

    assert sentence in str(refusal.value)
