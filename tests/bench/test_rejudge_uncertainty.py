"""The uncertainty, TUR and conformity of a recorded run come again from its folder alone."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import pytest

from bench.acceptance.heading_evaluation import evaluate_verification
from bench.acceptance.heading_uncertainty import uncertainty_section, verification_budget
from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import judge_measurement
from bench.errors import ConfigError
from bench.limit_set import load_limits
from bench.record.document import read_record
from bench.record.entries import limits_of
from bench.rejudge import rejudge, require_same
from bench.shipped import file_sha256, find_file
from bench.station import load_station

PART = {
    "repeatability": "0.3 mG", "hysteresis": "0 mG", "converter": "0.1 mG",
    "accelerometer_tempco": "2 mg/degC", "accelerometer_wander": "0.3 mg",
}  # fmt: skip
WITH_U = ("level_max", "level_rms", "tilt_max", "tilt_rms")


def quantity(value, unit):
    return f"{value} {unit}" if unit else value


def write_limits(path, limits, *, level_high=0.5, guard_factor=1.0):
    """Write limits as a file whose heading maxima are guarded by the U that is computed."""
    entries = {}
    for limit in limits.values():
        own = {"low": limit.low, "high": limit.high, "uncertainty": limit.uncertainty}
        if limit.name in WITH_U:
            own["uncertainty"] = None
        entries[limit.name] = {
            "unit": limit.unit, "missed": limit.missed.value, "description": "-", "action": "-",
            **{key: quantity(v, limit.unit) for key, v in own.items() if v is not None},
        }  # fmt: skip
    entries["level_max"].update(high=f"{level_high} deg", guard_factor=guard_factor)
    entries["tilt_max"].update(guard_factor=guard_factor)
    file = {"id": "guarded", "version": "1.0", "unit": PART, "measurements": entries}
    path.write_text(json.dumps(file), encoding="utf-8")
    return path


def with_budget(plain_run, site, station, part):
    """Return the class of a synthetic run whose verification has a budget."""

    class BudgetedRun(plain_run):
        def _headings(self, readings, samples):
            coefficients = self.unit.coefficients
            budget = verification_budget(readings, coefficients, station, part)
            found = evaluate_verification(
                "verify", readings, samples, coefficients, site, budget=budget
            )
            judged = [judge_measurement(one, self.limits) for one in found]
            section = uncertainty_section(readings, budget, judged, site)
            self.recorder.set("uncertainty", section)
            return found

    return BudgetedRun


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture
def run(make_run, site, finished, tmp_path):
    """A copy of a run with computed uncertainty and the files that it was held against."""
    if not (finished / "latest").exists():
        plain = make_run(finished).limits
        limits = load_limits(str(write_limits(finished / "limits.yaml", plain)))
        station_path = find_file("stations", "default")
        station = replace(load_station("default"), field_azimuth_deg=1.25)
        budgeted = with_budget(make_run, site, station, limits.unit)
        ran = budgeted(finished / "out", limits=dict(limits.by_name)).execute()
        (ran / "config").mkdir(exist_ok=True)
        shutil.copy(finished / "limits.yaml", ran / "config" / "limits.yaml")
        text = station_path.read_text().replace("field_azimuth: 0 deg", "field_azimuth: 1.25 deg")
        (ran / "config" / "station.yaml").write_text(text)
        edit(ran, lambda r: r["config"].update(
            limits_sha256=file_sha256(ran / "config" / "limits.yaml"),
            station_sha256=file_sha256(ran / "config" / "station.yaml"),
        ))  # fmt: skip
        (finished / "latest").symlink_to(ran)
    return shutil.copytree((finished / "latest").resolve(), tmp_path / "run")


def edit(run, change):
    record = json.loads((run / "record.json").read_text())
    change(record)
    (run / "record.json").write_text(json.dumps(record))


def entry_of(record, name):
    return next(entry for entry in record["measurements"] if entry["name"] == name)


def test_a_run_is_judged_again_with_the_same_uncertainty_tur_and_conformity(run):
    record, again = read_record(run), rejudge(run)

    require_same(again, run)
    assert again.limits_name == "guarded 1.0"
    by_name = {one.name: one for one in again.measurements}
    for name in ("level_max", "level_rms", "tilt_max"):
        entry, one = entry_of(record, name), by_name[name]
        assert entry["uncertainty"] > 0.0
        assert one.uncertainty == pytest.approx(entry["uncertainty"], rel=1e-9)
        if one.limit is not None:
            assert one.tur == pytest.approx(entry["high"] / entry["uncertainty"], rel=1e-9)
            assert one.conformity == pytest.approx(entry["conformity"], rel=1e-9)


def test_the_record_holds_the_budget_and_each_heading_with_its_uncertainty(run):
    section = read_record(run)["uncertainty"]

    assert section["rule"] == "guarded, w = 1 U"
    assert len(section["headings"]) == 48
    errors = [abs(row["error_deg"]) for row in section["headings"] if row["pitch_deg"] == 0.0]
    assert max(errors) > 0.0
    for row in section["headings"]:
        assert 0.0 < row["u_test_deg"] < row["u_deg"]
    budget = {line["name"]: line for line in section["budget"]}
    assert budget["field azimuth"]["level_deg"] == pytest.approx(0.025)
    assert {line["group"] for line in section["budget"]} == {"unit", "bench"}
    level_max = entry_of(read_record(run), "level_max")
    assert section["level"]["u_max_deg"] == level_max["uncertainty"] == level_max["guard_band"]
    assert section["level"]["tur"] == pytest.approx(0.5 / level_max["uncertainty"])
    assert section["tilt"]["conformity"] == pytest.approx(1.0, abs=1e-3)


def emptied(record):
    record["uncertainty"]["headings"].clear()


@pytest.mark.parametrize("key", ["low", "high", "uncertainty", "guard_band", "tur", "conformity"])
def test_an_edited_decision_does_not_deceive(run, key):
    edit(run, lambda r: entry_of(r, "level_max").update({key: 0.01}))

    again = rejudge(run)

    assert again.differing == [f"verify/level_max {key}"]
    with pytest.raises(ConfigError, match=f"verify/level_max {key} differ"):
        require_same(again, run)


def test_a_limit_that_the_value_meets_by_less_than_its_uncertainty_is_marginal(run, tmp_path):
    value = entry_of(read_record(run), "level_max")["value"]
    limits = limits_of(read_record(run))

    near = rejudge(run, write_limits(tmp_path / "near.yaml", limits, level_high=value + 0.03))
    free = rejudge(run, write_limits(
        tmp_path / "free.yaml", limits, level_high=value + 0.03, guard_factor=0.0
    ))  # fmt: skip

    assert (near.verdict.outcome, free.verdict.outcome) == (Outcome.MARGINAL, Outcome.PASS)
    assert "level_max" in near.verdict.reason
    assert "guard band w = 0.077 deg" in near.verdict.reason
    assert "U = 0.077 deg" in near.verdict.reason
    one = next(m for m in near.measurements if m.name == "level_max")
    assert 0.1 < one.conformity < 0.95


def test_limits_that_ask_for_a_computed_uncertainty_need_the_runs_own_station_file(run):
    (run / "config" / "station.yaml").write_text("name: another\n")

    with pytest.raises(ConfigError, match="run's own station file, unchanged"):
        rejudge(run)


@pytest.mark.parametrize(
    ("place", "change"),
    [
        ("uncertainty.headings.3.u_deg", lambda u: u["headings"][3].update(u_deg=0.01)),
        ("uncertainty.budget.2.level_deg", lambda u: u["budget"][2].update(level_deg=0.0)),
        ("uncertainty.level.conformity", lambda u: u["level"].update(conformity=0.5)),
        ("uncertainty.budget.2.group", lambda u: u["budget"][2].update(group="bench")),
        ("uncertainty.rule", lambda u: u.update(rule="simple acceptance, w = 0")),
        ("uncertainty.budget", lambda u: u["budget"].pop()),
        ("uncertainty.headings", lambda u: u["headings"].pop()),
    ],
)
def test_an_edited_budget_does_not_deceive(run, place, change):
    edit(run, lambda r: change(r["uncertainty"]))

    assert rejudge(run).differing == [place]


def test_an_edited_outcome_does_not_deceive(run):
    edit(run, lambda r: entry_of(r, "level_max").update(outcome="FAIL"))

    assert rejudge(run).differing == ["verify/level_max outcome"]


@pytest.mark.parametrize("change", [lambda r: r.pop("uncertainty"), emptied])
def test_a_budget_that_was_taken_away_does_not_deceive(run, change):
    edit(run, change)

    assert rejudge(run).differing == ["uncertainty"]
