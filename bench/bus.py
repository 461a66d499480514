"""The bench's end of the bus: one thread, one tick of 10 ms at a time.

A tick in lock-step: advance the clock, send what is due, send SYNC last, read until the
simulator's tick-done frame. A tick in free-running: send SYNC, read until the next 10 ms of
the machine's clock have passed. Everything that waits, waits by ticks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal

from bench.cancel import CancelToken
from bench.errors import BenchError, BusFault, ModuleSilent
from bench.frame_block import BLOCK_FRAMES, SENT, frames_of
from bench.link_watch import LinkWatch
from bench.load_meter import LoadMeter
from bench.mode_detection import detect_mode
from protocols.canopen import BENCH_NODE, STATE_OPERATIONAL, heartbeat_id
from protocols.clock import MonotonicClock, SimulatedClock
from protocols.errors import LinkError, ProtocolError
from protocols.frame import EXTENDED
from protocols.link import WirePort
from protocols.sync import SYNC_COUNTER_OVERFLOW, SYNC_DATA, SYNC_ID, TICK_DONE_ID, TICK_NS, TICK_S

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from bench.frame_block import FrameSink
    from protocols.frame import Frame
    from protocols.link import Link, Wire

__all__ = ["BenchBus", "Mode", "detect_mode"]

Mode = Literal["lockstep", "free"]

HEARTBEAT_PERIOD_TICKS: Final = 10
SIMULATOR_DEADLINE_S: Final = 5.0
"""Wall time without an answer to SYNC after which the simulator is held for dead."""
_SLICE_S: Final = 0.1
_HEARTBEAT_ID: Final = heartbeat_id(BENCH_NODE)
_HEARTBEAT_DATA: Final = bytes([STATE_OPERATIONAL])
_FAULT_PERIOD_TICKS: Final = 10


class BenchBus:
    """Sends, receives, keeps time, and hands every frame to who asked for it.

    Parameters
    ----------
    link : Link
        The module's bus, and the rig's unless it has one of its own.
    clock : SimulatedClock or MonotonicClock
        The time of the whole bench: lock-step needs simulated time and advances it,
        free-running the machine's.
    mode : "lockstep" or "free"
    rig_link : Link, optional
        A second bus for CANopen; frames with 11-bit identifiers go there.
    bitrate : int
        Bit rate of each bus in bit/s, for the load.
    sinks : iterable of FrameSink
        Given every frame sent and received, in blocks.

    Attributes
    ----------
    tick_count : int
        Ticks since the start; the first is 1.
    cancel : CancelToken
        Looked at on every tick.
    late_ticks : int
        Free-running ticks that began more than 10 ms late.
    """

    def __init__(
        self,
        link: Link,
        clock: SimulatedClock | MonotonicClock,
        *,
        mode: Mode = "lockstep",
        rig_link: Link | None = None,
        bitrate: int = 500_000,
        sinks: Iterable[FrameSink] = (),
    ) -> None:
        self.mode: Final = mode
        self.cancel = CancelToken()
        self.tick_count = 0
        self.late_ticks = 0
        self.load = LoadMeter(bitrate, buses=1 if rig_link is None else 2)
        self._clock = clock
        self._links = (link,) if rig_link is None else (rig_link, link)
        self._module_link = link
        self._rig_link = link if rig_link is None else rig_link
        self._handlers: dict[int, Callable[[Frame], None]] = {}
        self._subscribers: dict[int, list[Callable[[Frame], None]]] = {}
        self._hooks: tuple[Callable[[], None], ...] = ()
        self._sinks = [self.load.add, *sinks]
        self._block: list[tuple[int, int, bytes]] = []
        self._counter = 0
        self._now_ns = self._start_ns = self._next_ns = clock.now_ns()
        self._watch = LinkWatch(self._links)
        self._gone = False
        self._exchange = self._exchange_for(clock)

    @property
    def now_s(self) -> float:
        """Seconds since the bus was made, on the bench's clock."""
        return (self._clock.now_ns() - self._start_ns) * 1e-9

    @property
    def now_ns(self) -> int:
        """Time of the bench's clock at the current tick, in ns: the stamp of sent frames."""
        return self._now_ns

    @property
    def start_ns(self) -> int:
        """Time of the bench's clock when the bus was made, in ns."""
        return self._start_ns

    @property
    def frames(self) -> int:
        """Frames sent and received since the start."""
        return self.load.frames + len(self._block)

    @property
    def load_percent(self) -> float:
        """Mean load of the busier bus since the start, in per cent of its bit rate."""
        self.flush()
        return self.load.percent(self.now_s)

    @property
    def load_worst_percent(self) -> float:
        """The same with worst-case bit stuffing."""
        self.flush()
        return self.load.percent(self.now_s, worst=True)

    @property
    def faults(self) -> dict[str, int]:
        """How often each kind of fault was seen on the channels (`protocols.link_faults`)."""
        return self._watch.faults

    @property
    def dropped(self) -> int:
        """Frames that this computer did not read in time and lost."""
        return self._watch.dropped

    def check_links(self) -> None:
        """Raise BusFault if a channel has reported a fault that was not raised before."""
        self._watch.check()

    def subscribe(self, can_id: int, handler: Callable[[Frame], None]) -> None:
        """Let `handler` see every received frame of an identifier; several may."""
        subscribers = self._subscribers.setdefault(can_id, [])
        subscribers.append(handler)
        self._handlers[can_id] = _one_of(tuple(subscribers))

    def unsubscribe(self, can_id: int, handler: Callable[[Frame], None]) -> None:
        """Undo `subscribe`."""
        subscribers = self._subscribers[can_id]
        subscribers.remove(handler)
        if subscribers:
            self._handlers[can_id] = _one_of(tuple(subscribers))
        else:
            del self._handlers[can_id], self._subscribers[can_id]

    def add_hook(self, hook: Callable[[], None]) -> None:
        """Call `hook` at the end of every tick, in the order of adding; it may raise."""
        self._hooks = (*self._hooks, hook)

    def remove_hook(self, hook: Callable[[], None]) -> None:
        """Undo `add_hook`."""
        self._hooks = tuple(each for each in self._hooks if each != hook)

    def add_sink(self, sink: FrameSink) -> None:
        """Give `sink` every frame from now on, in blocks."""
        self.flush()
        self._sinks.append(sink)

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame now, on the rig's bus if its identifier has 11 bits.

        Raises
        ------
        BusFault
            If the channel does not take it.
        """
        link = self._module_link if can_id & EXTENDED else self._rig_link
        try:
            link.send(can_id, data)
        except LinkError as error:
            self._watch.check()  # bus off says more than a frame that was not taken
            raise BusFault(str(error)) from error
        self._block.append((self._now_ns, can_id | SENT, data))

    def receive(self, frame: Frame) -> None:
        """Take one frame as if a link had delivered it: record it and tell its subscribers."""
        self._block.append(frame)
        handler = self._handlers.get(frame[1])
        if handler is not None:
            handler(frame)

    def tick(self) -> None:
        """Let 10 ms pass: exchange the frames of one tick, then run the hooks.

        Raises
        ------
        Aborted
            If the end of the run was asked for.
        BusFault
            If the simulator is gone, a channel fails, or a link reports lost frames.
        """
        if self.cancel.due:
            self.cancel.check()
        self.tick_count += 1
        try:
            self._exchange()
        except ProtocolError as error:  # a frame that cannot be read ends the run as well
            self._watch.check()
            raise BusFault(str(error)) from error
        if len(self._block) >= BLOCK_FRAMES:
            self.flush()
        if self.tick_count % _FAULT_PERIOD_TICKS == 0:
            self._watch.check()
        for hook in self._hooks:
            hook()

    def run_for(self, duration_s: float) -> None:
        """Tick for `duration_s` seconds of the bench's time, rounded to whole ticks."""
        for _ in range(round(duration_s / TICK_S)):
            self.tick()

    def run_until(
        self,
        condition: Callable[[], bool],
        timeout_s: float,
        what: str,
        *,
        error: Callable[[str], BenchError] = ModuleSilent,
    ) -> None:
        """Tick until `condition` holds; looked at before the first tick and after each.

        Parameters
        ----------
        condition : callable
        timeout_s : float
            Seconds of the bench's time.
        what : str
            Sentence's start for the error: "the module has not sent its status".
        error : callable
            Makes the exception from the sentence.

        Raises
        ------
        BenchError
            `error(sentence)` when the time is over.
        """
        start_s = self.now_s
        while not condition():
            if self.now_s - start_s >= timeout_s:
                message = f"{what} within {timeout_s:g} s"
                raise error(message)
            self.tick()

    def flush(self) -> None:
        """Hand the frames collected so far to the sinks; one that fails gets no more of them."""
        if not self._block:
            return
        block = frames_of(self._block)
        self._block.clear()
        failed: list[Exception] = []
        for sink in tuple(self._sinks):
            try:
                sink(block)
            except Exception as fault:  # told once: teardown must be able to tick on
                self._sinks.remove(sink)
                failed.append(fault)
        if failed:
            raise failed[0]

    def close(self) -> None:
        """Hand over the last frames and leave the bus."""
        try:
            self.flush()
        finally:
            for link in self._links:
                link.close()

    def _exchange_for(self, clock: SimulatedClock | MonotonicClock) -> Callable[[], None]:
        if self.mode == "lockstep" and isinstance(clock, SimulatedClock):
            wires = tuple(link.wire for link in self._links if isinstance(link, WirePort))
            return lambda: self._lockstep(clock, wires)
        if self.mode == "free" and isinstance(clock, MonotonicClock):
            return self._free
        message = f"a bus in mode {self.mode} cannot run on a {type(clock).__name__}"
        raise ValueError(message)

    def _open_tick(self) -> None:
        if self.tick_count % HEARTBEAT_PERIOD_TICKS == 1:
            self.send(_HEARTBEAT_ID, _HEARTBEAT_DATA)
        counter = self._counter
        self._counter = counter = counter + 1 if counter < SYNC_COUNTER_OVERFLOW else 1
        self.send(SYNC_ID, SYNC_DATA[counter])

    def _lockstep(self, clock: SimulatedClock, wires: tuple[Wire, ...]) -> None:
        clock.advance(TICK_NS)
        self._now_ns = now_ns = clock.now_ns()
        for wire in wires:
            wire.now_ns = now_ns
        self._open_tick()
        self._read_tick(self._rig_link)
        if self._module_link is not self._rig_link:
            self._drain(self._module_link)

    def _read_tick(self, link: Link) -> None:
        poll, counter = link.poll, SYNC_DATA[self._counter]
        handler_of, record = self._handlers.get, self._block.append
        while True:
            frame = poll() or self._wait_for_simulator(link)
            record(frame)
            can_id = frame[1]
            handler = handler_of(can_id)
            if handler is not None:
                handler(frame)
            elif can_id == TICK_DONE_ID and frame[2][4:5] == counter:
                return

    def _wait_for_simulator(self, link: Link) -> Frame:
        # Teardown goes on ticking after the fault: it does not wait the whole time again.
        for _ in range(1 if self._gone else round(SIMULATOR_DEADLINE_S / _SLICE_S)):
            frame = link.wait(_SLICE_S)
            if frame is not None:
                self._gone = False
                return frame
            self.cancel.check()
        self._gone = True
        self._watch.check()  # a lost tick-done frame is the channel's fault
        message = (
            f"the simulator has not answered SYNC {self._counter} of tick {self.tick_count}: "
            "it is gone or hangs; start it again"
        )
        raise BusFault(message)

    def _free(self) -> None:
        now_ns = self._clock.now_ns()
        if now_ns - self._next_ns > TICK_NS:
            self.late_ticks += 1
            self._next_ns = now_ns
        self._now_ns = now_ns
        self._next_ns += TICK_NS
        self._open_tick()
        while True:
            for link in self._links:
                self._drain(link)
            rest_s = (self._next_ns - self._clock.now_ns()) * 1e-9
            if rest_s <= 0.0:
                return
            frame = self._module_link.wait(rest_s if len(self._links) == 1 else min(rest_s, 0.001))
            if frame is not None:
                self.receive(frame)

    def _drain(self, link: Link) -> None:
        for _ in range(BLOCK_FRAMES):  # a babbling node must not stop the bench's time
            frame = link.poll()
            if frame is None:
                return
            self.receive(frame)


def _one_of(subscribers: tuple[Callable[[Frame], None], ...]) -> Callable[[Frame], None]:
    if len(subscribers) == 1:
        return subscribers[0]

    def fan_out(frame: Frame) -> None:
        for subscriber in subscribers:
            subscriber(frame)

    return fan_out
