"""Mountings and reversal in a procedure file: what it must hold, and what it must not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from bench.errors import ConfigError
from bench.field_watch import FieldWatch
from bench.plan import plan_of
from bench.procedure_loader import load_procedure, procedure_path
from bench.steps.headings import Ring
from bench.steps.mount import Mount


@pytest.fixture
def changed(tmp_path):
    """Return bench_verify with its steps changed, as a loaded procedure."""

    def load(change):
        document = yaml.safe_load(procedure_path("bench_verify").read_text(encoding="utf-8"))
        document["steps"] = change(document["steps"])
        path = tmp_path / "own.yaml"
        path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
        return load_procedure(str(path))

    return load


def without(*names):
    return lambda steps: [step for step in steps if step["name"] not in names]


def test_a_reversal_needs_two_different_mountings(changed):
    with pytest.raises(ConfigError, match="step reversal must come after at least two different"):
        changed(without("mount_turned", "mount_turned_over"))


def test_two_mountings_are_enough(changed):
    procedure = changed(without("mount_turned_over", "turned_over"))

    assert [step.kind for step in procedure.steps].count("mount") == 2


@pytest.mark.parametrize(
    ("change", "received"),
    [
        (without("reversal"), "none"),
        (lambda steps: [*steps, {"kind": "reversal", "name": "again"}], "2"),
    ],
)
def test_mountings_are_taken_apart_once(changed, change, received):
    with pytest.raises(ConfigError, match=f"must have one reversal step; instead .* {received}$"):
        changed(change)


def test_a_seating_is_not_less_than_certain(changed):
    def impossible(steps):
        return [
            step | {"seating_uncertainty": "-1 deg"} if step["kind"] == "reversal" else step
            for step in steps
        ]

    with pytest.raises(ConfigError, match="seating_uncertainty: input should be greater"):
        changed(impossible)


def test_no_coefficients_come_from_a_unit_that_is_remounted(changed):
    fit = {"kind": "fit", "name": "fit", "methods": ["truth_aided"], "judged": ["truth_aided"]}

    with pytest.raises(ConfigError, match="must not stand in a procedure that remounts the unit"):
        changed(lambda steps: [*steps, fit])


def test_a_mounting_that_does_not_exist_is_refused_with_its_place(changed):
    def sideways(steps):
        return [step | {"mounting": "sideways"} if "mounting" in step else step for step in steps]

    with pytest.raises(ConfigError, match=r"own.yaml:\d+:\d+: steps.4.mount"):
        changed(sideways)


def test_the_shipped_reversal_takes_less_than_ten_minutes_and_goes_round_both_ways():
    procedure = load_procedure("bench_verify")
    steps = {step.name: step for step in procedure.steps}

    assert plan_of(procedure).duration_s < 600.0
    poses = [[pose.attitude for pose in steps[n].poses()] for n in ("as_marked", "turned")]
    assert poses[0] == poses[1]
    for ring in steps["as_marked"].rings:
        assert ring.count % 2 == 0  # closed under half a turn
    assert {ring.direction for ring in steps["as_marked"].rings} == {
        "clockwise", "counter_clockwise",
    }  # fmt: skip


def test_a_remounted_unit_has_a_sentinel_field_of_its_own():
    watch = FieldWatch(poses=8)
    watch.visit_sentinel((0.0, 0.0, 0.0), np.array([250.0, 0.0, 433.0]), position=0, step="a")
    rig = SimpleNamespace(move_to=lambda attitude: None)
    context = SimpleNamespace(
        require_rig=lambda: rig, bus=SimpleNamespace(mode="socketcan"), ask=lambda text: "",
        event=lambda kind, **fields: None, mountings=[], poses=[], field_watch=watch,
    )  # fmt: skip

    Mount(kind="mount", name="turn", mounting="turned").run(context)

    turned_mg = np.array([-250.0, 0.0, 433.0])
    assert watch.visit_sentinel((0.0, 0.0, 0.0), turned_mg, position=1, step="b") == 0.0


def test_a_ring_goes_round_the_way_that_it_says():
    clockwise = Ring(count=4, first="30 deg")
    other = Ring(count=4, first="30 deg", direction="counter_clockwise")

    assert [p.attitude.azimuth_deg for p in clockwise.planned(0.5)] == [30.0, 120.0, 210.0, 300.0]
    assert [p.attitude.azimuth_deg for p in other.planned(0.5)] == [30.0, 300.0, 210.0, 120.0]
    assert {p.direction for p in clockwise.planned(0.5)} == {0}
    assert {p.direction for p in other.planned(0.5)} == {-1}
