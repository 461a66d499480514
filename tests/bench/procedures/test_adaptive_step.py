from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import TypeAdapter

from bench.acceptance.site import field_rig_mg
from bench.adaptive_tour import AdaptiveTour, wound
from bench.calibration.tilt import ned_from_body
from bench.errors import BenchNotReady, ConfigError, FieldChanged
from bench.limit_set import load_limits
from bench.plan import calibration_attitudes, plan_of, predictions
from bench.planned_tour import HOME
from bench.procedure import Procedure
from bench.procedure_loader import load_procedure
from bench.samples import READING
from bench.station import load_station
from bench.steps.adaptive_poses import AdaptivePoses

STATION = load_station("default")
STEP = {"kind": "adaptive_poses", "name": "adaptive_poses", "wanted": "0.2 deg"}


def step_of(**fields):
    return AdaptivePoses.model_validate(STEP | fields)


def procedure_of(*steps):
    return TypeAdapter(Procedure).validate_python(
        {"name": "p", "version": "1.0", "title": "t", "limits": "adaptive", "steps": steps}
    )


class Bench:
    """A run context around a unit without hard or soft iron, whose readings scatter."""

    def __init__(self, *, scatter=1.0, disturbed=(), station=STATION):
        self._rng = np.random.default_rng(5)
        self._scatter, self._disturbed = scatter, disturbed
        self.readings = np.zeros(0, dtype=READING)
        self.calibration_positions, self.events, self.judged = [], [], []
        self.recorded = {}
        self.recorder = SimpleNamespace(set=self.recorded.__setitem__)
        self.rig = SimpleNamespace(attitude=HOME)
        self.station, self.step_name, self.synthesised = station, "adaptive_poses", True

    def visit(self, planned, *, calibrates):
        assert calibrates
        for pose in planned:
            position = len(self.readings)
            reading = np.zeros(1, dtype=READING)
            axes = ned_from_body(
                pose.attitude.azimuth_deg, pose.attitude.pitch_deg, pose.attitude.roll_deg
            )
            field_mg = axes.T @ field_rig_mg(self.station)
            field_mg += self._scatter * self._rng.normal(0.0, 0.35, 3)
            field_mg += 40.0 if position in self._disturbed else 0.0
            reading["position"], reading["field_mg"] = position, field_mg
            reading["accel_g"] = -axes[2] + self._scatter * self._rng.normal(0.0, 0.0004, 3)
            for name in ("azimuth", "pitch", "roll"):
                reading[f"rig_{name}_deg"] = getattr(pose.attitude, f"{name}_deg")
            self.readings = np.concatenate([self.readings, reading])
            self.calibration_positions.append(position)
            self.rig.attitude = wound(self.rig.attitude, pose.attitude)

    def readings_at(self, positions):
        return self.readings[np.isin(self.readings["position"], positions)]

    def require_rig(self):
        return self.rig

    def compute(self, work):
        return work()

    def event(self, kind, **fields):
        self.events.append((kind, fields))

    def judge(self, measurements):
        self.judged += measurements


def test_a_quiet_unit_stops_at_the_first_pose_after_which_the_claim_is_small_enough():
    bench, step = Bench(), step_of()

    step.run(bench)

    found = bench.recorded["adaptive"]
    claims = [claim["largest_deg"] for claim in found["claims"]]
    assert found["ended"] == "wanted_reached"
    assert claims[-1] <= 0.2 < min(claims[:-1])
    assert [claim["poses"] for claim in found["claims"]] == list(range(8, 8 + len(claims)))
    assert 10 <= len(bench.readings) <= 18
    (measured,) = (one for one in bench.judged if one.name == "predicted_uncertainty")
    assert measured.value == claims[-1]
    assert [fields["largest_deg"] for kind, fields in bench.events if kind == "claimed"] == claims


def test_the_visited_poses_are_those_that_the_plan_foretells():
    bench, step = Bench(), step_of()

    step.run(bench)

    foreseen = [pose.attitude.azimuth_deg for pose in step.longest_poses()]
    assert bench.readings["rig_azimuth_deg"].tolist() == foreseen[: len(bench.readings)]
    assert {pose.direction for pose in step.longest_poses()} == {1}


