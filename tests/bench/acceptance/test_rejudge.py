"""A run judged from its samples gives the run's numbers, or those of other limits."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from bench.acceptance.outcome import Outcome
from bench.acceptance.rejudge import rejudge, require_same
from bench.errors import ConfigError
from bench.sample_file import SampleFile, read_samples


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture
def good_run(make_run, finished, tmp_path):
    """A copy of one good run, so that a test may change it."""
    if not (finished / "latest").exists():
        make_run(finished).execute()
    return shutil.copytree((finished / "latest").resolve(), tmp_path / "run")


def limits_file(path, level_high):
    path.write_text(
        f"""id: tight
version: "2.0"
measurements:
  level_max:
    unit: deg
    high: {level_high} deg
    description: "Largest level heading error."
    action: "Red bin."
""",
        encoding="utf-8",
    )
    return path


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
    again = rejudge(good_run, limits_file(tmp_path / "tight.yaml", 0.01))

    assert again.verdict.outcome is Outcome.FAIL
    assert again.verdict.first_failure == "level_max"
    assert again.recorded is Outcome.PASS
    assert again.limits_name == "tight 2.0"


def test_a_failing_run_passes_by_wider_limits(make_run, tmp_path):
    run = make_run(tmp_path / "runs", move_hard_iron_mg=3.0).execute()

    assert rejudge(run).verdict.first_failure == "level_max"
    assert rejudge(run, limits_file(tmp_path / "wide.yaml", 2.0)).verdict.outcome is Outcome.PASS


def test_the_copy_of_the_limits_in_the_run_is_used_when_its_hash_is_the_recorded_one(good_run):
    from bench.shipped import file_sha256

    copy = limits_file(good_run / "config" / "limits.yaml", 0.001)
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
