"""The procedure that goes on until its claim is small enough, over CAN."""

from __future__ import annotations

import json

from bench.cli.run_command import RunRequest, run_procedure
from bench.rejudge import rejudge
from devices import unit


def run_adaptive(folder, seed):
    request = RunRequest(
        procedure="adaptive", serial=f"SN{seed:04d}", seed=seed, out=folder,
        no_input=True, dashboard=False, quiet=True,
    )  # fmt: skip
    code = run_procedure(request)
    return code, json.loads((folder / "latest" / "record.json").read_text(encoding="utf-8"))


def test_a_good_unit_stops_early_keeps_what_was_claimed_and_is_judged_again_alike(tmp_path):
    code, record = run_adaptive(tmp_path, 14)

    assert (code, record["verdict"]["outcome"]) == (0, "PASS"), record["verdict"]["reason"]
    adaptive = record["adaptive"]
    poses = [pose for pose in record["poses"] if pose["step"] == "adaptive_poses"]
    claims = [claim["largest_deg"] for claim in adaptive["claims"]]
    assert adaptive["ended"] == "wanted_reached"
    assert 8 <= len(poses) == adaptive["claims"][-1]["poses"] < 20
    assert claims[-1] <= adaptive["wanted_deg"] == 0.2
    assert all(claim > 0.2 for claim in claims[:-1])
    events = (tmp_path / "latest" / "events.ndjson").read_text(encoding="utf-8").splitlines()
    told = [json.loads(line) for line in events]
    assert [one["largest_deg"] for one in told if one["event"] == "claimed"] == claims
    again = rejudge(tmp_path / "latest")
    assert again.differing == []
    assert again.verdict.outcome == "PASS"


def test_a_unit_whose_readings_do_not_repeat_goes_to_the_most_poses_and_fails(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(unit, "_REPEATABILITY_MG", 0.65)

    code, record = run_adaptive(tmp_path, 14)

    assert (code, record["verdict"]["outcome"]) == (1, "FAIL")
    assert record["first_failure"] == "predicted_uncertainty"
    assert record["adaptive"]["ended"] == "most_poses"
    assert record["adaptive"]["claims"][-1]["poses"] == 20
    assert record["adaptive"]["claims"][-1]["sigma"] > 1.3
    assert record["coefficients"] == {}
