"""The procedures on the rig, each on good units and on one that is broken in its way."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from bench.acceptance.outcome import Outcome
from bench.calibration.methods import METHODS
from bench.cli.run_command import RunRequest, run_procedure
from bench.errors import ConfigError
from bench.procedure_loader import load_procedure, procedure_path
from bench.rejudge import rejudge

if TYPE_CHECKING:
    from pathlib import Path

LEVEL = ("four_position", "soft_iron", "three_headings", "min_max")
CALIBRATING = ("caruso_24", "eol_two_axis", "eol_three_axis")
SEEDS = (11, 12)
OF_THE_DAY = ("_utc", "wall_")


@dataclass(frozen=True, kw_only=True)
class Finished:
    """A run's exit code, folder and record."""

    exit_code: int
    folder: Path
    record: dict[str, Any]

    def value(self, name: str) -> float:
        return next(m["value"] for m in self.record["measurements"] if m["name"] == name)

    def fit(self, method: str) -> dict[str, Any]:
        return next(fit for fit in self.record["fits"] if fit["method"] == method)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Return what runs a procedure by the command's own function; the same run only once."""
    out = tmp_path_factory.mktemp("papers")
    runs: dict[tuple[Any, ...], Finished] = {}

    def run(procedure: str, *faults: str, seed: int = SEEDS[0], again: int = 0) -> Finished:
        key = (procedure, faults, seed, again)
        if key not in runs:
            folder = out / str(len(runs))
            request = RunRequest(
                procedure=procedure, serial=f"SN{seed:04d}", seed=seed, out=folder, faults=faults,
                no_input=True, dashboard=False, quiet=True,
            )  # fmt: skip
            code = run_procedure(request)
            folder = (folder / "latest").resolve()
            record = json.loads((folder / "record.json").read_text(encoding="utf-8"))
            runs[key] = Finished(exit_code=code, folder=folder, record=record)
        return runs[key]

    return run


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """Return what writes a shipped procedure with some of its steps changed, and gives its path."""
    out = tmp_path_factory.mktemp("changed")

    def write(
        name: str,
        limits: str | None = None,
        more: tuple[dict[str, Any], ...] = (),
        **steps: dict[str, Any],
    ) -> str:
        document = yaml.safe_load(procedure_path(name).read_text(encoding="utf-8"))
        for step in document["steps"]:
            step.update(steps.get(step["name"], {}))
        document["steps"] += more
        document["limits"] = limits or document["limits"]
        path = out / f"{name}_{len(list(out.iterdir()))}.yaml"
        path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
        return str(path)

    return write


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", [*LEVEL, "set_reset", *CALIBRATING])
def test_a_good_unit_passes_and_its_samples_give_every_number_again(finished, name, seed):
    run = finished(name, seed=seed)

    verdict = run.record["verdict"]
    assert (run.exit_code, verdict["outcome"]) == (0, "PASS"), verdict["reason"]
    again = rejudge(run.folder)
    assert again.verdict.outcome is Outcome.PASS
    assert again.differing == []
    procedure = load_procedure(name)
    assert verdict["next_action"] == (procedure.on_pass or "Release the unit.")
    assert run.record["module"]["part"] == procedure.part or procedure.part is None


@pytest.mark.parametrize("name", LEVEL)
def test_a_level_procedure_writes_nothing_and_judges_what_the_bench_computes(finished, name):
    run = finished(name)

    judged = load_procedure(name).steps[-3].judged[0]
    assert run.record["coefficients"] == {}
    assert "level_max" not in {m["name"] for m in run.record["measurements"]}
    assert run.value("achieved_level_max") == run.fit(judged)["achieved"]["level_max_deg"]
    assert run.record["study"]["tilt_from"][judged] == "given"
    assert run.record["study"]["raw"]["level_max_deg"] > 5.0 * run.value("achieved_level_max")


@pytest.mark.parametrize(
    ("name", "fault", "first"),
    [
        ("four_position", "inverted_axis_y", "achieved_level_max"),
        ("soft_iron", "dead_strap_x", "fit_accepted"),
        ("three_headings", "swapped_axes", "fit_accepted"),
        ("min_max", "excess_noise", "noise_x"),
        ("caruso_24", "lost_write", "read_back"),
        ("eol_two_axis", "dead_strap_x", "set_reset_amplitude_x"),
        ("eol_two_axis", "accel_sign_y", "accel_sense_y"),
    ],
)
def test_a_broken_unit_fails_by_what_shows_it_first_and_again_from_its_samples(
    finished, name, fault, first
):
    run = finished(name, fault)

    assert (run.exit_code, run.record["first_failure"]) == (1, first)
    again = rejudge(run.folder)
    assert (again.verdict.first_failure, again.differing) == (first, [])


