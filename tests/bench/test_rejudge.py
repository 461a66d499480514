"""A run judged from its samples gives the run's numbers, or those of other limits."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from bench.acceptance.outcome import Outcome
from bench.errors import ConfigError
from bench.procedure_loader import procedure_path
from bench.record.entries import limits_of
from bench.rejudge import rejudge, require_same
from bench.sample_file import SampleFile, read_samples
from bench.shipped import file_sha256


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture
def good_run(make_run, finished, tmp_path):
    """A copy of one good run, so that a test may change it."""
    if not (finished / "latest").exists():
        make_run(finished).execute()
    return shutil.copytree((finished / "latest").resolve(), tmp_path / "run")


def limits_file(path, run, level_high):
    """Write the limits of a run into a file, with another one for the level maximum."""
    entries = {}
    for limit in limits_of(json.loads((run / "record.json").read_text())).values():
        keys = {"low": limit.low, "high": limit.high, "guard_band": limit.guard_band}
        entries[limit.name] = {
            "unit": limit.unit, "missed": limit.missed.value, "description": "-", "action": "-",
            **{key: quantity(v, limit.unit) for key, v in keys.items() if v is not None},
        }  # fmt: skip
    entries["level_max"].update(high=f"{level_high} deg", guard_band="0 deg")
    path.write_text(json.dumps({"id": "tight", "version": "2.0", "measurements": entries}))
    return path


def quantity(value, unit):
    return f"{value} {unit}" if unit else value


def edit_record(run, change):
    path = run / "record.json"
    record = json.loads(path.read_text())
    change(record)
    path.write_text(json.dumps(record))


def test_the_samples_give_the_numbers_and_the_verdict_of_the_run(good_run):
    again = rejudge(good_run)

    recorded = json.loads((good_run / "record.json").read_text())
    assert again.differing == []
    assert again.verdict.outcome is again.recorded is Outcome.PASS
    assert [m.value for m in again.measurements] == [m["value"] for m in recorded["measurements"]]
    require_same(again, good_run)


def test_tighter_limits_fail_the_same_samples(good_run, tmp_path):
    again = rejudge(good_run, limits_file(tmp_path / "tight.yaml", good_run, 0.01))

    assert again.verdict.outcome is Outcome.FAIL
    assert again.verdict.first_failure == "level_max"
    assert again.recorded is Outcome.PASS
    assert again.limits_name == "tight 2.0"


def test_a_failing_run_passes_by_wider_limits(make_run, tmp_path):
    run = make_run(tmp_path / "runs", move_hard_iron_mg=3.0).execute()

    assert rejudge(run).verdict.first_failure == "level_max"
    wide = limits_file(tmp_path / "wide.yaml", run, 2.0)
    assert rejudge(run, wide).verdict.outcome is Outcome.PASS


def test_the_copy_of_the_limits_in_the_run_is_used_when_its_hash_is_the_recorded_one(good_run):
    copy = limits_file(good_run / "config" / "limits.yaml", good_run, 0.001)
    edit_record(good_run, lambda r: r["config"].update(limits_sha256=file_sha256(copy)))

    assert rejudge(good_run).limits_name == "tight 2.0"
    assert rejudge(good_run).verdict.outcome is Outcome.FAIL


def test_an_edited_value_in_the_record_does_not_deceive(good_run):
    def flatter(record):
        entry = next(m for m in record["measurements"] if m["name"] == "level_max")
        entry["value"] = 0.001

    edit_record(good_run, flatter)
    again = rejudge(good_run)

    assert again.differing == ["verify/level_max"]
    with pytest.raises(ConfigError, match="verify/level_max differ"):
        require_same(again, good_run)


def test_edited_samples_are_judged_as_they_are(good_run):
    samples = read_samples(good_run / "samples.parquet")
    verified = (
        samples["position"]
        == json.loads((good_run / "record.json").read_text())["poses"][100]["position"]
    )
    samples["heading_deg"][verified] = np.mod(samples["heading_deg"][verified] + 5.0, 360.0)
    (good_run / "samples.parquet").unlink()
    file = SampleFile(good_run / "samples.parquet", {})
    file.write(samples)
    file.close()

    again = rejudge(good_run)

    assert again.verdict.outcome is Outcome.FAIL
    assert again.verdict.first_failure == "level_max"


def test_what_no_sample_tells_is_taken_from_the_record(good_run):
    def lose(record):
        entry = next(m for m in record["measurements"] if m["name"] == "read_back")
        entry["value"] = 0.0

    edit_record(good_run, lose)

    assert rejudge(good_run).verdict.first_failure == "read_back"


@pytest.mark.parametrize("outcome", ["ABORTED", "ERROR"])
def test_a_run_that_ended_early_stays_so(good_run, outcome):
    edit_record(good_run, lambda r: r["verdict"].update(outcome=outcome, reason="it was ended"))

    again = rejudge(good_run)

    assert again.verdict.outcome == outcome
    assert again.verdict.reason == "it was ended"


def test_a_run_that_never_ended_is_an_error(good_run):
    edit_record(good_run, lambda r: r.update(verdict=None))

    assert rejudge(good_run).verdict.outcome is Outcome.ERROR


@pytest.mark.parametrize(
    ("name", "sentence"),
    [("record.json", "must be the folder of a run"), ("samples.parquet", "must hold samples")],
)
def test_a_folder_that_lacks_a_file_says_which(good_run, name, sentence):
    (good_run / name).unlink()

    with pytest.raises(ConfigError, match=sentence):
        rejudge(good_run)


def test_a_measurement_that_the_samples_do_not_give_is_an_error(good_run):
    samples = read_samples(good_run / "samples.parquet")
    samples["position"][samples["position"] == 16] = -1  # the noise dwell
    (good_run / "samples.parquet").unlink()
    file = SampleFile(good_run / "samples.parquet", {})
    file.write(samples)
    file.close()

    again = rejudge(good_run)

    assert again.verdict.outcome is Outcome.ERROR
    assert again.verdict.first_failure == "noise_x"
    assert replace(again.verdict, rule="").reason.startswith("noise_x could not be measured")


def test_limits_that_leave_out_what_the_run_was_held_against_do_not_judge(good_run, tmp_path):
    path = limits_file(tmp_path / "less.yaml", good_run, 0.5)
    document = json.loads(path.read_text())
    del document["measurements"]["tilt_max"]
    path.write_text(json.dumps(document))

    with pytest.raises(ConfigError, match="limits tight 2.0 lack tilt_max"):
        rejudge(good_run, path)


def test_a_run_that_stopped_early_does_not_pass_by_wider_limits(make_run, tmp_path):
    run = make_run(tmp_path / "runs", move_hard_iron_mg=3.0).execute()
    copy = run / "config" / "procedure.yaml"
    shutil.copy(procedure_path("eol_three_axis"), copy)
    edit_record(run, lambda r: r["config"].update(procedure_sha256=file_sha256(copy)))
    wide = limits_file(tmp_path / "wide.yaml", run, 2.0)

    again = rejudge(run, wide)

    assert again.verdict.outcome is Outcome.ERROR
    assert "the run stopped before step" in again.verdict.reason


def test_an_error_of_the_bench_stays_one_beside_a_measurement_that_was_an_error(good_run, tmp_path):
    def break_off(record):
        entry = next(m for m in record["measurements"] if m["name"] == "bus_load")
        entry.update(value=90.0, outcome="ERROR")
        record["verdict"].update(outcome="ERROR", reason="azimuth axis is in fault")

    edit_record(good_run, break_off)
    path = limits_file(tmp_path / "wide.yaml", good_run, 0.5)
    path.write_text(path.read_text().replace('"70.0 %"', '"95.0 %"'))

    again = rejudge(good_run, path)

    assert again.verdict.outcome is Outcome.ERROR
    assert again.verdict.reason == "azimuth axis is in fault"


@pytest.mark.parametrize("written", ["none", {"version": 1}])
def test_coefficients_that_are_no_whole_set_are_refused(good_run, written):
    edit_record(good_run, lambda r: r["coefficients"].update(written=written))

    with pytest.raises(ConfigError, match="coefficients of the record must be a whole set"):
        rejudge(good_run)
