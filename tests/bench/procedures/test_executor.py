"""Order, retries, stops, teardown and the verdict, with steps that do what a test tells them."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Literal

import pytest

from bench.acceptance.measurement import Limit
from bench.acceptance.outcome import Outcome
from bench.cancel import CancelToken
from bench.errors import ConfigError, RigFault
from bench.executor import execute
from bench.limit_set import LimitSet
from bench.procedure import Group, Repeat
from bench.run_context import RunContext
from bench.station import load_station
from bench.steps.step import Step

STALLED = RigFault("azimuth axis is in fault", "azimuth")
SILENT = RigFault("drive silent", "roll")
DISK_FULL = OSError("disk full")


class Script(Step):
    """Does what the test's function does."""

    kind: Literal["script"] = "script"
    action: Callable[..., Any]

    def run(self, context):
        self.action(context)


class Records:
    """Remembers what the executor writes."""

    def __init__(self):
        self.steps = []
        self.events = []
        self.sections = {}
        self.verdict = None

    def event(self, kind, **fields):
        self.events.append((kind, fields))

    def step_started(self, name, kind, attempt=1): ...

    def step_ended(self, name, outcome, message=""):
        self.steps.append((name, outcome))

    def measurement(self, measurement): ...

    def set(self, section, value):
        self.sections[section] = value

    def close(self, verdict):
        assert self.verdict is None
        self.verdict = verdict


def measuring(*values, name="noise_x"):
    """Return an action that measures the values, one at each call."""
    rest = list(values)
    return lambda context: context.measure(name, rest.pop(0))


@pytest.fixture
def run_of(tmp_path):
    """Return what executes steps and gives (verdict, context)."""

    def execute_steps(*steps, measured=(), finish=(), limits=("noise_x", "noise_y")):
        cancel = CancelToken()
        bus = SimpleNamespace(
            cancel=cancel, now_s=0.0, mode="lockstep", frames=0, tick_count=0,
            load_percent=0.0, load_worst_percent=0.0, dropped=0, faults={},
            check_links=lambda: None,
        )  # fmt: skip
        procedure = SimpleNamespace(
            name="test", version="1.0", steps=steps, pose_count=0, on_pass="",
            measured=lambda: tuple(measured),
            walk=lambda: (inner for step in steps for inner in step.walk()),
        )  # fmt: skip
        by_name = {name: Limit(name=name, unit="mG", high=1.0) for name in limits}
        context = RunContext(
            bus=bus,
            module=SimpleNamespace(lost=0, e2e={}),
            sample_log=None,
            station=load_station("default"),
            limits=LimitSet(id="t", version="1.0", sha256="", path=tmp_path, by_name=by_name),
            recorder=Records(),
            procedure=procedure,
            serial="SN0001",
            finish=list(finish),
        )
        return execute(procedure, context), context

    return execute_steps


def script(name, action, **keys):
    return Script.model_construct(name=name, kind="script", action=action, **keys)


def test_steps_run_in_order_and_the_worst_outcome_is_the_verdict(run_of):
    verdict, context = run_of(script("a", measuring(0.5)), script("b", measuring(2.0)),
                              script("c", measuring(0.1)))  # fmt: skip

    assert context.recorder.steps == [
        ("a", Outcome.PASS), ("b", Outcome.FAIL), ("c", Outcome.PASS)
    ]  # fmt: skip
    assert (verdict.outcome, verdict.first_failure) == (Outcome.FAIL, "noise_x")
    assert context.recorder.verdict == verdict


def test_a_missed_limit_of_a_critical_step_ends_the_procedure(run_of):
    verdict, context = run_of(
        script("a", measuring(2.0), on_miss="stop"), script("b", measuring(0.1))
    )

    assert [name for name, _ in context.recorder.steps] == ["a"]
    assert verdict.outcome is Outcome.FAIL


