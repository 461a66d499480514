"""Any python-can bus below a link: messages in and out, errors as OSError, own frames left out."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING, Final

import can

from protocols.frame import EXTENDED
from protocols.link_faults import FaultCounter, LinkFault, error_frame_fault

if TYPE_CHECKING:
    from collections.abc import Iterable

_ID_MASK: Final = 0x1FFFFFFF
_ECHOES_KEPT: Final = 256


class EchoFilter:
    """Recognises a node's own frames on a channel that sends them back.

    Frames come back in the order in which they were sent, or not at all. Each identifier
    has one sender on a CAN bus, so a frame is an echo if its identifier and data are among
    those sent and not yet heard; older ones of that identifier are then given up as lost.
    """

    def __init__(self) -> None:
        self._sent: dict[int, deque[bytes]] = {}

    def sent(self, can_id: int, data: bytes) -> None:
        """Remember a frame that was sent."""
        self._sent.setdefault(can_id, deque(maxlen=_ECHOES_KEPT)).append(data)

    def is_echo(self, can_id: int, data: bytes) -> bool:
        """Whether a received frame is one that was sent; it is then forgotten."""
        sent = self._sent.get(can_id)
        if not sent or data not in sent:
            return False
        while sent.popleft() != data:
            pass
        return True


class BusPort:
    """One python-can bus, of whatever interface."""

    def __init__(self, bus: can.BusABC, faults: FaultCounter, *, echoes: bool) -> None:
        self._bus = bus
        self._faults = faults
        self._echoes = EchoFilter() if echoes else None

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame; raises OSError with the driver's error number."""
        message = can.Message(
            arbitration_id=can_id & _ID_MASK, is_extended_id=bool(can_id & EXTENDED), data=data
        )
        if self._echoes is not None:
            self._echoes.sent(can_id, data)
        try:
            self._bus.send(message)
        except can.CanError as error:
            raise _os_error(error) from error

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Return (identifier, data) of the next data frame, or None after the time-out."""
        deadline_s = time.monotonic() + timeout_s
        while True:
            try:
                message = self._bus.recv(max(deadline_s - time.monotonic(), 0.0))
            except can.CanError as error:
                raise _os_error(error) from error
            if message is None:
                return None
            received = self._data_frame(message)
            if received is not None or (timeout_s > 0.0 and time.monotonic() > deadline_s):
                return received

    def _data_frame(self, message: can.Message) -> tuple[int, bytes] | None:
        if message.is_remote_frame or message.is_fd:
            return None
        if message.is_error_frame:
            self._count(error_frame_fault(message.arbitration_id, bytes(message.data)))
            return None
        can_id = message.arbitration_id | (EXTENDED if message.is_extended_id else 0)
        data = bytes(message.data)
        if self._echoes is not None and self._echoes.is_echo(can_id, data):
            return None
        return can_id, data

    def close(self) -> None:
        """Shut the bus down."""
        self._bus.shutdown()

    def _count(self, fault: LinkFault | None) -> None:
        if fault is not None:
            self._faults.add(fault)


def _os_error(error: can.CanError) -> OSError:
    return OSError(error.error_code or 0, _words(error))


def _words(error: can.CanError) -> str:
    return str(error).split(" [Error Code", maxsplit=1)[0] or type(error).__name__


def hears_itself(bus: can.BusABC, interface: str) -> bool:
    """Whether a bus gives back the frames that it sent."""
    return interface == "udp_multicast" or bool(getattr(bus, "receive_own_messages", False))


def interface_of(bus: can.BusABC, names: Iterable[tuple[str, tuple[str, str]]]) -> str:
    """Return python-can's name for the interface of an open bus, or its class's name."""
    own = type(bus)
    for name, (module, class_name) in names:
        if own.__name__ == class_name and own.__module__.startswith(module):
            return name
    return own.__name__
