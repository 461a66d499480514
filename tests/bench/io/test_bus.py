from __future__ import annotations

import re

import numpy as np
import pytest

from bench.bus import BenchBus
from bench.cancel import CancelToken
from bench.errors import Aborted, BusFault, ModuleSilent, RigFault
from bench.link_watch import SENTENCES
from protocols.canopen import BENCH_NODE, heartbeat_id
from protocols.clock import MonotonicClock, SimulatedClock
from protocols.errors import LinkError
from protocols.frame import EXTENDED, Frame
from protocols.link import Wire
from protocols.link_faults import LinkFault
from protocols.sync import SYNC_ID, TICK_DONE_ID, pack_tick_done


def test_given_a_simulator_when_ticking_then_time_and_sync_counter_advance(bus, echo):
    for _ in range(241):
        bus.tick()

    counters = [frame.data[0] for frame in echo.heard if frame.can_id == SYNC_ID]
    assert counters == [*range(1, 241), 1]
    assert bus.tick_count == 241
    assert bus.now_s == pytest.approx(2.41)


def test_when_ticking_then_the_heartbeat_goes_out_every_100_ms(bus, echo):
    bus.run_for(1.0)

    beats = [f.t_ns for f in echo.heard if f.can_id == heartbeat_id(BENCH_NODE)]
    assert np.diff(beats).tolist() == [100_000_000] * 9


def test_sync_is_the_last_frame_that_the_bench_sends_in_a_tick(bus, echo):
    bus.send(0x601, b"\x01")
    bus.tick()

    assert [f.can_id for f in echo.heard] == [0x601, heartbeat_id(BENCH_NODE), SYNC_ID]


def test_given_two_subscribers_then_both_see_a_frame_until_one_leaves(bus, echo):
    first: list[Frame] = []
    second: list[Frame] = []
    echo.says = lambda tick: [(0x181, bytes([tick]))]
    bus.subscribe(0x181, first.append)
    bus.subscribe(0x181, second.append)
    bus.tick()
    bus.unsubscribe(0x181, first.append)
    bus.tick()
    bus.unsubscribe(0x181, second.append)
    bus.tick()

    assert [f.data for f in first] == [b"\x01"]
    assert [f.data for f in second] == [b"\x01", b"\x02"]


def test_hooks_run_after_the_frames_of_the_tick_in_order_of_adding(bus, echo):
    seen: list[str] = []
    echo.says = lambda _: [(0x181, b"")]
    bus.subscribe(0x181, lambda _: seen.append("frame"))
    bus.add_hook(lambda: seen.append("first"))
    last = lambda: seen.append("second")  # noqa: E731
    bus.add_hook(last)
    bus.tick()
    bus.remove_hook(last)
    bus.tick()

    assert seen == ["frame", "first", "second", "frame", "first"]


def test_given_a_late_tick_done_of_an_older_tick_then_it_does_not_end_this_one(wire):
    bus = BenchBus(wire.attach(), SimulatedClock())
    device = wire.attach()
    seen: list[int] = []
    bus.subscribe(0x181, lambda frame: seen.append(frame.data[0]))
    device.send(TICK_DONE_ID, pack_tick_done(0, 240))
    device.send(0x181, b"\x07")
    device.send(TICK_DONE_ID, pack_tick_done(1, 1))
    bus.tick()

    assert seen == [7]


def test_given_a_dead_simulator_when_ticking_then_bus_fault_says_so(bus, echo):
    bus.tick()
    echo.alive = False

    with pytest.raises(BusFault, match="simulator has not answered SYNC 2 of tick 2"):
        bus.tick()


def test_run_until_stops_at_the_condition_and_raises_the_given_error_after_its_time(bus):
    bus.run_until(lambda: bus.tick_count == 5, 1.0, "five ticks have not passed")
    assert bus.tick_count == 5

    with pytest.raises(ModuleSilent, match="nothing has come within 0.2 s"):
        bus.run_until(lambda: False, 0.2, "nothing has come")
    assert bus.tick_count == 25
    with pytest.raises(RigFault):
        bus.run_until(lambda: False, 0.1, "no", error=lambda text: RigFault(text, "roll"))


