"""Many CAN frames by one system call: recvmmsg(2) and sendmmsg(2), which Python does not offer.

A tick is some ten frames. One call for all of them costs about as much as one for each, and
whoever waits for them is woken once.
"""

from __future__ import annotations

import ctypes
import os
import socket
import struct
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

FRAMES: Final = 64
"""Frames that one call takes or gives at most."""
SO_RXQ_OVFL: Final = 40  # include/uapi/asm-generic/socket.h

_CAN_FRAME: Final = struct.Struct("=IB3x8s")  # include/uapi/linux/can.h, struct can_frame
_DROPS: Final = struct.Struct("@NiiI")  # struct cmsghdr and the kernel's count of lost frames
_CONTROL_BYTES: Final = socket.CMSG_SPACE(4)


class _Vector(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Header(ctypes.Structure):
    """struct user_msghdr of the kernel."""

    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("vectors", ctypes.c_void_p),
        ("vector_count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _Message(ctypes.Structure):
    """struct mmsghdr of the kernel."""

    _fields_ = (("header", _Header), ("length", ctypes.c_uint32))


class MessageBatch:
    """Room for `FRAMES` frames, and the two calls that fill it from a socket or empty it there.

    Parameters
    ----------
    socket_number : int
        File descriptor of a raw CAN socket without FD frames.
    controlled : bool
        Whether to ask for the kernel's count of dropped frames: for a batch that receives.
    """

    def __init__(self, socket_number: int, *, controlled: bool) -> None:
        self._number = socket_number
        self._frames = (ctypes.c_char * (FRAMES * _CAN_FRAME.size))()
        self._controls = (ctypes.c_char * (FRAMES * _CONTROL_BYTES))()
        self._vectors = (_Vector * FRAMES)()
        self._messages = (_Message * FRAMES)()
        for index, (message, vector) in enumerate(zip(self._messages, self._vectors, strict=True)):
            vector.base = ctypes.addressof(self._frames) + index * _CAN_FRAME.size
            vector.length = _CAN_FRAME.size
            header = message.header
            header.vectors = ctypes.addressof(vector)
            header.vector_count = 1
            if controlled:
                header.control = ctypes.addressof(self._controls) + index * _CONTROL_BYTES
                header.control_length = _CONTROL_BYTES
        self._fresh = bytes(self._messages)
        library = ctypes.CDLL(None, use_errno=True)
        self._recvmmsg = library.recvmmsg
        self._sendmmsg = library.sendmmsg

    def receive(self) -> tuple[list[tuple[int, int, bytes]], int | None]:
        """Take every frame that waits, up to `FRAMES`; never blocks.

        Returns
        -------
        list of (identifier with its flags, length, 8 bytes)
        int or None
            How many frames the kernel has dropped since the socket was opened, modulo 2**32;
            None while it has dropped none.

        Raises
        ------
        OSError
            BlockingIOError if no frame waits.
        """
        ctypes.memmove(self._messages, self._fresh, len(self._fresh))
        count = self._recvmmsg(self._number, self._messages, FRAMES, socket.MSG_DONTWAIT, None)
        if count < 0:
            raise _last_error()
        view = memoryview(self._frames)[: count * _CAN_FRAME.size]
        return list(_CAN_FRAME.iter_unpack(view)), self._drops(count - 1)

    def send(self, frames: Sequence[tuple[int, bytes]]) -> int:
        """Send (identifier, data) in order without blocking; return how many were taken.

        Raises
        ------
        OSError
            If not even the first one was.
        """
        count = min(len(frames), FRAMES)
        for index, (can_id, data) in enumerate(frames[:count]):
            _CAN_FRAME.pack_into(self._frames, index * _CAN_FRAME.size, can_id, len(data), data)
        taken = self._sendmmsg(self._number, self._messages, count, socket.MSG_DONTWAIT)
        if taken < 0:
            raise _last_error()
        return int(taken)

    def _drops(self, last: int) -> int | None:
        if last < 0 or self._messages[last].header.control_length < _DROPS.size:
            return None
        *_, kind, dropped = _DROPS.unpack_from(self._controls, last * _CONTROL_BYTES)
        return int(dropped) if kind == SO_RXQ_OVFL else None


def _last_error() -> OSError:
    number = ctypes.get_errno()
    return OSError(number, os.strerror(number))
