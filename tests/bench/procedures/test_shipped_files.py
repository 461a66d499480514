"""Everything that is shipped loads, agrees with its schema, and holds what a procedure must."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from jsonschema import Draft7Validator

import bench
from bench.acceptance.catalogue import BUDGETED, MEASUREMENTS
from bench.acceptance.outcome import Outcome
from bench.errors import ConfigError
from bench.limit_set import load_limits
from bench.plan import plan_of
from bench.procedure_loader import (
    json_schema,
    load_procedure,
    procedure_names,
    schema_names,
    schema_text,
)
from bench.shipped import find_file, shipped_names
from bench.station import load_station

FOLDERS = {"procedure": "procedures", "limits": "limits", "station": "stations"}
ROOT = Path(bench.__file__).parent


def test_a_procedure_for_every_way_to_calibrate_is_shipped():
    assert {
        "eol_three_axis", "eol_two_axis", "caruso_24", "set_reset", "min_max", "four_position",
        "soft_iron", "three_headings", "recording", "acceptance_swing",
    } <= set(procedure_names())  # fmt: skip


@pytest.mark.parametrize("name", shipped_names("procedures"))
def test_a_procedure_loads_with_limits_for_all_it_measures_and_can_be_planned(name):
    procedure = load_procedure(name)
    limits = load_limits(procedure.limits)

    limits.require(procedure.measured())
    load_station(procedure.station)

    assert procedure.name == name
    assert plan_of(procedure).duration_s > 0.0


@pytest.mark.parametrize("kind", schema_names())
def test_the_shipped_schema_is_the_models_and_takes_the_shipped_files(kind):
    folder = ROOT / FOLDERS[kind]
    validator = Draft7Validator(json_schema(kind))

    assert (folder / f"{kind}.schema.json").read_text(encoding="utf-8") == schema_text(kind)
    for path in folder.glob("*.yaml"):
        text = path.read_text(encoding="utf-8")
        assert text.startswith(f"# yaml-language-server: $schema={kind}.schema.json\n")
        assert list(validator.iter_errors(yaml.safe_load(text))) == []


@pytest.mark.parametrize("name", shipped_names("limits"))
def test_every_limit_has_the_catalogues_unit_a_meaning_and_an_action(name):
    for limit in load_limits(name).by_name.values():
        assert limit.unit == MEASUREMENTS[limit.name].unit
        assert limit.description.endswith(".")
        assert limit.action.endswith(".")


@pytest.mark.parametrize(
    ("name", "high"),
    [
        ("level_max", 0.5),
        ("tilt_max", 0.8),
        ("repeatability", 0.2),
        ("closing_error", 0.1),
        ("bench_against_module", 0.02),
        ("fit_residual", 0.6),
        ("peak_reading", 720.0),
        ("noise_x", 3 * 0.085),
        ("temperature_change", 0.25),
    ],
)
def test_the_main_procedures_limits_are_those_of_the_issue(name, high):
    limit = load_limits("eol_three_axis").by_name[name]

    assert limit.high == pytest.approx(high)
    assert name in BUDGETED or 0.0 < limit.uncertainty < high


@pytest.mark.parametrize("file", ["eol_three_axis", "eol_two_axis", "quick", "caruso_24"])
@pytest.mark.parametrize("name", ["level_max", "tilt_max"])
def test_the_heading_maxima_are_guarded_by_their_whole_computed_uncertainty(file, name):
    limits = load_limits(file)

    assert limits.unit is not None
    assert limits.by_name[name].guard_factor == 1.0
    assert limits.by_name[name].uncertainty == 0.0  # none is stated: the run computes it


@pytest.mark.parametrize("name", ["field_azimuth_difference", "dip_difference"])
def test_a_field_that_is_not_the_stations_is_an_error_of_the_bench(name):
    limit = load_limits("eol_three_axis").by_name[name]

    assert (limit.high, limit.missed) == (0.1, Outcome.ERROR)


def test_hk_must_be_at_least_4_gauss():
    assert {load_limits("eol_three_axis").by_name[f"hk_{axis}"].low for axis in "xyz"} == {4.0}


def test_the_main_procedure_has_the_poses_of_the_issue():
    steps = {step.name: step for step in load_procedure("eol_three_axis").steps}

    sweep = steps["level_sweep"].poses()
    assert [pose.direction for pose in sweep].count(1) == 25  # 24 and the return to start
    assert [pose.direction for pose in sweep].count(-1) == 24
    tilted = [pose.attitude for pose in steps["tilted_poses"].poses()]
    for pitch_deg, roll_deg in ((30, 0), (-30, 0), (0, 30), (0, -30)):
        ring = [a for a in tilted if (a.pitch_deg, a.roll_deg) == (pitch_deg, roll_deg)]
        assert len({a.azimuth_deg for a in ring}) >= 6
    verified = [pose.attitude for pose in steps["verify"].poses()]
    level = [a for a in verified if a.pitch_deg == a.roll_deg == 0.0]
    assert (len(level), len(verified) - len(level)) == (24, 24)
    assert not set(verified) & {pose.attitude for pose in sweep} | set(verified) & set(tilted)
    assert len(steps["returns"].poses()) == 32
    assert all(
        pose.dwell_s == 0.5 for name in steps for pose in steps[name].poses() if name != "noise"
    )


def test_the_default_station_is_the_default_site():
    station = load_station("default")

    assert (station.horizontal_mg, station.dip_deg) == (250.0, 60.0)
    assert station.u_field_azimuth_deg > 0.0


def test_an_unknown_name_is_refused_with_a_suggestion():
    with pytest.raises(ConfigError, match="unknown procedure 'eol_three_axes'; did you mean"):
        load_procedure("eol_three_axes")


def test_a_path_that_is_not_there_is_refused():
    with pytest.raises(ConfigError, match="there is no such file"):
        find_file("limits", "nowhere/limits.yaml")


def test_a_relative_path_is_looked_for_beside_the_file_that_names_it(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text("id: own\n", encoding="utf-8")

    assert find_file("limits", "own.yaml", beside=tmp_path) == path
