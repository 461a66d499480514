"""`compass-bench fit`: every method of a recording, ranked, raw readings first."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

from bench.calibration.methods import METHODS
from bench.calibration.tilt import ned_from_body
from bench.cli.main import app
from bench.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path

COLUMNS = "mx,my,mz,ax,ay,az,heading_deg,pitch_deg,roll_deg"


def invoke(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["fit", *arguments])
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A level turn and four tilts of a module with hard iron and 20 mg of accelerometer bias."""
    rng = np.random.default_rng(1)
    tilts = ((0, 0), (0, 0), (30, 0), (-30, 0), (0, 30), (0, -30))
    angles = np.array([(a, p, r) for p, r in tilts for a in range(0, 360, 15)], dtype=float)
    rotations = ned_from_body(*angles.T)
    field = np.einsum("nji,j->ni", rotations, np.array([250.0, 0.0, 433.0])) + [40.0, -30.0, 20.0]
    force = np.einsum("nji,j->ni", rotations, np.array([0.0, 0.0, -1.0])) + [0.02, -0.01, 0.0]
    field, force = field + rng.normal(0, 0.3, field.shape), force + rng.normal(0, 4e-4, force.shape)
    path = tmp_path_factory.mktemp("recording") / "unit.csv"
    rows = np.column_stack([field, force, angles])
    np.savetxt(path, rows, delimiter=",", header=COLUMNS, comments="")
    return path


def test_all_methods_stand_in_one_table_raw_first(recording: Path) -> None:
    code, output = invoke(str(recording))
    assert code == 0
    rows = [line.split("│")[1:-1] for line in output.splitlines() if line.startswith("│")]
    names = [name for row in rows if (name := row[0].strip())]
    assert names[:2] == ["raw", "truth_aided"]
    assert names[-1] == "set_reset"
    assert set(names) == {"raw", *METHODS}
    assert "accelerometer" in {row[5].strip() for row in rows}
    assert "refused: set/reset" in output


def test_two_axes_are_fitted_from_a_recording(recording: Path) -> None:
    code, output = invoke(str(recording), "--method", "two_axis_aided", "--json")
    report = json.loads(output)
    assert code == 0
    assert report["extended_dip_deg"] == pytest.approx(60.0, abs=0.05)
    assert report["offset"] == pytest.approx([40.0, -30.0, 0.0], abs=0.3)
    assert report["heading_error_deg"]["after"]["max"] < 0.5
    assert "extended dip 60.0" in invoke(str(recording), "--method", "two_axis_aided")[1]


def test_the_order_of_compensation_is_a_choice(recording: Path) -> None:
    code, output = invoke(str(recording), "--method", "truth_aided", "--order", "tilt_first")
    assert code == 0
    assert "order tilt_first" in output
    refused = CliRunner().invoke(app, ["fit", str(recording), "--order", "sideways"])
    assert isinstance(refused.exception, ConfigError)
    assert "order must be one of body" in str(refused.exception)


def test_a_refusal_is_one_sentence_and_exit_code_1(recording: Path) -> None:
    code, output = invoke(str(recording), "--method", "set_reset", "--json")
    assert code == 1
    report = json.loads(output)
    assert report["cause"] == "no_set_reset"
    assert report["message"].startswith("set/reset needs set and reset readings")


def test_headings_without_attitude_leave_the_tilt_to_the_force(
    recording: Path, tmp_path: Path
) -> None:
    rows = np.loadtxt(recording, delimiter=",", skiprows=1)
    path = tmp_path / "headings.csv"
    np.savetxt(
        path, rows[:, :7], delimiter=",", header=",".join(COLUMNS.split(",")[:7]), comments=""
    )
    code, output = invoke(str(path), "--method", "all", "--json")
    assert code == 0
    ranking = {entry["method"]: entry for entry in json.loads(output)["ranking"]}
    assert ranking["accelerometer"]["cause"] == "no_truth"
    assert ranking["min_max"]["tilt_from"] == "raw"
    assert ranking["two_axis_aided"]["extended_dip_deg"] == pytest.approx(60.0, abs=1.5)


def test_without_headings_the_table_shows_what_ranks_the_methods(
    recording: Path, tmp_path: Path
) -> None:
    rows = np.loadtxt(recording, delimiter=",", skiprows=1)
    path = tmp_path / "bare.csv"
    np.savetxt(path, rows[:, :3], delimiter=",", header="mx,my,mz", comments="")
    _, output = invoke(str(path))
    lines = [line.split("│")[1:-1] for line in output.splitlines() if line.startswith("│")]
    told = {line[0].strip(): line[4].strip() for line in lines if line[4].strip()}
    assert set(told) == {"ellipsoid"}
    assert 0.0 < float(told["ellipsoid"]) < 1.0
