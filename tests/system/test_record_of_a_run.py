"""What the record and the report of a whole good run say about the unit and the field."""

from __future__ import annotations

import json
import re

import pytest

from bench.acceptance.outcome import Outcome
from bench.cli.run_command import RunRequest, run_procedure
from bench.rejudge import rejudge


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    request = RunRequest(
        procedure="eol_three_axis", serial="SN0001", out=out,
        no_input=True, dashboard=False, quiet=True,
    )  # fmt: skip
    assert run_procedure(request) == 0
    return (out / "latest").resolve()


@pytest.fixture(scope="module")
def record(folder):
    return json.loads((folder / "record.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def measured(record):
    return {entry["name"]: entry for entry in record["measurements"]}


def test_the_deviation_stands_before_and_after_in_numbers_and_in_words(record, measured):
    raw, compensated = record["deviation"]["raw"], record["deviation"]["compensated"]

    for entry in (raw, compensated):
        assert all(0.0 < entry["se"][letter] < 0.1 for letter in "ABCDE")
    assert max(abs(raw[letter]) for letter in "BC") > 5.0
    assert raw["words"][0].startswith("hard iron, one cycle per turn: ")
    assert all(abs(compensated[letter]) < 0.2 for letter in "ABCDE")
    assert measured["raw_max"]["value"] > max(abs(raw[letter]) for letter in "BC")


def test_the_report_shows_the_deviation(folder, record):
    text = re.sub(r"<[^>]+>", " ", (folder / "report.html").read_text(encoding="utf-8"))

    for name in ("raw", "compensated"):
        assert record["deviation"][name]["words"][0] in text
        assert f"{record['deviation'][name]['C']:.3f}".replace("-", "\N{MINUS SIGN}") in text


def test_the_field_is_measured_on_other_poses_and_is_not_the_stations_by_definition(measured):
    difference = measured["field_magnitude_difference"]

    assert difference["step"] == "verify"
    assert 0.0 < difference["value"] < 0.1
    assert (difference["high"], difference["missed"]) == (0.5, "ERROR")


def test_the_sensitivity_is_the_units_own_and_not_the_nominal_one(measured):
    assert 80.0 < measured["sensitivity"]["value"] < 120.0
    assert abs(measured["sensitivity"]["value"] - 100.0) > 0.1


def test_the_samples_give_every_number_of_the_record_again(folder):
    again = rejudge(folder)

    assert again.verdict.outcome is Outcome.PASS
    assert again.differing == []
