"""Raw SocketCAN below a link: the kernel's drop counter, error frames, own frames left out.

Linux kernel, Documentation/networking/can.rst. Bit 31 of struct can_frame's identifier is the
29-bit flag, as in `Frame`. The socket is told not to give back its own frames and not to take
CAN FD frames.
"""

from __future__ import annotations

import errno
import select
import socket
import time
from collections import deque
from typing import TYPE_CHECKING, Final

from protocols.link_faults import FaultCounter, LinkFault, error_frame_fault
from protocols.message_batch import SO_RXQ_OVFL, MessageBatch

if TYPE_CHECKING:
    from collections.abc import Sequence

    import can

RECEIVE_BUFFER_BYTES: Final = 8 << 20
"""Asked of the kernel; without privilege it grants its rmem_max, some hundred frames."""

_FLAG_REMOTE: Final = 0x40000000
_FLAG_ERROR: Final = 0x20000000
_ID_MASK: Final = 0x1FFFFFFF
_SO_RCVBUFFORCE: Final = 33  # include/uapi/asm-generic/socket.h
_SO_TIMESTAMPNS: Final = 35  # set by python-can; the link's clock stamps the frames
_NOTHING_NOW: Final = frozenset({errno.EAGAIN, errno.EINTR})


class SocketCanPort:
    """The socket of a python-can SocketcanBus, read and written without can.Message."""

    def __init__(self, bus: can.BusABC, faults: FaultCounter) -> None:
        self._bus = bus
        self._socket: socket.socket = bus.socket  # type: ignore[attr-defined]
        self._faults = faults
        self._drops = 0
        self._received: deque[tuple[int, bytes]] = deque()
        self._readable = select.poll()
        self._readable.register(self._socket, select.POLLIN)
        _prepare(self._socket)
        self._incoming = MessageBatch(self._socket.fileno(), controlled=True)
        self._outgoing = MessageBatch(self._socket.fileno(), controlled=False)

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame without blocking; raises OSError where the kernel does not take it."""
        self._outgoing.send(((can_id, data),))

    def send_many(self, frames: Sequence[tuple[int, bytes]]) -> int:
        """Send frames in order and return how many were taken; OSError if not even one was."""
        return self._outgoing.send(frames)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Return (identifier, data) of the next data frame, or None after the time-out."""
        received = self._received
        if received:
            return received.popleft()
        deadline_s = time.monotonic() + timeout_s if timeout_s > 0.0 else None
        while not received:
            if deadline_s is None:
                if not self._fill():
                    return None
                continue
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0 or not self._readable.poll(left_s * 1000.0):
                return None
            self._fill()
        return received.popleft()

    def close(self) -> None:
        """Shut the bus down."""
        self._bus.shutdown()

    def _fill(self) -> bool:
        """Take what waits in the kernel; whether anything did."""
        try:
            frames, drops = self._incoming.receive()
        except OSError as error:
            if error.errno in _NOTHING_NOW:
                return False
            raise
        for can_id, length, data in frames:
            if not can_id & (_FLAG_ERROR | _FLAG_REMOTE):
                self._received.append((can_id, data[:length]))
            elif can_id & _FLAG_ERROR:
                self._count_error(can_id & _ID_MASK, data)
        if drops is not None:
            self._count_drops(drops)
        return True

    def _count_drops(self, total: int) -> None:
        new = (total - self._drops) & 0xFFFFFFFF
        self._drops = total
        if new:
            self._faults.add(LinkFault.RECEIVE_DROPPED, new)

    def _count_error(self, error_class: int, data: bytes) -> None:
        fault = error_frame_fault(error_class, data)
        if fault is not None:
            self._faults.add(fault)


def _prepare(raw: socket.socket) -> None:
    raw.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, 0)
    raw.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 0)
    raw.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 0)
    raw.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
    try:
        raw.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, RECEIVE_BUFFER_BYTES)
    except PermissionError:
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
