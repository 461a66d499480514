"""The procedure of planned poses."""

from __future__ import annotations

import json

import pytest

from bench.cli.run_command import RunRequest, run_procedure


def run_quick(folder, seed, *faults):
    request = RunRequest(
        procedure="quick", serial=f"SN{seed:04d}", seed=seed, out=folder, faults=faults,
        no_input=True, dashboard=False, quiet=True,
    )  # fmt: skip
    code = run_procedure(request)
    return code, json.loads((folder / "latest" / "record.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("seed", [11, 12])
def test_a_good_unit_passes_in_nine_poses_as_well_as_was_foretold(tmp_path, seed):
    code, record = run_quick(tmp_path, seed)

    assert (code, record["verdict"]["outcome"]) == (0, "PASS"), record["verdict"]["reason"]
    values = {m["name"]: m["value"] for m in record["measurements"]}
    fit = next(fit for fit in record["fits"] if fit["method"] == "truth_aided")
    assert 0.01 < fit["predicted_heading_max_deg"] < 0.25
    assert 0.05 < values["level_max"] < 0.5
    assert 0.05 < values["tilt_max"] < 0.5
    poses = [pose for pose in record["poses"] if pose["step"] == "planned_poses"]
    assert len(poses) == 9
    steps = {step["name"]: step for step in record["steps"]}
    planned = steps["planned_poses"]
    assert planned["ended_s"] - planned["started_s"] < 25.0


@pytest.mark.parametrize(
    ("fault", "first"), [("dead_strap_x", "fit_accepted"), ("excess_noise", "noise_x")]
)
def test_a_broken_unit_is_not_written(tmp_path, fault, first):
    code, record = run_quick(tmp_path, 11, fault)

    assert (code, record["verdict"]["outcome"]) == (1, "FAIL")
    assert record["first_failure"] == first
    assert record["coefficients"] == {}


def test_an_inverted_axis_is_calibrated_away_as_no_step_judges_its_sense(tmp_path):
    """What quick gives up for its time, and its description says: eol_three_axis fails it."""
    code, record = run_quick(tmp_path, 11, "accel_sign_y")

    assert (code, record["verdict"]["outcome"]) == (0, "PASS")
    (fit,) = (fit for fit in record["fits"] if fit["method"] == "truth_aided")
    assert fit["accel_matrix"][1][1] < -0.9
