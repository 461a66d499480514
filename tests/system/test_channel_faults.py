"""What a channel reports in a run, without a real one: the run is an ERROR and says so."""

from __future__ import annotations

import pytest

from bench.acceptance.outcome import Outcome
from bench.link_watch import LinkWatch
from bench.progress import SilentProgress

AT_POSITION = 3


class Channel:
    """Counts the faults of a channel as `PyCanLink` does."""

    channel = "can7"

    def __init__(self):
        self.fault_counts = {}

    @property
    def dropped(self):
        return self.fault_counts.get("receive_dropped", 0)


class FaultAtPosition(SilentProgress):
    """Lets the channel report a fault when the run has reached a position."""

    def __init__(self, channel, fault):
        self.channel = channel
        self.fault = fault

    def position_reached(self, state):
        if state.position == AT_POSITION:
            self.channel.fault_counts[self.fault] = 5


@pytest.fixture
def run_with(prepare):
    """Return what runs a procedure during which the channel reports a fault."""

    def execute(fault):
        run, channel = prepare("set_reset"), Channel()
        run.context.bus._watch = LinkWatch([channel])
        run.context.progress = FaultAtPosition(channel, fault)
        run.verdict = run.execute()
        return run

    return execute


@pytest.mark.parametrize("fault", ["receive_dropped", "bus_off", "send_blocked"])
def test_a_fault_of_the_channel_ends_the_run_as_an_error_that_is_recorded(run_with, fault):
    run = run_with(fault)

    assert (run.verdict.outcome, run.verdict.first_failure) == (Outcome.ERROR, "bus_fault")
    assert "channel can7" in run.verdict.reason
    bus = run.recorder.sections["bus"]
    assert bus["faults"] == {fault: 5}
    assert bus["dropped"] == (5 if fault == "receive_dropped" else 0)
    assert len(run.context.poses) <= AT_POSITION + 1


def test_after_the_fault_the_rig_is_parked(run_with):
    attitude = run_with("receive_dropped").context.rig.attitude

    assert abs(attitude.azimuth_deg) < 0.1
    assert abs(attitude.pitch_deg) < 0.1


def test_a_warning_is_recorded_and_the_unit_is_judged(run_with):
    run = run_with("error_warning")

    assert run.verdict.outcome is Outcome.PASS
    assert run.recorder.sections["bus"]["faults"] == {"error_warning": 5}


def test_a_fault_after_the_last_tick_of_a_step_is_not_missed(prepare):
    run, channel = prepare("set_reset"), Channel()
    run.context.bus._watch = LinkWatch([channel])
    last = run.context.procedure.steps[-1].name

    class AtTheEnd(SilentProgress):
        def measured(self, measurement):
            if measurement.step == last:
                channel.fault_counts["receive_dropped"] = 1

    run.context.progress = AtTheEnd()

    assert run.execute().outcome is Outcome.ERROR