def test_given_a_signal_when_ticking_then_aborted_unless_shielded(bus):
    bus.cancel.request(15)
    with bus.cancel.shielded():
        bus.run_for(0.05)
    assert bus.tick_count == 5

    with pytest.raises(Aborted) as error:
        bus.tick()
    assert error.value.signal_number == 15
    assert bus.tick_count == 5


def test_given_two_signals_then_the_first_counts_and_nested_shields_hold():
    token = CancelToken()
    with token.shielded():
        with token.shielded():
            token.request(2)
        token.request(15)
        token.check()
        assert token.requested
        assert not token.due
    with pytest.raises(Aborted) as error:
        token.check()
    assert error.value.signal_number == 2


def test_given_a_shield_when_asked_inside_then_due_afterwards():
    token = CancelToken()
    with token.shielded():
        token.request(2)
        assert not token.due

    assert token.due


def test_sinks_get_every_frame_in_order_with_its_direction(wire, echo):
    blocks: list[np.ndarray] = []
    bus = BenchBus(wire.attach(), SimulatedClock(), sinks=[lambda b: blocks.append(b.copy())])
    echo.says = lambda tick: [(EXTENDED | 0x18FF1080, bytes([tick & 0xFF] * 8))]
    bus.run_for(10.0)
    bus.flush()
    frames = np.concatenate(blocks)

    assert len(blocks) == 1
    assert len(frames) == bus.frames == 1000 * 3 + 100
    ids = frames["can_id"].tolist()
    assert ids[:4] == [heartbeat_id(BENCH_NODE), SYNC_ID, EXTENDED | 0x18FF1080, TICK_DONE_ID]
    assert frames["sent"][:4].tolist() == [True, True, False, False]
    assert np.all(np.diff(frames["t_ns"]) >= 0)
    assert frames["t_ns"][-1] == 10_000_000_000


def test_given_a_long_run_then_blocks_keep_memory_bounded(wire, echo):
    sizes: list[int] = []
    bus = BenchBus(wire.attach(), SimulatedClock(), sinks=[lambda b: sizes.append(len(b))])
    echo.says = lambda _: [(0x181, b"123456")] * 20
    bus.run_for(10.0)

    assert len(sizes) >= 5
    assert max(sizes) < 4096 + 30


def test_load_is_computed_from_bits_without_the_simulators_own_frame(wire, echo):
    bus = BenchBus(wire.attach(), SimulatedClock(), bitrate=500_000)
    echo.says = lambda _: [(EXTENDED | 0x18FF1080, bytes(8))] * 5
    bus.run_for(1.0)

    sync, beat, module = 100 * 55, 10 * 55, 500 * 131
    assert bus.load_percent == pytest.approx((sync + beat + module) / 5000.0)
    assert bus.load_worst_percent == pytest.approx((110 * 65 + 500 * 160) / 5000.0)


def test_given_a_rig_bus_of_its_own_then_frames_go_by_their_identifiers_length():
    rig_wire, module_wire = Wire(), Wire()
    rig_port, module_port = rig_wire.attach(), module_wire.attach()

    def serve() -> None:
        while (frame := rig_port.poll()) is not None:
            if frame.can_id == SYNC_ID:
                module_port.send(EXTENDED | 0x18FF1080, b"12345678")
                rig_port.send(TICK_DONE_ID, pack_tick_done(1, frame.data[0]))

    rig_wire.add_server(serve)
    bus = BenchBus(module_wire.attach(), SimulatedClock(), rig_link=rig_wire.attach())
    seen: list[Frame] = []
    bus.subscribe(EXTENDED | 0x18FF1080, seen.append)
    bus.send(EXTENDED | 0x18DA80F1, b"\x02\x3e\x00")
    bus.run_for(0.1)

    assert len(seen) == 10
    assert [f.can_id for f in module_port.queue] == [EXTENDED | 0x18DA80F1]
    assert bus.load_percent == pytest.approx(10 * 131 / 500.0, rel=0.15)


