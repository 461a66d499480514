"""How the bench has the unit remounted: by the virtual operator, by a person, or not at all."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from bench.bus import BenchBus
from bench.calibration.mountings import Mounting
from bench.errors import BenchNotReady, BusFault, ConfigError
from bench.remount import remount
from protocols.clock import SimulatedClock
from protocols.link import Wire
from protocols.remounting import (
    REMOUNT_DONE_ID,
    REMOUNT_ID,
    MountCode,
    RemountResult,
    pack_remount_done,
    unpack_remount,
)
from protocols.sync import SYNC_ID, TICK_DONE_ID, pack_tick_done


class Simulator:
    """Answers SYNC, and a wish to remount with what it is told to."""

    def __init__(self, answer):
        self.wire = Wire()
        self.port = self.wire.attach()
        self.asked = []
        self._answer = answer
        self.wire.add_server(self.serve)

    def serve(self):
        while (frame := self.port.poll()) is not None:
            if frame.can_id == REMOUNT_ID:
                self.asked.append(unpack_remount(frame.data))
            if frame.can_id == SYNC_ID:
                if self.asked and self._answer is not None:
                    self.port.send(REMOUNT_DONE_ID, self._answer)
                self.port.send(TICK_DONE_ID, pack_tick_done(1, frame.data[0]))


def context_on(simulator, **options):
    bus = BenchBus(simulator.wire.attach(), SimulatedClock())
    return SimpleNamespace(bus=bus, step_name="mount_turned", ask=None, **options)


def test_the_virtual_operator_is_asked_in_lock_step_and_waited_for():
    simulator = Simulator(pack_remount_done(MountCode.TURNED, RemountResult.DONE))

    remount(context_on(simulator), Mounting.TURNED)

    assert simulator.asked == [MountCode.TURNED]


@pytest.mark.parametrize(
    ("answer", "error", "sentence"),
    [
        (None, BusFault, "the virtual operator has not remounted the unit within 60 s"),
        (b"\x01", BusFault, "the virtual operator's answer cannot be read"),
        (
            pack_remount_done(MountCode.TURNED, RemountResult.RIG_NOT_LEVEL),
            BenchNotReady,
            "must mount the unit turned; instead it answered rig not level",
        ),
        (
            pack_remount_done(MountCode.AS_MARKED, RemountResult.DONE),
            BenchNotReady,
            "must mount the unit turned; instead it answered done, as_marked",
        ),
    ],
)
def test_an_operator_that_does_not_do_it_is_an_error_of_the_bench(answer, error, sentence):
    with pytest.raises(error, match=sentence):
        remount(context_on(Simulator(answer)), Mounting.TURNED)


def test_on_a_real_bench_a_person_is_asked_in_words():
    said = []
    context = SimpleNamespace(
        bus=SimpleNamespace(mode="free"),
        step_name="mount_turned_over",
        ask=lambda sentence: said.append(sentence) or "",
        event=lambda kind, **fields: said.append((kind, fields["text"])),
    )

    remount(context, Mounting.TURNED_OVER)

    assert "upside down" in said[0]
    assert said[1] == ("prompt", said[0])


def test_without_anybody_to_ask_a_real_bench_is_refused_in_one_sentence():
    context = SimpleNamespace(bus=SimpleNamespace(mode="free"), step_name="mount_turned", ask=None)

    with pytest.raises(ConfigError, match="needs an operator to mount the unit turned; instead"):
        remount(context, Mounting.TURNED)
