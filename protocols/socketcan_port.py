"""Raw SocketCAN below a link: struct can_frame, the kernel's drop counter, own frames left out.

Linux kernel, Documentation/networking/can.rst. `struct can_frame` is identifier and flags
(u32), length (u8), three bytes of padding and eight data bytes. Bit 31 of the identifier is
the 29-bit flag, as in `Frame`. Own frames carry MSG_CONFIRM and are left out, whatever the
socket's receive_own_messages says.
"""

from __future__ import annotations

import select
import socket
import struct
import time
from typing import TYPE_CHECKING, Final

from protocols.link_faults import FaultCounter, LinkFault, error_frame_fault

if TYPE_CHECKING:
    import can

RECEIVE_BUFFER_BYTES: Final = 8 << 20
"""Asked of the kernel; without privilege it grants its rmem_max, some hundred frames."""

_CAN_FRAME = struct.Struct("=IB3x8s")
_DROPS = struct.Struct("=I")
_FLAG_REMOTE: Final = 0x40000000
_FLAG_ERROR: Final = 0x20000000
_ID_MASK: Final = 0x1FFFFFFF
_SO_RXQ_OVFL: Final = 40  # include/uapi/asm-generic/socket.h
_SO_RCVBUFFORCE: Final = 33
_MSG_CONFIRM: Final = 0x800
_ANCILLARY_BYTES: Final = socket.CMSG_SPACE(16) + socket.CMSG_SPACE(_DROPS.size)


class SocketCanPort:
    """The socket of a python-can SocketcanBus, read and written without can.Message."""

    def __init__(self, bus: can.BusABC, faults: FaultCounter) -> None:
        self._bus = bus
        self._socket: socket.socket = bus.socket  # type: ignore[attr-defined]
        self._faults = faults
        self._drops = 0
        self._readable = select.poll()
        self._readable.register(self._socket, select.POLLIN)
        self._socket.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, RECEIVE_BUFFER_BYTES)
        except PermissionError:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame without blocking; raises OSError where the kernel does not take it."""
        self._socket.send(_CAN_FRAME.pack(can_id, len(data), data), socket.MSG_DONTWAIT)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Return (identifier, data) of the next data frame, or None after the time-out."""
        deadline_s = time.monotonic() + timeout_s if timeout_s > 0.0 else 0.0
        while True:
            try:
                received = self._take()
            except BlockingIOError:
                left_s = deadline_s - time.monotonic() if deadline_s else 0.0
                if left_s <= 0.0 or not self._readable.poll(left_s * 1000.0):
                    return None
                continue
            if received is not None:
                return received

    def _take(self) -> tuple[int, bytes] | None:
        frame, ancillary, flags, _ = self._socket.recvmsg(
            _CAN_FRAME.size, _ANCILLARY_BYTES, socket.MSG_DONTWAIT
        )
        for level, kind, payload in ancillary:
            if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL:
                self._count_drops(_DROPS.unpack_from(payload)[0])
        if flags & _MSG_CONFIRM or len(frame) != _CAN_FRAME.size:
            return None
        can_id, length, data = _CAN_FRAME.unpack(frame)
        if can_id & _FLAG_ERROR:
            self._count_error(can_id & _ID_MASK, data)
            return None
        return None if can_id & _FLAG_REMOTE else (can_id, data[:length])

    def close(self) -> None:
        """Shut the bus down."""
        self._bus.shutdown()

    def _count_drops(self, total: int) -> None:
        new = (total - self._drops) & 0xFFFFFFFF
        self._drops = total
        if new:
            self._faults.add(LinkFault.RECEIVE_DROPPED, new)

    def _count_error(self, error_class: int, data: bytes) -> None:
        fault = error_frame_fault(error_class, data)
        if fault is not None:
            self._faults.add(fault)