@pytest.mark.parametrize("name", CALIBRATING)
def test_all_methods_are_studied_on_the_verification_poses_and_the_best_is_written(finished, name):
    record = finished(name).record
    study, ranking = record["study"], record["ranking"]

    assert ranking[0] == ("two_axis_aided" if name == "eol_two_axis" else "truth_aided")
    accepted = {fit["method"] for fit in record["fits"] if fit["cause"] is None}
    assert set(ranking) == {fit["method"] for fit in record["fits"]}
    assert set(study["orders"]) == set(study["tilt_from"]) == accepted
    worst = [max(errors(study["orders"][method]["body"])) for method in ranking[: len(accepted)]]
    assert worst == sorted(worst)
    assert worst[0] < 0.1 * max(errors(study["raw"]))
    for fit in record["fits"]:
        body = study["orders"].get(fit["method"], {}).get("body")
        assert body is None or fit["achieved"] == body


def errors(achieved: dict[str, float]) -> list[float]:
    return [achieved["level_max_deg"], achieved["tilt_max_deg"]]


def test_the_main_procedure_fits_every_method_and_shows_what_the_order_costs(finished):
    record = finished("eol_three_axis").record

    assert [fit["method"] for fit in record["fits"]] == list(METHODS)
    by_order = record["study"]["orders"]["truth_aided"]
    best = by_order.pop("body")
    assert set(by_order) == {"soft_first", "tilt_first", "tilt_reversed"}
    assert all(max(errors(other)) > 3.0 * max(errors(best)) for other in by_order.values())
    assert set(record["study"]["tilt_from"].values()) == {"own", "accelerometer"}
    assert record["ranking"][:2] == ["truth_aided", "tilt_aided"]
    assert record["study"]["tilt_from"]["tilt_aided"] == "accelerometer"


def test_two_axes_are_verified_by_their_own_formula_and_checked_by_the_third(finished):
    run = finished("eol_two_axis")

    written = run.record["coefficients"]["written"]
    assert written["extended_dip_deg"] == pytest.approx(60.0, abs=0.1)
    assert written["horizontal_mg"] == 250.0
    assert run.value("dip_difference") == pytest.approx(
        abs(run.fit("two_axis_aided")["extended_dip_deg"] - 60.0)
    )
    assert run.value("bench_against_module") < 0.01
    assert 0.0 < run.value("z_estimate_difference") < 6.0
    assert run.value("field_magnitude_difference") < 0.5


@pytest.mark.parametrize("wrong_deg", [0.5, -0.5])
def test_a_station_turned_against_the_rig_is_an_error_of_the_bench_with_two_axes_too(
    prepare, wrong_deg
):
    """Aligned to wrong azimuths x and y agree on every level heading; the tilts show it."""
    run = prepare("eol_two_axis")
    run.context.station = replace(run.context.station, field_azimuth_deg=wrong_deg)

    verdict = run.execute()

    first = "field_azimuth_difference"
    assert (verdict.outcome, verdict.first_failure) == (Outcome.ERROR, first)
    assert run.value(first) == pytest.approx(0.5, abs=0.1)
    assert run.context.written is None


def test_the_two_axis_unit_does_without_the_accelerometers_z(finished):
    sound, broken = finished("eol_two_axis"), finished("eol_two_axis", "accel_sign_z")

    assert broken.record["verdict"]["outcome"] == "PASS"
    assert broken.value("tilt_max") == sound.value("tilt_max")


def test_two_runs_of_two_axes_leave_one_record_but_for_the_time_of_day(finished):
    first, second = (timeless(finished("eol_two_axis", again=n).record) for n in (0, 1))

    assert first == second


def timeless(node: Any) -> Any:
    if isinstance(node, dict):
        return {
            key: timeless(value)
            for key, value in node.items()
            if not (key.endswith(OF_THE_DAY[0]) or key.startswith(OF_THE_DAY[1]))
        }
    return [timeless(each) for each in node] if isinstance(node, list) else node


