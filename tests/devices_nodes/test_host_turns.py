"""Lock-step and free-running: order of frames, tick-done, time, links."""

from __future__ import annotations

import itertools

import pytest

from devices.host import Host
from protocols.clock import SimulatedClock
from protocols.frame import Frame
from protocols.link import Wire
from protocols.sync import SYNC_ID, TICK_DONE_ID, TICK_NS, unpack_tick_done


class World:
    """Remembers its steps."""

    def __init__(self):
        self.times_ns = []

    def step(self, t_ns):
        self.times_ns.append(t_ns)


class Echo:
    """Sends what it was asked since the last tick, then its number; answers SYNC too."""

    def __init__(self, number):
        self.number = number
        self.heard = []
        self.ticks = []

    @property
    def accepts(self):
        return frozenset({0x300 + self.number, 0x3FF})

    def receive(self, t_ns, can_id, data):
        self.heard.append((t_ns, can_id, data))

    def tick(self, t_ns, group, emit):
        self.ticks.append((t_ns, group))
        emit(0x400 + self.number, bytes((group, len(self.heard))))

    def sync(self, emit):
        emit(0x500 + self.number, b"")


def station(links=1):
    wire = Wire()
    bench = wire.attach()
    world, nodes = World(), [Echo(1), Echo(2)]
    ports = [wire.attach() for _ in range(links)]
    host = Host(world, nodes, ports[0] if links == 1 else ports)
    return wire, bench, host, world, nodes


def drain(port):
    frames = []
    while (frame := port.poll()) is not None:
        frames.append(frame)
    return frames


@pytest.mark.parametrize("links", [1, 2])
def test_the_nodes_speak_in_canonical_order_and_the_tick_is_closed_last(links):
    wire, bench, host, _, _ = station(links)
    wire.add_server(host.serve)
    bench.send(SYNC_ID, b"\x07")

    frames = drain(bench)

    assert [f.can_id for f in frames] == [0x401, 0x501, 0x402, 0x502, TICK_DONE_ID]
    assert unpack_tick_done(frames[-1].data) == (1, 7)


@pytest.mark.parametrize("links", [1, 2])
def test_requests_sent_before_sync_are_heard_in_their_tick(links):
    wire, bench, host, _, nodes = station(links)
    wire.add_server(host.serve)
    bench.send(0x302, b"a")
    bench.send(0x3FF, b"b")
    bench.send(0x302, b"c")
    bench.send(SYNC_ID, b"\x01")

    frames = drain(bench)

    assert [f.data for f in frames if f.can_id == 0x402] == [b"\x01\x03"]
    assert nodes[1].heard == [(0, 0x302, b"a"), (0, 0x3FF, b"b"), (0, 0x302, b"c")]
    assert nodes[0].heard == [(0, 0x3FF, b"b")]


def test_the_world_goes_on_by_ten_milliseconds_a_sync_and_only_then():
    wire, bench, host, world, nodes = station()
    wire.add_server(host.serve)
    bench.send(0x301, b"")
    drain(bench)
    assert world.times_ns == []

    for counter in (239, 240, 1):
        bench.send(SYNC_ID, bytes((counter,)))
    drain(bench)

    assert world.times_ns == [TICK_NS, 2 * TICK_NS, 3 * TICK_NS]
    assert nodes[0].ticks == [(TICK_NS, 15), (2 * TICK_NS, 0), (3 * TICK_NS, 1)]
    assert host.tick_count == 3


def test_nodes_hear_each_other_where_each_has_its_own_link():
    class Caller(Echo):
        def tick(self, t_ns, group, emit):
            emit(0x302, b"call")

    wire = Wire()
    bench = wire.attach()
    nodes = [Caller(1), Echo(2)]
    host = Host(World(), nodes, [wire.attach(), wire.attach()])
    wire.add_server(host.serve)
    for _ in range(2):
        bench.send(SYNC_ID, b"\x01")
        drain(bench)

    drain(bench)

    assert [data for _, _, data in nodes[1].heard] == [b"call", b"call"]


def test_a_wrong_number_of_links_is_refused():
    wire = Wire()

    with pytest.raises(ValueError, match="one for each of 2 nodes; instead received 3"):
        Host(World(), [Echo(1), Echo(2)], [wire.attach() for _ in range(3)])