class FaultyLink:
    """A link that refuses, or reports faults as `PyCanLink` does."""

    channel = "can7"

    def __init__(self, **fault_counts: int) -> None:
        self.fault_counts = fault_counts
        self.dropped = fault_counts.get("receive_dropped", 0)
        self._done: Frame | None = None

    def send(self, can_id: int, data: bytes) -> None:
        if "refuse" in self.fault_counts:
            message = "channel can7 refuses a frame"
            raise LinkError(message)
        if can_id == SYNC_ID:
            self._done = Frame(0, TICK_DONE_ID, pack_tick_done(0, data[0]))

    def poll(self) -> Frame | None:
        done, self._done = self._done, None
        return done

    def wait(self, timeout_s: float) -> Frame | None:
        del timeout_s
        return self.poll()

    def close(self) -> None:
        pass


def test_given_dropped_frames_when_ticking_then_bus_fault_once_so_that_teardown_goes_on():
    bus = BenchBus(FaultyLink(error_warning=2, receive_dropped=7), SimulatedClock())

    with pytest.raises(BusFault, match="can7 lost 7 frames because this computer did not read"):
        bus.run_for(0.1)
    bus.run_for(0.5)
    assert bus.tick_count == 60
    assert bus.faults == {"error_warning": 2, "receive_dropped": 7}
    assert bus.dropped == 7


@pytest.mark.parametrize("fault", list(LinkFault))
def test_every_fault_of_a_channel_but_a_warning_ends_the_run_with_its_own_sentence(fault):
    bus = BenchBus(FaultyLink(**{fault: 3}), SimulatedClock())

    if fault is LinkFault.ERROR_WARNING:
        bus.check_links()
    else:
        with pytest.raises(
            BusFault, match=re.escape(SENTENCES[fault].format(channel="can7", count=3))
        ):
            bus.check_links()
        bus.check_links()
    assert bus.faults == {fault: 3}


def test_given_a_channel_that_refuses_then_the_link_error_is_a_bus_fault():
    bus = BenchBus(FaultyLink(refuse=1), SimulatedClock())

    with pytest.raises(BusFault, match="refuses"):
        bus.tick()


def test_free_running_reads_what_comes_and_keeps_ten_ms(wire):
    device = wire.attach()
    clock = MonotonicClock()
    bus = BenchBus(wire.attach(), clock, mode="free")
    seen: list[Frame] = []
    bus.subscribe(0x181, seen.append)
    for count in range(5):
        device.send(0x181, bytes([count]))
        bus.tick()

    assert [f.data[0] for f in seen] == [0, 1, 2, 3, 4]
    assert bus.now_s >= 0.045
    assert [f.can_id for f in device.queue].count(SYNC_ID) == 5


def test_given_a_clock_of_the_other_mode_then_the_bus_refuses_it(wire):
    with pytest.raises(ValueError, match="mode free cannot run on a SimulatedClock"):
        BenchBus(wire.attach(), SimulatedClock(), mode="free")
    with pytest.raises(ValueError, match="mode lockstep cannot run on a MonotonicClock"):
        BenchBus(wire.attach(), MonotonicClock())


class SilentLink:
    """A link on which nobody speaks; counts how often it was waited for."""

    def __init__(self) -> None:
        self.waits = 0

    def send(self, can_id: int, data: bytes) -> None:
        pass

    def poll(self) -> Frame | None:
        return None

    def wait(self, timeout_s: float) -> Frame | None:
        del timeout_s
        self.waits += 1

    def close(self) -> None:
        pass


def test_given_a_dead_simulator_then_teardown_does_not_wait_the_whole_time_again():
    link = SilentLink()
    bus = BenchBus(link, SimulatedClock())
    with pytest.raises(BusFault):
        bus.tick()
    waited = link.waits
    with pytest.raises(BusFault):
        bus.tick()

    assert waited == 50
    assert link.waits == waited + 1


def test_given_a_signal_while_the_simulator_hangs_then_aborted_at_once():
    link = SilentLink()
    bus = BenchBus(link, SimulatedClock())
    link.send = lambda *_: bus.cancel.request(2)
    with pytest.raises(Aborted):
        bus.tick()

    assert link.waits == 1