def test_a_unit_that_scatters_goes_to_the_most_poses_and_misses_its_limit():
    bench, step = Bench(scatter=1.7), step_of()

    step.run(bench)

    assert bench.recorded["adaptive"]["ended"] == "most_poses"
    assert len(bench.readings) == 20
    (measured,) = (one for one in bench.judged if one.name == "predicted_uncertainty")
    assert measured.value > load_limits("adaptive").by_name["predicted_uncertainty"].high
    assert load_limits("adaptive").by_name["predicted_uncertainty"].missed == "FAIL"


def test_a_disturbed_pose_counts_as_not_visited_and_costs_another_one():
    clean, bench, step = Bench(), Bench(disturbed=(4,)), step_of(most=24)

    step.run(clean)
    step.run(bench)

    assert bench.recorded["adaptive"]["ended"] == "wanted_reached"
    assert len(bench.readings) > len(clean.readings)


def test_what_comes_next_is_asked_of_the_poses_whose_readings_count(monkeypatch):
    asked = []
    following = AdaptiveTour.following

    def heard(tour, visited, present):
        asked.append(list(visited))
        return following(tour, visited, present)

    monkeypatch.setattr(AdaptiveTour, "following", heard)
    bench, step = Bench(disturbed=(4,)), step_of(wanted="0.19 deg", horizontal="251 mG")
    lost = step.tour.first[4]
    step.longest_poses()
    asked.clear()

    step.run(bench)

    assert asked
    assert all(len(visited) == 7 + number for number, visited in enumerate(asked))
    assert not any(one.is_at(lost) for visited in asked for one in visited)


def test_poses_that_were_lost_are_the_benchs_fault_and_no_verdict_on_the_unit():
    """The 14 of 15 that are left would not do with readings as quiet as stated."""
    bench = Bench(scatter=1.3, disturbed=(2,))

    with pytest.raises(FieldChanged, match="poses must tell the heading to 0.202 deg"):
        step_of(wanted="0.202 deg", most=15).run(bench)


def test_a_field_too_weak_for_what_is_wanted_is_no_verdict_on_the_unit():
    bench = Bench(station=replace(STATION, horizontal_mg=120.0))

    with pytest.raises(BenchNotReady, match="in this station's field: allow more poses"):
        step_of().run(bench)


def test_the_plan_shows_the_poses_to_expect_and_the_most():
    procedure = load_procedure("adaptive")

    plan = plan_of(procedure)

    (own,) = (step for step in plan.steps if step.kind == "adaptive_poses")
    assert 8 < own.poses < own.most_poses == 20
    assert own.duration_s < own.longest_s
    assert plan.longest_s - plan.duration_s == pytest.approx(own.longest_s - own.duration_s)
    assert len(calibration_attitudes(procedure)) == own.poses
    (truth,) = (one for one in predictions(procedure, STATION) if one.method == "truth_aided")
    assert truth.predicted_heading_max_deg < 0.2


def test_an_accuracy_that_the_most_poses_do_not_reach_is_refused_before_the_run():
    with pytest.raises(ConfigError, match=r"wanted must be at least the 0\.\d+ deg that 9 poses"):
        plan_of(procedure_of(STEP | {"most": 9}))


def test_no_verification_may_be_at_a_pose_that_the_step_might_visit():
    verify = {
        "kind": "verify", "name": "verify",
        "rings": [{"count": 1, "first": "217.5 deg", "roll": "-15 deg"}],
    }  # fmt: skip

    with pytest.raises(ValueError, match="must verify at poses of its own"):
        procedure_of(STEP, verify)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"wanted": "0 deg"}, "wanted must be above zero"),
        ({"least": 12, "most": 10}, "most must be at least 12 poses"),
        ({"least": 7}, "greater than or equal to 8"),
        ({"tilt": "70 deg"}, "less than or equal to 60"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(fields, sentence):
    with pytest.raises(ValueError, match=sentence):
        step_of(**fields)
