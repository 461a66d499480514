"""A station file is changed where a value changed, and nowhere else."""

from __future__ import annotations

from datetime import date

import pytest

from bench.acceptance.reversal_evaluation import StationValue
from bench.errors import BenchNotReady, ConfigError
from bench.shipped import find_file
from bench.station import load_station
from bench.station_writer import (
    changed_text,
    require_target,
    require_written,
    station_changes,
    write_station,
)

BODY = """# our hall
name: hall 2
horizontal: 20 uT  # measured in May
dip: 65 deg
horizontal_uncertainty: 1 mG
dip_uncertainty: 0.05 deg
field_azimuth_uncertainty: 0.05 deg
rig_angle_uncertainty: 0.04 deg
"""
SEATS = {
    "none": "",
    "block": "seat:\n  # by hand\n  index: 0.1 deg  # old\n  iron: [0 mG, 0 mG, 0 mG]\n# end\n",
    "list": "seat:\n  iron:\n    - 0 mG\n    - 0 mG\n    - 0 mG\n  golden: G0\nreference:\n"
    "  address: 145\n",
    "flow": "seat: {index: 0.1 deg, golden: G0}  # short\n",
    "no line end": "seat:\n  index: 0.1 deg",
}
FOUND = {"index": 0.49153, "pitch": -0.0121, "roll": 0.0072, "field_azimuth": -0.02222, "dip": 60.0}
IRON = {"iron_x": 2.0034, "iron_y": -1.9157, "iron_z": 1.2396}
DAY = date(2026, 11, 22)


@pytest.fixture
def changes():
    values = {
        name: StationValue(value=v, u=0.01539, unit="deg", told=True) for name, v in FOUND.items()
    }
    for name, value in IRON.items():
        u_mg = 0.4494 if name == "iron_z" else 0.1176
        values[name] = StationValue(value=value, u=u_mg, unit="mG", told=True)
    return station_changes(values, golden="GOLD1", verified=DAY)


def test_the_level_takes_the_larger_u_of_pitch_and_roll_and_so_does_the_iron():
    u = {"pitch": 0.01, "roll": 0.03, "iron_x": 0.1, "iron_y": 0.2}
    values = {
        name: StationValue(value=0.0, u=u.get(name, 0.05), unit="deg", told=True)
        for name in (*FOUND, *IRON)
    }

    seat = station_changes(values, golden="GOLD1", verified=DAY)["seat"]

    assert seat["level_uncertainty"] == "0.03 deg"
    assert seat["iron_uncertainty"] == "0.2 mG"


@pytest.mark.parametrize("name", ["level_uncertainty", "iron_uncertainty", "iron_down_uncertainty"])
def test_an_uncertainty_that_does_not_read_as_written_is_refused(tmp_path, changes, name):
    source = tmp_path / "hall.yaml"
    source.write_text(BODY, encoding="utf-8")
    station = write_station(source, tmp_path / "new.yaml", changes)
    unit = changes["seat"][name].split()[1]

    with pytest.raises(ConfigError, match=f"{name} must read as written"):
        require_written(station, changes | {"seat": changes["seat"] | {name: f"9 {unit}"}})
    with pytest.raises(ConfigError, match="field_azimuth_uncertainty must read as written"):
        require_written(station, changes | {"field_azimuth_uncertainty": "9 deg"})


@pytest.mark.parametrize("seat", SEATS)
def test_the_file_reads_as_what_was_written_and_keeps_the_rest(tmp_path, changes, seat):
    source, target = tmp_path / "hall.yaml", tmp_path / "new.yaml"
    source.write_text(BODY + SEATS[seat], encoding="utf-8")

    station = write_station(source, target, changes)

    assert (station.seat.index_deg, station.seat.pitch_deg) == (0.4915, -0.0121)
    assert station.seat.iron_mg == (2.003, -1.916, 1.24)
    assert (station.seat.u_iron_mg, station.seat.u_iron_down_mg) == (0.118, 0.449)
    assert (station.seat.verified, station.seat.golden) == (DAY, "GOLD1")
    assert (station.field_azimuth_deg, station.u_field_azimuth_deg) == (-0.0222, 0.0154)
    assert (station.horizontal_mg, station.dip_deg) == (200.0, 65.0)
    kept = [line for line in source.read_text().splitlines() if "#" in line]
    comments = [line.partition("#")[2] for line in kept]
    assert all(comment in target.read_text() for comment in comments)


def test_a_file_can_be_written_in_its_own_place_twice(tmp_path, changes):
    path = tmp_path / "hall.yaml"
    path.write_text(BODY + SEATS["block"], encoding="utf-8")

    write_station(path, path, changes)
    once = path.read_text()
    write_station(path, path, changes)

    assert path.read_text() == once
    assert list(tmp_path.iterdir()) == [path]


def test_the_shipped_station_is_a_source_and_stays_as_it_is(tmp_path, changes):
    shipped = find_file("stations", "default")
    before = shipped.read_bytes()

    station = write_station(shipped, tmp_path / "ours.yaml", changes)

    assert shipped.read_bytes() == before
    assert station.surroundings == load_station("default").surroundings
    assert "$schema" not in (tmp_path / "ours.yaml").read_text()


def test_what_an_anchor_shares_is_refused_and_leaves_the_target_alone(tmp_path, changes):
    source, target = tmp_path / "hall.yaml", tmp_path / "new.yaml"
    shared = BODY.replace("dip: 65 deg", "dip: &angle 65 deg\nfield_azimuth: *angle")
    source.write_text(shared, encoding="utf-8")
    target.write_text("kept", encoding="utf-8")

    with pytest.raises(BenchNotReady, match="the station file could not be written"):
        write_station(source, target, changes)

    assert target.read_text() == "kept"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hall.yaml", "new.yaml"]


def test_keys_are_added_to_mappings_of_either_style():
    text = changed_text(
        "a: 1 deg  # kept\nb: {c: 2 deg}\n", {"a": "3 deg", "b": {"d": "4"}, "e": "5"}
    )

    assert text == "a: 3 deg  # kept\nb: {c: 2 deg, d: 4}\ne: 5\n"
    assert changed_text("{}", {"e": "5"}) == "{e: 5}"


def test_a_file_that_is_no_mapping_is_refused():
    with pytest.raises(ConfigError, match="must hold a mapping"):
        changed_text("- 1\n", {"a": "2"})


@pytest.mark.parametrize("name", ["", "nowhere/station.yaml"])
def test_a_target_that_cannot_be_is_refused_before_anything_is_measured(tmp_path, name):
    with pytest.raises(ConfigError, match="--write must be a file in a folder that exists"):
        require_target(tmp_path / name)
