"""`compass-bench verify`: what it refuses, what it says, and when it writes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from bench.cli.main import app
from bench.errors import ConfigError
from bench.shipped import find_file
from bench.station import load_station

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result


@pytest.fixture
def verify(tmp_path: Path):
    def run(*options: str, golden: str | None = "GOLD1") -> Result:
        given = ["verify", "--no-input", "--no-dashboard", "--out", str(tmp_path / "runs")]
        if golden is not None:
            given += ["--golden", golden]
        return CliRunner().invoke(app, [*given, *options])

    return run


@pytest.mark.parametrize(
    ("golden", "options", "sentence"),
    [
        (None, [], "--golden must be the serial number of the golden unit; instead received none"),
        ("two words", [], "--golden must be 1 to 32 letters"),
        ("GOLD1", ["--write", "nowhere/at/all.yaml"], "--write must be a file in a folder"),
        ("GOLD1", ["--site", "nowhere.yaml"], "there is no such file"),
        ("GOLD1", ["--fault", "seat_turnd"], "did you mean seat_turned?"),
    ],
)
def test_what_cannot_be_used_is_refused_before_anything_is_measured(
    verify, tmp_path, golden, options, sentence
):
    result = verify(*options, golden=golden)

    assert isinstance(result.exception, ConfigError)
    assert result.exception.exit_code == 2
    assert sentence in str(result.exception)
    assert not (tmp_path / "runs").exists()


def test_a_golden_unit_that_fails_leaves_the_bench_unverified_and_the_file_unwritten(
    verify, tmp_path
):
    target = tmp_path / "new.yaml"

    result = verify("--fault", "excess_noise", "--write", str(target))

    assert result.exit_code == 5
    assert "was not written: the run does not tell the seat" in result.stderr
    assert not target.exists()


def test_a_rig_that_fails_is_an_error_and_nothing_is_written(verify, tmp_path):
    target = tmp_path / "new.yaml"

    result = verify("--fault", "axis_stalled_pitch", "--write", str(target))

    assert result.exit_code == 4
    assert not target.exists()


def test_a_sound_bench_is_verified_and_says_so_in_both_forms(verify):
    shipped = find_file("stations", "default").read_bytes()

    result = verify("--json")

    record = json.loads(result.stdout)
    assert result.exit_code == 0
    assert record["verdict"]["outcome"] == "PASS"
    assert record["coefficients"] == {}
    assert [one["mounting"] for one in record["reversal"]["mountings"]] == [
        "as_marked", "turned", "turned_over",
    ]  # fmt: skip
    assert all(one["told"] for one in record["reversal"]["found"].values())
    assert "nothing was written" in result.stderr
    assert find_file("stations", "default").read_bytes() == shipped


def test_the_table_sets_file_and_finding_side_by_side(verify, tmp_path):
    target = tmp_path / "new.yaml"

    result = verify("--fault", "seat_turned", "--write", str(target))

    (line,) = (each for each in result.stdout.splitlines() if each.startswith("seat index "))
    assert result.exit_code == 5
    assert f"+0.000 ± {load_station('default').seat.u_index_deg:.3f} deg" in line
    assert "+0.49" in line
    assert line.endswith("changed")
    assert f"station file written: {target}" in result.stderr.replace("\n", "")
