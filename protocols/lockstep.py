"""python-can's view of a `Wire`: interface "lockstep".

Any program that speaks python-can (cantools' Tester, canopen, can-isotp, udsoncan) can sit
on the same wire as the bench and its devices: `can.Bus(interface="lockstep", channel="bench0")`.
"""

from __future__ import annotations

import threading
import weakref
from collections import deque
from typing import TYPE_CHECKING, Any

import can

from protocols.frame import EXTENDED, Frame
from protocols.link import Wire

if TYPE_CHECKING:
    from can.typechecking import CanFilters

_WIRES: weakref.WeakValueDictionary[str, Wire] = weakref.WeakValueDictionary()


def wire_named(channel: object) -> Wire:
    """Return the wire of a channel; made on first use, kept while somebody holds it.

    >>> wire = wire_named("bench0")
    >>> wire_named("bench0") is wire, wire_named("bench1") is wire
    (True, False)
    """
    name = str(channel)
    wire = _WIRES.get(name)
    if wire is None:
        wire = _WIRES[name] = Wire()
    return wire


class _SignallingQueue(deque[Frame]):
    """A port's queue that wakes a thread waiting for a frame."""

    def __init__(self) -> None:
        super().__init__()
        self.filled = threading.Event()

    def append(self, frame: Frame, /) -> None:
        super().append(frame)
        self.filled.set()


class LockstepBus(can.BusABC):
    """A node on a named wire.

    The thread that made the bus gives the devices on the wire their turn, after each send
    and when it finds nothing to receive. Other threads (a `can.Notifier`, a periodic task)
    only listen and speak, so that the devices never run in two threads at once.

    Raises
    ------
    can.CanOperationError
        On sending what is no classic data frame.
    """

    def __init__(
        self,
        channel: Any = "bench0",
        can_filters: CanFilters | None = None,
        **kwargs: Any,
    ) -> None:
        self.channel = channel
        self.wire = wire_named(channel)
        self.channel_info = f"lockstep channel '{channel}'"
        self._port = self.wire.attach()
        self._queue = _SignallingQueue()
        self._port.queue = self._queue
        self._owner = threading.get_ident()
        super().__init__(channel=channel, can_filters=can_filters, **kwargs)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Put a copy of a message on the wire; never blocks."""
        del timeout
        if msg.is_fd or msg.is_remote_frame or msg.is_error_frame:
            sentence = f"frame {msg.arbitration_id:X}h must be a classic data frame"
            raise can.CanOperationError(sentence)
        flag = EXTENDED if msg.is_extended_id else 0
        self._port.send(msg.arbitration_id | flag, bytes(msg.data))
        if threading.get_ident() == self._owner:
            self.wire.serve()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        frame = self._take(timeout)
        return (None if frame is None else _message(frame)), False

    def _take(self, timeout: float | None) -> Frame | None:
        queue = self._queue
        if threading.get_ident() == self._owner and not queue:
            self.wire.serve()
        queue.filled.clear()
        if not queue and timeout != 0:
            queue.filled.wait(timeout)
        return queue.popleft() if queue else None

    def shutdown(self) -> None:
        """Leave the wire; may be called twice."""
        super().shutdown()
        self._port.close()


def _message(frame: Frame) -> can.Message:
    return can.Message(
        timestamp=frame.t_ns * 1e-9,
        arbitration_id=frame.can_id & 0x1FFFFFFF,
        is_extended_id=bool(frame.can_id & EXTENDED),
        data=frame.data,
    )