def test_a_critical_step_inside_a_group_ends_the_procedure(run_of):
    group = Group.model_construct(
        kind="group", name="g", steps=[script("a", measuring(2.0), on_miss="stop")]
    )

    _, context = run_of(group, script("b", measuring(0.1)))

    assert context.recorder.steps == [("a", Outcome.FAIL), ("g", Outcome.FAIL)]


def test_a_retry_that_passes_is_a_pass_and_keeps_both_attempts(run_of):
    verdict, context = run_of(script("a", measuring(2.0, 0.5), attempts=3, on_miss="stop"))

    assert verdict.outcome is Outcome.PASS
    assert [(m.attempt, m.outcome) for m in context.measurements] == [
        (1, Outcome.FAIL), (2, Outcome.PASS)
    ]  # fmt: skip


def test_attempts_that_are_used_up_fail(run_of):
    verdict, context = run_of(script("a", measuring(2.0, 3.0), attempts=2))

    assert verdict.outcome is Outcome.FAIL
    assert len(context.measurements) == 2


def test_a_missed_attempt_leaves_no_readings_to_the_fits(run_of):
    def visit(context):
        context.calibration_positions.append(context.attempt)
        context.measure("noise_x", 2.0 if context.attempt == 1 else 0.5)

    _, context = run_of(script("a", visit, attempts=2))

    assert context.calibration_positions == [2]


def test_every_round_of_a_repeat_counts_under_a_name_of_its_own(run_of):
    repeat = Repeat.model_construct(
        kind="repeat", name="r", times=2, steps=[script("a", measuring(2.0, 0.5))]
    )

    verdict, context = run_of(repeat)

    assert [m.step for m in context.measurements] == ["a_1", "a_2"]
    assert verdict.outcome is Outcome.FAIL


def test_a_later_round_does_not_hide_what_a_group_missed_in_an_earlier_one(run_of):
    group = Group.model_construct(
        kind="group", name="g", attempts=1, on_miss="continue",
        steps=[script("a", measuring(2.0, 0.5))],
    )  # fmt: skip
    repeat = Repeat.model_construct(kind="repeat", name="r", times=2, steps=[group])

    verdict, context = run_of(repeat)

    assert [(m.step, m.attempt) for m in context.measurements] == [("a_1", 1), ("a_2", 1)]
    assert verdict.outcome is Outcome.FAIL


def test_an_error_of_the_bench_runs_every_promise_last_first(run_of):
    done = []

    def move(context):
        context.on_exit("park the rig", lambda: done.append("park"))
        context.on_exit("restore", lambda: done.append("restore"))
        raise STALLED

    verdict, context = run_of(script("a", move), script("b", measuring(0.1)))

    assert done == ["restore", "park"]
    assert (verdict.outcome, verdict.first_failure) == (Outcome.ERROR, "rig_fault")
    assert verdict.reason == "azimuth axis is in fault"
    assert context.recorder.steps == [("a", Outcome.ERROR)]


def test_a_promise_that_fails_stops_no_other_and_hides_no_first_error(run_of):
    done = []

    def broken():
        raise SILENT

    def move(context):
        context.on_exit("park the rig", lambda: done.append("park"))
        context.on_exit("restore", broken)
        raise STALLED

    verdict, context = run_of(script("a", move))

    assert done == ["park"]
    assert verdict.reason == "azimuth axis is in fault"
    assert ("teardown_failed", {"action": "restore", "message": "drive silent"}) in (
        context.recorder.events
    )


def test_a_unit_that_passed_on_a_rig_that_does_not_park_is_an_error(run_of):
    def broken():
        raise SILENT

    def move(context):
        context.on_exit("park the rig", broken)
        context.measure("noise_x", 0.1)

    verdict, _ = run_of(script("a", move))

    assert verdict.outcome is Outcome.ERROR
    assert "could not park the rig: drive silent" in verdict.reason


