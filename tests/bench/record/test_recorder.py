"""The record exists from the first second, holds everything, and never hides a hole."""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace

import numpy as np
import pytest

from bench.acceptance.measurement import Limit, Measurement
from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import verdict_of
from bench.calibration.fit import Fit
from bench.errors import ConfigError
from bench.pose import Attitude, Pose
from bench.record.document import read_record
from bench.record.events import read_events
from bench.record.recorder import RunRecorder
from protocols.clock import SimulatedClock

LIMIT = Limit(name="level_max", unit="deg", high=0.5, uncertainty=0.08, guard_band=0.02)
GOOD = Measurement(name="level_max", value=0.2, step="verify", unit="deg").judged(LIMIT)
PASSED = verdict_of([GOOD])


@pytest.fixture
def clock():
    return SimulatedClock(5_000_000_000)


@pytest.fixture
def make_recorder(tmp_path, clock, wall_clock):
    made = []

    def make(**options):
        made.append(
            RunRecorder(
                tmp_path / "runs", "SN0001", "eol", clock=clock, wall_clock=wall_clock, **options
            )
        )
        return made[-1]

    yield make
    for recorder in made:
        recorder.close(PASSED)


class KeptEvents:
    """A sink that keeps events, or fails at the one of a kind."""

    def __init__(self, fails_at=None, fails_to_close=False):
        self.events, self.closed = [], False
        self._fails_at, self._fails_to_close = fails_at, fails_to_close

    def on_event(self, event):
        if event["event"] == self._fails_at:
            message = "no space left"
            raise OSError(message)
        self.events.append(event)

    def close(self):
        self.closed = True
        if self._fails_to_close:
            message = "connection lost"
            raise RuntimeError(message)


def test_a_valid_record_exists_before_anything_has_happened(make_recorder):
    recorder = make_recorder()

    record = read_record(recorder.folder)

    assert recorder.folder.name == "101500-eol.part"
    assert record["run"]["status"] == "running"
    assert record["verdict"] is None
    assert read_events(recorder.path("events.ndjson"))[0]["event"] == "run_started"


def test_every_event_is_on_disk_when_the_call_returns(make_recorder, clock):
    recorder = make_recorder()
    clock.advance(250_000_000)

    recorder.event("note", text="hello", value=float("nan"), array=np.arange(2))

    last = read_events(recorder.path("events.ndjson"))[-1]
    assert (last["seq"], last["t_s"], last["text"]) == (1, 0.25, "hello")
    assert last["value"] is None
    assert last["array"] == [0, 1]


def test_a_closed_run_has_its_final_name_and_latest_points_to_it(make_recorder, tmp_path):
    recorder = make_recorder(seed=3)
    recorder.measurement(GOOD)

    folder = recorder.close(PASSED)

    assert folder == tmp_path / "runs" / "2026-11-22" / "SN0001" / "101500-eol"
    assert (tmp_path / "runs" / "latest").resolve() == folder
    assert {p.name for p in folder.iterdir()} == {
        "record.json", "events.ndjson", "junit.xml", "report.html", "config"
    }  # fmt: skip
    assert not list(folder.parent.glob("*.part"))
    assert recorder.verdict == PASSED
    assert recorder.path("x").parent == folder


def test_the_document_holds_what_was_recorded(make_recorder, clock):
    recorder = make_recorder(seed=3, procedure_version="1.2")
    recorder.set("bus", {"interface": "lockstep"})
    recorder.set("bus", {"frames": 10})
    recorder.set("injected_faults", ["dead_strap_x"])
    recorder.step_started("verify", "verify")
    pose = Pose(position=4, step="verify", attitude=Attitude(azimuth_deg=15.0), direction=1)
    recorder.pose(pose)
    recorder.measurement(GOOD)
    clock.advance(2_000_000_000)
    recorder.step_ended("verify", Outcome.PASS, "done")
    recorder.fit(Fit(method="m", offset_mg=np.zeros(3), matrix=np.eye(3), samples=9))
    recorder.fit(Fit(method="m", offset_mg=np.ones(3), matrix=np.eye(3)), {"level_max_deg": 0.1})

    record = read_record(recorder.close(PASSED))

    assert record["run"]["id"] == "eol-SN0001-seed3"
    assert record["run"]["simulated_s"] == 2.0
    assert (record["run"]["status"], record["verdict"]["outcome"]) == ("complete", "PASS")
    assert record["bus"] == {"interface": "lockstep", "frames": 10}
    assert record["injected_faults"] == ["dead_strap_x"]
    assert record["poses"][0]["direction"] == 1
    assert record["steps"] == [
        {
            "name": "verify", "kind": "verify", "started_s": 0.0, "attempt": 1, "ended_s": 2.0,
            "outcome": "PASS", "message": "done",
        }
    ]  # fmt: skip
    assert record["measurements"][0]["uncertainty"] == 0.08
    assert [fit["offset_mg"] for fit in record["fits"]] == [[1.0, 1.0, 1.0]]
    assert record["fits"][0]["achieved"]["level_max_deg"] == 0.1


def test_every_attempt_stays_and_poses_know_theirs(make_recorder):
    recorder = make_recorder()
    for attempt, value in ((1, 0.9), (2, 0.2)):
        recorder.step_started("verify", "verify", attempt)
        attitude = Attitude(azimuth_deg=0.0)
        recorder.pose(Pose(position=attempt, step="verify", attitude=attitude))
        recorder.measurement(replace(GOOD, value=value, attempt=attempt).judged(LIMIT))
        recorder.step_ended("verify", Outcome.FAIL if attempt == 1 else Outcome.PASS)

    record = read_record(recorder.close(PASSED))

    assert [m["outcome"] for m in record["measurements"]] == ["FAIL", "PASS"]
    assert [pose["attempt"] for pose in record["poses"]] == [1, 2]
    assert [step["outcome"] for step in record["steps"]] == ["FAIL", "PASS"]


