"""record.json keeps its schema; JSON never holds NaN."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from bench.acceptance.measurement import Limit, Measurement
from bench.acceptance.outcome import Outcome
from bench.errors import ConfigError
from bench.pose import Attitude, Pose
from bench.record.document import read_record, record_json_schema, validate_record
from bench.record.entries import (
    coefficients_of,
    fit_entry,
    limits_of,
    measurement_entry,
    measurement_of,
    pose_entry,
    pose_of,
)
from bench.record.events import read_events
from bench.record.plain import plain
from protocols.uds import DEFAULT_COEFFICIENTS


@pytest.fixture
def record(make_run, tmp_path):
    return read_record(make_run(tmp_path).execute())


def test_a_whole_run_fits_the_json_schema(record):
    schema = record_json_schema()

    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(record, schema)
    assert set(record) == {
        "schema", "run", "software", "config", "bus", "station", "module", "rig", "poses", "steps",
        "measurements", "fits", "ranking", "coefficients", "deviation", "first_failure", "verdict",
        "injected_faults", "files", "study", "bridge_terms", "uncertainty", "field_watch",
        "adaptive", "reversal",
    }  # fmt: skip
    assert len(record["fits"]) == len(record["ranking"]) >= 3
    assert record["ranking"][0] == "truth_aided"


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (lambda r: r.update(extra=1), "extra"),
        (lambda r: r.pop("poses"), "poses"),
        (lambda r: r.update(schema="compass-bench/record/2"), "schema"),
        (lambda r: r["run"].update(status="finished"), "run.status"),
        (lambda r: r["measurements"][0].update(outcome="GOOD"), "measurements.0.outcome"),
        (lambda r: r["measurements"][0].update(value=float("nan")), "measurements.0.value"),
        (lambda r: r["fits"][0].update(offset_mg=[1.0, 2.0]), "fits.0.offset_mg"),
        (lambda r: r["fits"][0].update(offset_mg=None), "fits.0: .*must have offset_mg"),
        (lambda r: r["fits"][0].update(extended_dip_deg="60"), "fits.0.extended_dip_deg"),
        (lambda r: r["fits"][0].update(extended_dip_deg=90.0), "fits.0.*: .*less than 90"),
        (lambda r: r["fits"][0].update(extended_dip_deg=60.0, extra={}), "fits.0: .*horizontal_mg"),
    ],
)
def test_what_does_not_fit_is_named(record, change, where):
    change(record)

    with pytest.raises(ConfigError, match=rf"instead {where}"):
        validate_record(record)


def test_a_file_that_is_no_json_is_one_sentence(tmp_path):
    (tmp_path / "record.json").write_text("{")

    with pytest.raises(ConfigError, match="must be a readable JSON document"):
        read_record(tmp_path)


def test_measurements_come_back_as_they_went():
    limit = Limit(
        name="dip_difference", unit="deg", high=0.1, uncertainty=0.03, guard_band=0.01,
        missed=Outcome.ERROR, description="d", action="a",
    )  # fmt: skip
    row = Measurement(name="dip_difference", value=0.3, step="fit", unit="deg", attempt=2, note="n")
    judged = row.judged(limit)

    entry = json.loads(json.dumps(measurement_entry(judged), allow_nan=False))

    assert measurement_of(entry) == judged
    assert limits_of({"measurements": [entry]}) == {"dip_difference": limit}
    informs = row.judged(None)
    assert measurement_of(measurement_entry(informs)) == informs


def test_poses_and_coefficients_come_back_as_they_went():
    attitude = Attitude(azimuth_deg=15.0, pitch_deg=-30.0, roll_deg=1.5)
    pose = Pose(position=3, step="sweep", attitude=attitude, direction=-1)

    assert pose_of(pose_entry(pose)) == pose
    assert coefficients_of(plain(DEFAULT_COEFFICIENTS)) == DEFAULT_COEFFICIENTS
    nested = {**plain(DEFAULT_COEFFICIENTS), "mag_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
    assert coefficients_of(nested).mag_matrix == (1, 0, 0, 0, 1, 0, 0, 0, 1)


def test_records_of_two_axes_keep_the_dip_and_older_ones_have_none():
    written = replace(DEFAULT_COEFFICIENTS, extended_dip_deg=60.0, horizontal_mg=250.0)
    entry = plain(written)
    older = {
        key: value
        for key, value in entry.items()
        if key not in ("extended_dip_deg", "horizontal_mg")
    }

    assert coefficients_of(entry) == written
    assert coefficients_of(older) == DEFAULT_COEFFICIENTS


def test_records_keep_the_anisotropy_fields_and_older_ones_have_none():
    written = replace(DEFAULT_COEFFICIENTS, hk_mg=(8000.0, 0.0, 7900.0))
    entry = plain(written)
    older = {key: value for key, value in entry.items() if key != "hk_mg"}

    assert coefficients_of(entry) == written
    assert coefficients_of(older) == DEFAULT_COEFFICIENTS


def test_a_fit_that_knows_the_cross_axis_term_comes_back_with_it():
    from bench.calibration.fit import Fit
    from bench.record.recorded_fits import fit_of

    raw_mg = np.array([[300.0, -350.0, 433.0]])
    fit = Fit(
        method="m", offset_mg=np.ones(3), matrix=np.eye(3), hk_mg=np.array([8000.0, 0.0, 7900.0])
    )
    entry = json.loads(json.dumps(fit_entry(fit)))

    assert (fit_of(entry).corrected_mg(raw_mg) == fit.corrected_mg(raw_mg)).all()
    assert fit_of({**entry, "hk_mg": None}).hk_mg is None
    del entry["hk_mg"]
    assert fit_of(entry).hk_mg is None, "records of before the cross-axis term"


def test_a_fit_entry_has_no_nan(site):
    from bench.calibration.fit import Fit

    fit = Fit(method="m", covariance=np.array([[np.nan, 1.0]]), extra={"dip_deg": float("inf")})

    entry = fit_entry(fit, {"level_rms_deg": float("nan")})

    assert entry["covariance"] == [[None, 1.0]]
    assert entry["extra"] == {"dip_deg": None}
    assert entry["achieved"]["level_rms_deg"] is None
    json.dumps(entry, allow_nan=False)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (np.float32(0.5), 0.5),
        (np.int16(3), 3),
        (np.bool_(True), True),
        (Outcome.PASS, "PASS"),
        (b"\x01\xff", "01ff"),
        (Path("a/b"), "a/b"),
        ({3, 1, 2}, [1, 2, 3]),
        ((1, None), [1, None]),
        (-float("inf"), None),
    ],
)
def test_values_become_plain(value, expected):
    assert plain(value) == expected
    assert type(plain(value)) is type(expected)


def test_other_kinds_are_refused():
    with pytest.raises(TypeError, match="a record holds numbers"):
        plain(object())


def test_a_line_that_a_crash_cut_off_is_left_out(tmp_path):
    path = tmp_path / "events.ndjson"
    path.write_text('{"event":"a"}\n{"event":"b"}\n{"eve')

    assert [event["event"] for event in read_events(path)] == ["a", "b"]


def test_a_record_of_before_the_study_is_still_one(record):
    del record["study"]
    for entry in record["fits"]:
        del entry["extended_dip_deg"]

    validate_record(record)


@pytest.mark.parametrize("hk_mg", [[8000.0], "abc", [8000.0, float("nan"), 0.0], [1.0] * 4, None])
def test_coefficients_that_are_no_whole_set_are_refused(hk_mg):
    entry = plain(DEFAULT_COEFFICIENTS) | {"hk_mg": hk_mg}

    with pytest.raises(ConfigError, match="coefficients of the record must be a whole set"):
        coefficients_of(entry)
