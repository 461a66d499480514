"""A `Link` over any adapter that python-can knows.

Whoever polls or waits reads the channel itself, because handing each frame from thread to
thread would cost most of the time of a tick. While the bench is busy with something else, a
reader thread empties the channel into a queue every few milliseconds, so that nothing is
lost. python-can's own Notifier is not used: it stops silently at the first exception of a
listener. Linux SocketCAN is read and written directly (`socketcan_port`): python-can's
reader would hide the kernel's drop counter.
"""

from __future__ import annotations

import errno
import threading
import time
from collections import deque
from typing import TYPE_CHECKING, Any, Final, Protocol, Self

from protocols.clock import Clock, MonotonicClock
from protocols.errors import LinkError
from protocols.frame import Frame
from protocols.link_faults import FaultCounter, LinkFault

if TYPE_CHECKING:
    from collections.abc import Sequence

    import can

SEND_DEADLINE_S: Final = 1.0
"""How long a full transmit queue is waited for."""
READER_PERIOD_S: Final = 0.005
"""The reader thread empties the channel this often; time stamps are late by no more."""
THREADLESS_INTERFACES: Final = frozenset({"virtual", "lockstep"})
"""In-process interfaces whose queue has no end: read by whoever polls."""

_RETRIED: Final = frozenset({errno.ENOBUFS, errno.EAGAIN})