@pytest.mark.parametrize("first", ["0 deg", "45 deg", "68.5 deg"])
def test_four_positions_may_start_anywhere(finished, changed, first):
    rings = [{"count": 4, "first": first}]

    run = finished(changed("four_position", four_positions={"rings": rings}))

    assert run.exit_code == 0, run.record["verdict"]["reason"]
    elsewhere = finished("four_position").fit("four_position")["offset_mg"]
    assert run.fit("four_position")["offset_mg"] == pytest.approx(elsewhere, abs=2.5)


def test_a_study_method_that_refuses_does_not_change_the_verdict(finished, changed):
    """At 45 deg four readings show min-max no extreme of either axis."""
    rings = [{"count": 4, "first": "45 deg"}]

    run = finished(changed("four_position", four_positions={"rings": rings}))

    refused = [fit["method"] for fit in run.record["fits"] if fit["cause"] is not None]
    assert run.record["verdict"]["outcome"] == "PASS"
    assert run.record["ranking"][len(run.record["ranking"]) - len(refused) :] == refused


def test_positions_that_are_not_square_are_the_procedures_fault_and_fail_no_unit(finished, changed):
    rings = [{"count": 1, "first": f"{azimuth} deg"} for azimuth in (0, 90, 180, 250)]

    with pytest.raises(ConfigError, match=r"poses must suffice.*positions_not_square"):
        finished(changed("four_position", four_positions={"rings": rings}))


def test_a_judged_method_that_is_not_the_best_is_told_and_still_passes(finished, changed):
    path = changed("soft_iron", limits="min_max", fit={"judged": ["min_max"]})

    run = finished(path)

    assert run.exit_code == 0, run.record["verdict"]["reason"]
    assert run.record["ranking"][0] == "soft_iron"
    lines = (run.folder / "events.ndjson").read_text(encoding="utf-8").splitlines()
    (event,) = [e for e in map(json.loads, lines) if e["event"] == "better_method"]
    assert (event["judged"], event["best"]) == ("min_max", "soft_iron")
    assert event["behind_deg"] == run.value("behind_best") > event["uncertainty_deg"] > 0.0
    assert rejudge(run.folder).differing == []


def test_a_fit_is_made_again_from_the_readings_that_came_before_it(finished, changed):
    """A second fit sees the poses of both; the first one must not when it is judged again."""
    more_poses = {"kind": "poses", "name": "more", "rings": [{"count": 4, "first": "3 deg"}]}
    again = {"kind": "fit", "name": "again", "methods": ["soft_iron"], "judged": ["soft_iron"]}
    path = changed("soft_iron", more=(more_poses, again), fit={"methods": ["soft_iron"]})

    run = finished(path)

    residuals = [m["value"] for m in run.record["measurements"] if m["name"] == "fit_residual"]
    assert len(set(residuals)) == 2
    assert rejudge(run.folder).differing == []


def test_a_method_that_only_a_later_step_fits_lends_no_tilt_to_an_earlier_comparison(
    finished, changed
):
    tilts = ({"pitch": "20 deg"}, {"pitch": "-20 deg"}, {"roll": "20 deg"}, {"roll": "-20 deg"})
    rings = [{"count": 4, "first": "20 deg", **tilt} for tilt in ({}, *tilts)]
    later = ["accelerometer", "four_position"]
    again = {"kind": "fit", "name": "again", "methods": later, "judged": ["four_position"]}
    compare = {"kind": "compare", "name": "after", "rings": [{"count": 24, "first": "7.5 deg"}]}
    path = changed(
        "four_position",
        more=(again, compare),
        four_positions={"rings": rings},
        fit={"methods": ["min_max", "four_position"]},
    )

    run = finished(path)

    largest = [m["note"] for m in run.record["measurements"] if m["name"] == "achieved_level_max"]
    assert [note.rpartition(" ")[2] for note in largest] == ["given", "accelerometer"]
    assert rejudge(run.folder).differing == []


def test_a_swing_without_fits_studies_the_raw_readings_alone(prepare):
    run = prepare("acceptance_swing")
    run.execute()

    study = run.recorder.sections["study"]
    assert study["raw"]["level_max_deg"] > 10.0
    assert study["orders"] == {}
    assert run.recorder.sections["ranking"] == []