def test_two_runs_differ_only_in_wall_clock_fields(tmp_path, wall_clock):
    records, events = [], []
    for out in ("a", "b"):
        recorder = RunRecorder(
            tmp_path / out, "S", "eol", clock=SimulatedClock(), wall_clock=wall_clock, seed=1
        )
        recorder.measurement(GOOD)
        folder = recorder.close(PASSED)
        records.append((folder / "record.json").read_text())
        events.append((folder / "events.ndjson").read_text())

    def without_wall_clock(text):
        return re.sub(r'"(\w+_utc|wall_\w+)": ?("[^"]*"|[\d.e-]+)', "", text)

    assert records[0] != records[1]
    assert without_wall_clock(records[0]) == without_wall_clock(records[1])
    assert without_wall_clock(events[0]) == without_wall_clock(events[1])


def test_an_output_folder_that_is_a_file_is_one_sentence(tmp_path, clock):
    (tmp_path / "runs").write_text("in the way")

    with pytest.raises(ConfigError, match=r"output folder .*runs must be writable; instead"):
        RunRecorder(tmp_path / "runs", "S", "eol", clock=clock)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_an_output_folder_without_permission_is_one_sentence(tmp_path, clock):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(ConfigError, match="choose another with --out"):
            RunRecorder(tmp_path / "runs", "S", "eol", clock=clock)
    finally:
        tmp_path.chmod(0o700)


def test_a_failing_sink_makes_an_error_of_a_pass_and_the_others_go_on(make_recorder):
    bad, good = KeptEvents(fails_at="measurement"), KeptEvents()
    recorder = make_recorder(sinks=(bad, good))
    recorder.measurement(GOOD)
    recorder.event("later")

    record = read_record(recorder.close(PASSED))

    assert recorder.verdict.outcome is Outcome.ERROR
    assert record["verdict"]["outcome"] == "ERROR"
    assert "KeptEvents failed" in record["verdict"]["reason"]
    assert [e["event"] for e in bad.events] == ["run_started"]
    assert "later" in [e["event"] for e in good.events]
    assert good.closed


def test_a_sink_that_cannot_close_makes_an_error(make_recorder):
    recorder = make_recorder(sinks=(KeptEvents(fails_to_close=True),))

    recorder.close(PASSED)

    assert recorder.verdict.outcome is Outcome.ERROR
    assert "connection lost" in recorder.verdict.reason


def test_a_fault_that_was_told_makes_an_error(make_recorder):
    recorder = make_recorder()
    recorder.fault("bus.blf could not be written: disk full")

    recorder.close(PASSED)

    assert recorder.verdict.reason == "bus.blf could not be written: disk full"


def test_a_product_that_cannot_be_made_leaves_an_error_and_all_other_files(make_recorder):
    def broken(path, record):
        message = "viewer is missing"
        raise RuntimeError(message)

    recorder = make_recorder(products={"run.rrd": broken})

    folder = recorder.close(PASSED)

    assert recorder.verdict.outcome is Outcome.ERROR
    assert read_record(folder)["verdict"]["reason"].endswith("viewer is missing")
    assert "ERROR" in (folder / "report.html").read_text()
    assert 'type="ERROR"' in (folder / "junit.xml").read_text()


def test_a_section_that_does_not_fit_the_schema_makes_an_error_and_is_kept(make_recorder):
    recorder = make_recorder()
    recorder.set("bus", {"frames": "many"})

    folder = recorder.close(PASSED)

    assert recorder.verdict.outcome is Outcome.ERROR
    assert "bus.frames" in recorder.verdict.reason
    assert json.loads((folder / "record.json").read_text())["bus"]["frames"] == "many"


@pytest.mark.parametrize(
    ("section", "value"), [("nonsense", {}), ("bus", [1]), ("ranking", {"a": 1}), ("schema", {})]
)
def test_unknown_sections_are_refused(make_recorder, section, value):
    with pytest.raises(ValueError, match=f"no section '{section}'"):
        make_recorder().set(section, value)


def test_a_step_that_is_not_open_cannot_end(make_recorder):
    with pytest.raises(ValueError, match="noise was ended but is not open"):
        make_recorder().step_ended("noise", Outcome.PASS)


def test_a_second_close_changes_nothing(make_recorder):
    recorder = make_recorder()
    folder = recorder.close(PASSED)
    before = (folder / "record.json").read_text()

    assert recorder.close(verdict_of([], error="late")) == folder
    assert (folder / "record.json").read_text() == before


def test_aborted_and_failed_runs_say_so_in_their_status(make_recorder):
    aborted = make_recorder()
    error = make_recorder()

    assert read_record(aborted.close(verdict_of([], aborted="by signal 2")))["run"]["status"] == (
        "aborted"
    )
    assert read_record(error.close(verdict_of([], error="silent")))["run"]["status"] == "error"


def test_a_value_that_is_not_a_number_is_null_and_an_error(make_recorder):
    recorder = make_recorder()
    row = replace(GOOD, value=float("nan")).judged(LIMIT)
    recorder.measurement(row)

    record = read_record(recorder.close(verdict_of([row])))

    assert record["measurements"][0]["value"] is None
    assert record["verdict"]["outcome"] == "ERROR"
