"""The seam between bench and devices: something that sends and receives CAN frames.

`Wire` is one bus inside this process: every port hears what the other ports send, in the
order in which it was sent. It carries simulated time and never blocks.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final, Protocol, runtime_checkable

from protocols.frame import Frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence


_new: Final = tuple.__new__  # a NamedTuple's own constructor takes twice as long


class Link(Protocol):
    """One node's access to a CAN bus."""

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame.

        Raises
        ------
        LinkError
            If the channel does not take it.
        """
        ...

    def poll(self) -> Frame | None:
        """Return the next received frame, or None at once if there is none."""
        ...

    def wait(self, timeout_s: float) -> Frame | None:
        """Return the next received frame, or None after `timeout_s` of wall time.

        A link on simulated time returns None at once when nobody is left to speak.
        """
        ...

    def close(self) -> None:
        """Leave the bus; may be called twice."""
        ...


@runtime_checkable
class BatchLink(Protocol):
    """A link that sends several frames at the cost of one."""

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> None:
        """Send (identifier, data) in order; raises LinkError as `Link.send`."""
        ...


class Wire:
    """One in-process bus on simulated time.

    Attributes
    ----------
    now_ns : int
        Time stamp given to frames; whoever owns the tick advances it.
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self._ports: list[WirePort] = []
        self._servers: list[Callable[[], None]] = []
        self._serving = False

    def attach(self, accepts: Iterable[int] | None = None) -> WirePort:
        """Return a new port that hears all identifiers, or only those in `accepts`."""
        port = WirePort(self, None if accepts is None else frozenset(accepts))
        self._ports.append(port)
        self._forget_routes()
        return port

    def detach(self, port: WirePort) -> None:
        """Remove a port; frames that it has not read are lost."""
        if port in self._ports:
            self._ports.remove(port)
            self._forget_routes()

    def add_server(self, serve: Callable[[], None]) -> None:
        """Let `serve` run whenever a port is polled and finds nothing.

        This is how devices in the same process get their turn without a thread.
        """
        self._servers.append(serve)

    def remove_server(self, serve: Callable[[], None]) -> None:
        """Undo `add_server`."""
        if serve in self._servers:
            self._servers.remove(serve)

    def serve(self) -> None:
        """Give every server one turn; a server that polls in turn starts no other."""
        if self._serving:
            return
        self._serving = True
        try:
            for server in self._servers:
                server()
        finally:
            self._serving = False

    def listeners(self, sender: WirePort, can_id: int) -> list[WirePort]:
        """Return the ports but the sender's that accept an identifier, in order of attaching."""
        return [port for port in self._ports if port is not sender and port.hears(can_id)]

    def _forget_routes(self) -> None:
        for port in self._ports:
            port.routes.clear()


class WirePort:
    """A `Link` on a `Wire`.

    Attributes
    ----------
    queue : deque of Frame
        Received frames that were not read yet.
    routes : dict
        By identifier, how to put a frame into each listener's queue; filled as frames are sent.
    """

    def __init__(self, wire: Wire, accepts: frozenset[int] | None) -> None:
        self.wire = wire
        self.queue: deque[Frame] = deque()
        self.routes: dict[int, tuple[Callable[[Frame], None], ...]] = {}
        self._accepts = accepts

    def hears(self, can_id: int) -> bool:
        """Whether this port wants frames of an identifier."""
        return self._accepts is None or can_id in self._accepts

    def send(self, can_id: int, data: bytes) -> None:
        """Put a frame on the wire; never blocks."""
        route = self.routes.get(can_id)
        if route is None:
            listeners = self.wire.listeners(self, can_id)
            route = self.routes[can_id] = tuple(port.queue.append for port in listeners)
        frame = _new(Frame, (self.wire.now_ns, can_id, data))
        for append in route:
            append(frame)

    def poll(self) -> Frame | None:
        """Return the next frame; the servers get a turn first if there is none."""
        queue = self.queue
        if not queue:
            self.wire.serve()
            if not queue:
                return None
        return queue.popleft()

    def wait(self, timeout_s: float) -> Frame | None:
        """Return what `poll` returns: on this bus everybody has already had a turn."""
        del timeout_s
        return self.poll()

    def close(self) -> None:
        """Leave the wire; may be called twice."""
        self.wire.detach(self)
