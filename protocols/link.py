"""The seam between bench and devices: something that sends and receives CAN frames.

`Wire` is one bus inside this process: every port hears what the other ports send, in the
order in which it was sent. It carries simulated time and never blocks.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from protocols.frame import Frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence


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
        self._routes: dict[int, list[WirePort]] = {}
        self._serving = False

    def attach(self, accepts: Iterable[int] | None = None) -> WirePort:
        """Return a new port that hears all identifiers, or only those in `accepts`."""
        port = WirePort(self, None if accepts is None else frozenset(accepts))
        self._ports.append(port)
        self._routes.clear()
        return port

    def detach(self, port: WirePort) -> None:
        """Remove a port; frames that it has not read are lost."""
        if port in self._ports:
            self._ports.remove(port)
            self._routes.clear()

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

    def deliver(self, sender: WirePort, can_id: int, data: bytes) -> None:
        """Put a frame into the queue of every port but the sender's that accepts it."""
        route = self._routes.get(can_id)
        if route is None:
            route = self._routes[can_id] = [port for port in self._ports if port.hears(can_id)]
        frame = Frame(self.now_ns, can_id, data)
        for port in route:
            if port is not sender:
                port.queue.append(frame)


class WirePort:
    """A `Link` on a `Wire`."""

    def __init__(self, wire: Wire, accepts: frozenset[int] | None) -> None:
        self.wire = wire
        self.queue: deque[Frame] = deque()
        self._accepts = accepts

    def hears(self, can_id: int) -> bool:
        """Whether this port wants frames of an identifier."""
        return self._accepts is None or can_id in self._accepts

    def send(self, can_id: int, data: bytes) -> None:
        """Put a frame on the wire; never blocks."""
        self.wire.deliver(self, can_id, data)

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
