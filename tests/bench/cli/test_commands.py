"""The commands that open no bus, and what starts the others."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING

import jsonschema
import pytest
import yaml
from typer.testing import CliRunner

from bench.cli.main import app
from bench.errors import ConfigError
from bench.procedure_loader import procedure_names, procedure_path

if TYPE_CHECKING:
    from pathlib import Path

HELP_S = 0.5


def invoke(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.output


def test_help_costs_less_than_half_a_second_of_the_processor() -> None:
    code = (
        "import resource, subprocess, sys\n"
        "subprocess.run([sys.executable, '-m', 'bench.cli.main', '--help'], check=True,"
        " stdout=subprocess.DEVNULL)\n"
        "usage = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(usage.ru_utime + usage.ru_stime)\n"
    )

    best_s = min(
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)
        for _ in range(3)
    )

    assert best_s < HELP_S


@pytest.mark.parametrize("package", ["numpy", "can", "rerun", "scipy", "pyarrow", "canopen"])
def test_help_imports_nothing_heavy(package: str) -> None:
    code = f"import sys, bench.cli.main; sys.exit({package!r} in sys.modules)"

    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", procedure_names())
def test_every_shipped_procedure_can_be_planned(name: str) -> None:
    code, output = invoke("plan", name, "--json")

    plan = json.loads(output)
    assert code == 0
    assert plan["duration_s"] == pytest.approx(
        sum(s["duration_s"] for s in plan["steps"]), rel=0.05
    )
    assert plan["bus_load_worst_percent"] < 70.0


def test_a_plan_whose_tilts_are_all_blind_says_so_and_is_refused(tmp_path: Path) -> None:
    document = yaml.safe_load(procedure_path("eol_two_axis").read_text(encoding="utf-8"))
    tilts = next(step for step in document["steps"] if step["name"] == "dip_tilts")
    tilts["rings"] = [{"count": 2, "first": "0 deg", "pitch": "30 deg"}]
    path = tmp_path / "blind.yaml"
    path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")

    result = CliRunner().invoke(app, ["plan", str(path)])

    assert "dip_tilts" in result.output
    assert isinstance(result.exception, ConfigError)
    sentence = str(result.exception)
    assert sentence.startswith("step fit: poses must suffice for a judged method")
    assert "blind_azimuth" in sentence


def test_a_plan_marks_what_is_foretold_for_a_level_module_only() -> None:
    _, output = invoke("plan", "caruso_24", "--json")

    level_only = {p["method"]: p["level_only"] for p in json.loads(output)["predictions"]}
    assert level_only["four_position"]
    assert not level_only["truth_aided"]


def test_plan_of_the_main_procedure_predicts_the_method_that_is_written() -> None:
    _, output = invoke("plan", "eol_three_axis", "--json")

    predicted = {p["method"]: p for p in json.loads(output)["predictions"]}
    assert predicted["truth_aided"]["rank"] == 24
    assert predicted["truth_aided"]["predicted_heading_rms_deg"] < 0.1


def test_plan_refuses_a_bus_that_would_be_too_busy() -> None:
    code, _ = invoke("plan", "eol_three_axis", "--bitrate", "125000")

    assert code != 0


@pytest.mark.parametrize("name", procedure_names())
def test_schema_describes_every_shipped_procedure(name: str) -> None:
    code, output = invoke("schema")

    assert code == 0
    jsonschema.validate(yaml.safe_load(procedure_path(name).read_text("utf-8")), json.loads(output))


def test_faults_say_name_kind_and_what_they_break() -> None:
    code, output = invoke("faults", "--json")

    faults = json.loads(output)
    assert code == 0
    assert len(faults) >= 10
    assert all(fault["name"] and fault["kind"] and fault["breaks"] for fault in faults)


def test_doctor_finds_this_installation_fit() -> None:
    code, output = invoke("doctor", "--json")

    checks = {check["name"]: check for check in json.loads(output)}
    assert code == 0, output
    assert checks["bus"]["ok"]
    assert checks["procedures"]["ok"]


def test_doctor_says_what_to_do_where_a_needed_check_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("bench.cli.doctor._FREE_BYTES", 1 << 62)

    code, output = invoke("doctor")

    assert code == 1
    assert "FAIL disk" in output
    assert "--out" in output


def test_fit_of_a_level_turn_refuses_what_it_cannot_see(tmp_path: Path) -> None:
    import numpy as np

    angle_rad = np.deg2rad(np.arange(0.0, 360.0, 3.0))
    rows = np.stack(
        [250 * np.cos(angle_rad) + 40, -250 * np.sin(angle_rad), 0 * angle_rad + 433], 1
    )
    path = tmp_path / "turn.csv"
    np.savetxt(path, rows, delimiter=",", header="mx,my,mz", comments="")

    refused, output = invoke("fit", str(path), "--method", "ellipsoid", "--json")
    assert refused == 1
    assert json.loads(output)["cause"] is not None

    accepted, output = invoke("fit", str(path), "--method", "min_max", "--json")
    assert accepted == 0
    assert json.loads(output)["offset"][:2] == pytest.approx([40.0, 0.0], abs=0.5)