def test_a_fault_in_the_benchs_own_code_is_an_error_and_parks(run_of):
    done = []

    def buggy(context):
        context.on_exit("park the rig", lambda: done.append("park"))
        raise ZeroDivisionError

    verdict, _ = run_of(script("a", buggy))

    assert done == ["park"]
    assert verdict.outcome is Outcome.ERROR
    assert "ZeroDivisionError" in verdict.reason


def test_files_are_closed_after_the_safe_state_and_before_the_record(run_of):
    order = []

    def move(context):
        context.on_exit("park the rig", lambda: order.append("park"))
        context.measure("noise_x", 0.1)

    def failing():
        order.append("samples")
        raise DISK_FULL

    verdict, _ = run_of(
        script("a", move), finish=[("close the samples", failing), ("b", lambda: order.append("b"))]
    )

    assert order == ["park", "samples", "b"]
    assert verdict.outcome is Outcome.ERROR
    assert "could not close the samples: disk full" in verdict.reason


def test_a_measurement_that_was_declared_and_not_made_is_an_error(run_of):
    verdict, _ = run_of(script("a", measuring(0.1)), measured=["noise_x", "noise_y"])

    assert verdict.outcome is Outcome.ERROR
    assert "noise_y" in verdict.reason


def test_a_measurement_that_is_not_available_is_not_missed(run_of):
    def without(context):
        context.measure("noise_x", 0.1)
        context.not_available.add("noise_y")

    verdict, _ = run_of(script("a", without), measured=["noise_x", "noise_y"])

    assert verdict.outcome is Outcome.PASS


def test_a_measurement_without_limits_is_refused_before_anything_runs(run_of):
    with pytest.raises(ConfigError, match="lack noise_z"):
        run_of(script("a", measuring(0.1)), measured=["noise_z"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["int", "term"])
def test_a_signal_is_a_wish_that_the_next_tick_honours(run_of, number):
    done = []

    def interrupted(context):
        context.on_exit("park the rig", lambda: context.bus.cancel.check() or done.append("park"))
        os.kill(os.getpid(), number)
        context.bus.cancel.check()

    verdict, context = run_of(script("a", interrupted))

    assert done == ["park"]
    assert verdict.outcome is Outcome.ABORTED
    assert context.bus.cancel.signal_number == number
    assert context.recorder.steps == [("a", Outcome.ABORTED)]


def test_a_second_signal_ends_a_step_that_does_not_tick_and_a_third_changes_nothing(run_of):
    done = []

    def park():
        os.kill(os.getpid(), signal.SIGINT)
        done.append("park")

    def hanging(context):
        context.on_exit("park the rig", park)
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        done.append("never")

    verdict, _ = run_of(script("a", hanging))

    assert done == ["park"]
    assert verdict.outcome is Outcome.ABORTED


def test_a_run_off_the_main_thread_installs_no_handlers(run_of):
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        verdict, _ = pool.submit(run_of, script("a", measuring(0.1))).result(timeout=10)

    assert verdict.outcome is Outcome.PASS


def test_promises_of_one_name_count_once(run_of):
    done = []

    def twice(context):
        for _ in range(2):
            context.on_exit("park the rig", lambda: done.append("park"))
        context.measure("noise_x", 0.1)

    run_of(script("a", twice))

    assert done == ["park"]


def test_the_station_and_the_bus_stand_in_the_record(run_of):
    _, context = run_of(script("a", measuring(0.1)))

    assert context.recorder.sections["station"]["horizontal_mg"] == 250.0
    assert context.recorder.sections["bus"]["mode"] == "lockstep"


def test_a_step_that_would_leave_the_program_parks_and_closes_the_record(run_of):
    done = []

    def leaving(context):
        context.on_exit("park the rig", lambda: done.append("park"))
        raise SystemExit(1)

    verdict, context = run_of(script("a", leaving))

    assert done == ["park"]
    assert context.recorder.verdict.outcome is verdict.outcome is Outcome.ERROR