class Port(Protocol):
    """The raw side of a link: one channel's driver."""

    def send(self, can_id: int, data: bytes) -> None:
        """Send once; raises OSError with ENOBUFS or EAGAIN where trying again helps."""
        ...

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Return (identifier, data) of the next data frame, or None after the time-out."""
        ...

    def close(self) -> None:
        """Release the channel."""
        ...


class PyCanLink:
    """A `Link` on a channel of a python-can interface.

    Parameters
    ----------
    interface : str
        python-can's name of the interface: "socketcan", "slcan", "virtual", "udp_multicast", ...
    channel : str or int or None
        python-can's name of the channel; None takes it from python-can's configuration.
    bitrate : int
        Bit rate in bit/s, where the interface sets it.
    clock : Clock, optional
        Gives each frame its time at reception; the machine's monotonic clock by default.
    **bus_kwargs
        Passed to `can.Bus`.

    Attributes
    ----------
    clock : Clock
        May be replaced: a bench in lock-step stamps frames with simulated time.

    Raises
    ------
    LinkError
        If the interface or the channel does not exist or cannot be opened.
    """

    def __init__(
        self,
        interface: str,
        channel: str | int | None,
        *,
        bitrate: int = 500_000,
        clock: Clock | None = None,
        **bus_kwargs: Any,
    ) -> None:
        from protocols.bus_opening import open_port

        faults = FaultCounter(str(channel))
        port = open_port(interface, channel, bitrate, bus_kwargs, faults)
        self._start(port, faults, interface, str(channel), clock)

    @classmethod
    def on_bus(
        cls, bus: can.BusABC, *, interface: str | None = None, clock: Clock | None = None
    ) -> Self:
        """Return a link on a bus that is open already; closing the link shuts the bus down.

        `interface` is python-can's name of the bus's interface, found from its module if
        not given.
        """
        from protocols.bus_opening import port_on

        link = cls.__new__(cls)
        name, channel = interface or _interface_of(bus), bus.channel_info
        faults = FaultCounter(channel)
        link._start(port_on(bus, name, faults), faults, name, channel, clock)  # noqa: SLF001
        return link

    def _start(
        self, port: Port, faults: FaultCounter, interface: str, channel: str, clock: Clock | None
    ) -> None:
        self.interface = interface
        self.channel = channel
        self.clock: Clock = clock if clock is not None else MonotonicClock()
        self._faults = faults
        self._port = port
        self._queue: deque[Frame] = deque()
        self._reading = threading.Lock()
        self._failure: LinkError | None = None
        self._closing = threading.Event()
        self._reader: threading.Thread | None = None
        if interface not in THREADLESS_INTERFACES:
            self._reader = threading.Thread(target=self._read, name=f"can {channel}", daemon=True)
            self._reader.start()

    @property
    def faults(self) -> list[str]:
        """Kinds of `LinkFault` seen so far, in the order of their first appearance."""
        return list(self._faults.kinds)

    @property
    def fault_counts(self) -> dict[str, int]:
        """How often each kind of fault was seen."""
        return {str(fault): count for fault, count in self._faults.counts.items()}

    @property
    def dropped(self) -> int:
        """Frames that the kernel threw away because its receive buffer was full."""
        return self._faults.counts[LinkFault.RECEIVE_DROPPED]

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame; waits up to `SEND_DEADLINE_S` for a full transmit queue.

        Raises
        ------
        LinkError
            If the channel does not take the frame, or its reader has failed.
        """
        self._check()
        try:
            self._port.send(can_id, data)
            return
        except OSError as error:
            if error.errno not in _RETRIED:
                raise LinkError(self._sentence("refuses a frame", error)) from error
        self._faults.add(LinkFault.SEND_BLOCKED)
        self._send_when_free(can_id, data)

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> None:
        """Send (identifier, data) in order, by one system call where the port can.

        Raises
        ------
        LinkError
            As `send`.
        """
        send_many = getattr(self._port, "send_many", None)
        if send_many is None:
            for frame in frames:
                self.send(*frame)
            return
        self._check()
        while frames:
            try:
                sent = send_many(frames)
            except OSError as error:
                if error.errno not in _RETRIED:
                    raise LinkError(self._sentence("refuses a frame", error)) from error
                self._faults.add(LinkFault.SEND_BLOCKED)
                self._send_when_free(*frames[0])
                sent = 1
            frames = frames[sent:]

    def poll(self) -> Frame | None:
        """Return the next received frame, or None at once if there is none."""
        return self._next(0.0)

    def wait(self, timeout_s: float) -> Frame | None:
        """Return the next received frame, or None after `timeout_s` of wall time."""
        return self._next(timeout_s)

    def close(self) -> None:
        """Leave the bus; may be called twice."""
        if self._closing.is_set():
            return
        self._closing.set()
        if self._reader is not None:
            self._reader.join()
        self._port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _send_when_free(self, can_id: int, data: bytes) -> None:
        deadline_s = time.monotonic() + SEND_DEADLINE_S
        while True:
            time.sleep(0.0005)
            try:
                self._port.send(can_id, data)
                return
            except OSError as error:
                if error.errno not in _RETRIED or time.monotonic() > deadline_s:
                    waited = f"took no frame for {SEND_DEADLINE_S:g} s"
                    raise LinkError(self._sentence(waited, error)) from error

    def _next(self, timeout_s: float) -> Frame | None:
        if not self._queue:
            self._check()
            with self._reading:
                if not self._queue:
                    return self._receive(timeout_s)
        return self._queue.popleft()

    def _receive(self, timeout_s: float) -> Frame | None:
        try:
            received = self._port.receive(timeout_s)
        except OSError as error:
            self._failure = LinkError(self._sentence("cannot be read", error))
            raise self._failure from error
        return None if received is None else Frame(self.clock.now_ns(), *received)

    def _read(self) -> None:
        while not self._closing.wait(READER_PERIOD_S):
            if not self._reading.acquire(blocking=False):
                continue  # somebody is reading just now
            try:
                self._empty()
            except LinkError:  # whoever reads or sends next is told
                return
            finally:
                self._reading.release()

    def _empty(self) -> None:
        while not self._closing.is_set():
            frame = self._receive(0.0)
            if frame is None:
                return
            self._queue.append(frame)

    def _check(self) -> None:
        if self._closing.is_set():
            sentence = f"channel {self.channel} is closed: open a new link"
            raise LinkError(sentence)
        if self._failure is not None:
            raise self._failure

    def _sentence(self, what: str, error: OSError) -> str:
        reason = error.strerror or str(error)
        return (
            f"channel {self.channel} on interface {self.interface} {what}: {reason}; "
            "check that it is up, wired, terminated and that another node acknowledges"
        )


def _interface_of(bus: can.BusABC) -> str:
    from can.interfaces import BACKENDS

    from protocols.bus_port import interface_of

    return interface_of(bus, BACKENDS.items())
