"""Runs the world and its nodes on a bus: in lock-step with SYNC, or on a clock of its own.

Nodes that share one link do not hear each other; with a link for each they do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Protocol

from protocols.link import BatchLink
from protocols.sync import SYNC_ID, TICK_DONE_ID, TICK_NS, pack_tick_done

if TYPE_CHECKING:
    from collections.abc import Callable

    from protocols.clock import Clock
    from protocols.frame import Frame
    from protocols.link import Link

    Emit = Callable[[int, bytes], None]
    Routes = dict[int, tuple[Callable[[int, int, bytes], None], ...]]

IDLE_WAIT_S: Final = 0.05
"""How long a lock-step host sleeps on its link before it looks at its stop condition."""


class Node(Protocol):
    """A device on the bus."""

    @property
    def accepts(self) -> frozenset[int]:
        """Identifiers that the node listens to."""
        ...

    def receive(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Take one frame."""
        ...

    def tick(self, t_ns: int, group: int, emit: Emit) -> None:
        """Send what is due in this period of 10 ms; the world stands at `t_ns`."""
        ...

    def sync(self, emit: Emit) -> None:
        """Send what a SYNC of the bench asks for."""
        ...


class SteppedWorld(Protocol):
    """What moves between two ticks."""

    def step(self, t_ns: int) -> None:
        """Go on to a time in nanoseconds."""
        ...


class Outbox:
    """Keeps the frames of one turn, so that they leave together."""

    def __init__(self, link: BatchLink) -> None:
        self._link = link
        self._frames: list[tuple[int, bytes]] = []

    def add(self, can_id: int, data: bytes) -> None:
        """Keep one frame."""
        self._frames.append((can_id, data))

    def post(self) -> None:
        """Send what was kept, in order."""
        if self._frames:
            frames, self._frames = self._frames, []
            self._link.send_all(frames)


class Host:
    """World and nodes of one simulator.

    Parameters
    ----------
    world : SteppedWorld
        Stepped by 10 ms before the nodes of each tick.
    nodes : sequence of Node
        In canonical order: the order in which they speak.
    links : Link or sequence of Link
        One link for all nodes, or one for each; SYNC is taken from the first and the
        tick-done frame sent on it.
    at_tick : callable, optional
        Called with the tick's number before its world is stepped: faults start here.

    Attributes
    ----------
    tick_count : int
        Ticks since power-on.
    """

    def __init__(
        self,
        world: SteppedWorld,
        nodes: Sequence[Node],
        links: Link | Sequence[Link],
        *,
        at_tick: Callable[[int], None] | None = None,
    ) -> None:
        self._world = world
        self._nodes = tuple(nodes)
        self._at_tick = at_tick
        self.tick_count = 0
        self.now_ns = 0
        each = list(links) if isinstance(links, Sequence) else [links] * len(self._nodes)
        if len(each) != len(self._nodes):
            message = (
                f"links must be one, or one for each of {len(self._nodes)} nodes; "
                f"instead received {len(each)}"
            )
            raise ValueError(message)
        self._first = each[0]
        outboxes = {id(link): Outbox(link) for link in each if isinstance(link, BatchLink)}
        self._outboxes = tuple(outboxes.values())
        sends = [outboxes[id(link)].add if id(link) in outboxes else link.send for link in each]
        self._send_first = sends[0]
        self._turns = tuple(
            (node.tick, node.sync, send) for node, send in zip(self._nodes, sends, strict=True)
        )
        inputs = _inputs(self._nodes, each)
        self._routes = inputs[0][1]
        self._others = inputs[1:]

    def serve(self) -> None:
        """Take every frame that waits, and run one tick for each SYNC; never blocks.

        Raises
        ------
        LinkError
            If a link is broken.
        """
        poll = self._first.poll
        while True:
            if self._others:
                self._drain_others()
            frame = poll()
            if frame is None:
                return
            self._take(frame)

    def run_lockstep(self, stop: Callable[[], bool]) -> None:
        """Serve until `stop()`; sleeps on the first link while nothing comes."""
        while not stop():
            frame = self._first.wait(IDLE_WAIT_S)
            if frame is not None:
                if self._others:
                    self._drain_others()
                self._take(frame)
                self.serve()

    def run_free(self, clock: Clock, stop: Callable[[], bool]) -> None:
        """Tick every 10 ms of `clock` until `stop()`; late ticks are made up for.

        Drives send their TPDO on the bench's SYNC, everything else keeps the host's time.
        """
        start_ns = clock.now_ns() - self.now_ns
        while not stop():
            due_ns = start_ns + self.now_ns + TICK_NS
            while (left_ns := due_ns - clock.now_ns()) > 0:
                self._listen(left_ns / 1e9)
            self._advance()
            group = self.tick_count & 0x0F
            for tick, _, send in self._turns:
                tick(self.now_ns, group, send)
            self._post()

    def _take(self, frame: Frame) -> None:
        """Obey one frame of the first link in lock-step."""
        if frame.can_id != SYNC_ID:
            self._deliver(self._routes, frame)
            return
        counter = frame.data[0] if frame.data else 0
        self._advance()
        now_ns = self.now_ns
        group = counter & 0x0F
        for tick, sync, send in self._turns:
            tick(now_ns, group, send)
            sync(send)
        self._send_first(TICK_DONE_ID, pack_tick_done(self.tick_count, counter))
        self._post()

    def _post(self) -> None:
        for outbox in self._outboxes:
            outbox.post()

    def _advance(self) -> None:
        self.tick_count += 1
        if self._at_tick is not None:
            self._at_tick(self.tick_count)
        self.now_ns += TICK_NS
        self._world.step(self.now_ns)

    def _listen(self, timeout_s: float) -> None:
        """Wait for the first link's next frame and obey it, on the host's own clock."""
        frame = self._first.wait(min(timeout_s, IDLE_WAIT_S))
        while frame is not None:
            if frame.can_id == SYNC_ID:
                for _, sync, send in self._turns:
                    sync(send)
                self._post()
            else:
                self._deliver(self._routes, frame)
            frame = self._first.poll()
        if self._others:
            self._drain_others()

    def _drain_others(self) -> None:
        for poll, routes in self._others:
            while (frame := poll()) is not None:
                self._deliver(routes, frame)

    def _deliver(self, routes: Routes, frame: Frame) -> None:
        for receive in routes.get(frame.can_id, ()):
            receive(self.now_ns, frame.can_id, frame.data)


def _inputs(
    nodes: Sequence[Node], links: Sequence[Link]
) -> list[tuple[Callable[[], Frame | None], Routes]]:
    """Return (poll, receivers by identifier) for each distinct link, in order of first use."""
    found: dict[int, tuple[Callable[[], Frame | None], Routes]] = {}
    for node, link in zip(nodes, links, strict=True):
        _, routes = found.setdefault(id(link), (link.poll, {}))
        for can_id in node.accepts:
            routes[can_id] = (*routes.get(can_id, ()), node.receive)
    return list(found.values())