def test_faults_are_told_of_every_tick_before_its_world_moves():
    wire = Wire()
    bench, world, told = wire.attach(), World(), []
    host = Host(
        world,
        [Echo(1)],
        wire.attach(),
        at_tick=lambda tick: told.append((tick, len(world.times_ns))),
    )
    wire.add_server(host.serve)
    for _ in range(2):
        bench.send(SYNC_ID, b"\x01")
        drain(bench)

    assert told == [(1, 0), (2, 1)]


class WaitingPort:
    """A link whose waiting lets the clock pass and delivers frames at given times."""

    def __init__(self, clock, incoming):
        self.clock = clock
        self.incoming = list(incoming)
        self.sent = []

    def send(self, can_id, data):
        self.sent.append((self.clock.now_ns(), can_id))

    def poll(self):
        return None

    def wait(self, timeout_s):
        end_ns = self.clock.now_ns() + max(1, round(timeout_s * 1e9))
        if self.incoming and self.incoming[0].t_ns <= end_ns:
            frame = self.incoming.pop(0)
            self.clock.advance(max(0, frame.t_ns - self.clock.now_ns()))
            return frame
        self.clock.advance(end_ns - self.clock.now_ns())
        return None

    def close(self):
        return None


def run_free(incoming, ticks, clock=None):
    clock = clock or SimulatedClock(123_456)
    port = WaitingPort(clock, incoming)
    node, world = Echo(1), World()
    host = Host(world, [node], port)
    host.run_free(clock, stop=lambda: host.tick_count >= ticks)
    return port, node, world


def test_free_running_ticks_on_its_own_clock_and_closes_no_tick():
    port, node, _ = run_free([], 5)

    times = [t_ns for t_ns, can_id in port.sent]
    assert [can_id for _, can_id in port.sent] == [0x401] * 5
    assert [b - a for a, b in itertools.pairwise(times)] == [TICK_NS] * 4
    assert [group for _, group in node.ticks] == [1, 2, 3, 4, 5]


def test_free_running_answers_sync_when_it_comes():
    port, _, world = run_free(
        [Frame(15_000_000, SYNC_ID, b"\x01"), Frame(16_000_000, 0x301, b"q")], 3
    )

    assert (15_000_000, 0x501) in port.sent
    assert len(world.times_ns) == 3


def test_a_late_host_makes_up_for_its_ticks():
    class Sleepy(SimulatedClock):
        calls = 0

        def now_ns(self):
            self.calls += 1
            if self.calls == 6:
                self.advance(50_000_000)
            return super().now_ns()

    clock = Sleepy()
    _, node, _ = run_free([], 10, clock)

    assert len(node.ticks) == 10
    assert clock.now_ns() <= 110_000_000


class BatchPort:
    """A link that takes the frames of a turn together; hears what it is given."""

    def __init__(self, *heard, clock=None):
        self.clock = clock
        self.heard = [Frame(0, *frame) for frame in heard]
        self.batches = []

    def send(self, can_id, data):
        pytest.fail(f"frame {can_id:X} was sent alone")

    def send_all(self, frames):
        self.batches.append(list(frames))

    def poll(self):
        return self.heard.pop(0) if self.heard else None

    def wait(self, timeout_s):
        if not self.heard:
            self.clock.advance(TICK_NS)
        return self.poll()


def test_all_frames_of_a_turn_leave_together_with_tick_done_last():
    link = BatchPort((SYNC_ID, b"\x01"), (SYNC_ID, b"\x02"))
    Host(World(), [Echo(1), Echo(2)], link).serve()

    identifiers = [[can_id for can_id, _ in batch] for batch in link.batches]
    assert identifiers == [[0x401, 0x501, 0x402, 0x502, TICK_DONE_ID]] * 2


def test_nodes_with_links_of_their_own_send_batches_of_their_own():
    first, second = BatchPort((SYNC_ID, b"\x01")), BatchPort()
    Host(World(), [Echo(1), Echo(2)], [first, second]).serve()

    assert [[can_id for can_id, _ in batch] for batch in first.batches] == [
        [0x401, 0x501, TICK_DONE_ID]
    ]
    assert [[can_id for can_id, _ in batch] for batch in second.batches] == [[0x402, 0x502]]


def test_on_its_own_clock_a_host_sends_each_turn_and_each_answer_to_sync_together():
    clock = SimulatedClock()
    link = BatchPort((SYNC_ID, b"\x01"), clock=clock)
    host = Host(World(), [Echo(1), Echo(2)], link)

    host.run_free(clock, lambda: host.tick_count >= 2)

    identifiers = [[can_id for can_id, _ in batch] for batch in link.batches]
    assert identifiers == [[0x501, 0x502], [0x401, 0x402], [0x401, 0x402]]
