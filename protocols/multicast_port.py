"""UDP multicast below a link: python-can's datagrams, on this machine's loopback only.

python-can's own bus is not used. It joins the group on the interface of the default route,
so that it cannot be opened on a machine without a network, and it binds to the wildcard
address: Linux then delivers the datagrams of every group of that port (ip(7),
IP_MULTICAST_ALL), and two benches on two groups would hear each other. Here the socket is
bound to its group, joined on the loopback, and sends with a hop limit of 0. Programs on this
machine that use python-can's bus on the same group and port hear this one and are heard.

A datagram is a msgpack map with the fields of `can.Message`. Frames are sent from a socket of
their own, so that an echo is known by its sender's address.
"""

from __future__ import annotations

import ipaddress
import logging
import select
import socket
import struct
import time
from typing import Any, Final

import msgpack

from protocols.frame import EXTENDED
from protocols.link_faults import FaultCounter, LinkFault

DEFAULT_GROUP: Final = "239.74.163.2"
"""python-can's IPv4 group."""
DEFAULT_PORT: Final = 43113
"""python-can's port."""
RECEIVE_BUFFER_BYTES: Final = 4 << 20
"""Asked of the kernel, which grants no more than its rmem_max."""

_LOOPBACK: Final = socket.inet_aton("127.0.0.1")
_LONGEST_DATAGRAM: Final = 4096
_ID_MASK: Final = 0x1FFFFFFF
_SO_RXQ_OVFL: Final = 40  # include/uapi/asm-generic/socket.h
_DROPS = struct.Struct("=I")
_ANCILLARY_BYTES: Final = socket.CMSG_SPACE(_DROPS.size)

_log = logging.getLogger(f"compassbench.{__name__}")


def is_multicast_group(channel: str | int | None) -> bool:
    """Whether a channel is an IPv4 multicast address, or left to the default.

    >>> is_multicast_group("239.1.2.3"), is_multicast_group("vcan0")
    (True, False)
    """
    if channel is None:
        return True
    try:
        return ipaddress.IPv4Address(channel).is_multicast
    except ValueError:
        return False


class MulticastPort:
    """One node on a multicast group of this machine.

    Parameters
    ----------
    group : str
        IPv4 multicast address.
    faults : FaultCounter
        Is told of datagrams that the kernel dropped.
    port : int
        UDP port; python-can's by default.

    Raises
    ------
    OSError
        If the sockets cannot be made.
    """

    def __init__(self, group: str, faults: FaultCounter, port: int = DEFAULT_PORT) -> None:
        self._faults = faults
        self._drops = 0
        self._strangers = 0
        self._destination = (group, port)
        self._sender = _sending_socket()
        self._socket = _receiving_socket(group, port)
        self._own_address: tuple[str, int] = self._sender.getsockname()
        self._readable = select.poll()
        self._readable.register(self._socket, select.POLLIN)

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame; raises OSError where the kernel does not take it."""
        self._sender.sendto(_datagram(can_id, data), socket.MSG_DONTWAIT, self._destination)

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

    def close(self) -> None:
        """Leave the group."""
        self._socket.close()
        self._sender.close()

    def _take(self) -> tuple[int, bytes] | None:
        datagram, ancillary, _, sender = self._socket.recvmsg(
            _LONGEST_DATAGRAM, _ANCILLARY_BYTES, socket.MSG_DONTWAIT
        )
        for level, kind, payload in ancillary:
            if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL:
                self._count_drops(_DROPS.unpack_from(payload)[0])
        if sender == self._own_address:
            return None
        try:
            return _frame(msgpack.unpackb(datagram))
        except (ValueError, TypeError, KeyError, msgpack.UnpackException):
            self._strangers += 1
            if self._strangers == 1:
                _log.warning("%s sends datagrams that are no CAN frames: left out", sender)
            return None

    def _count_drops(self, total: int) -> None:
        new = (total - self._drops) & 0xFFFFFFFF
        self._drops = total
        if new:
            self._faults.add(LinkFault.RECEIVE_DROPPED, new)


def _sending_socket() -> socket.socket:
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _LOOPBACK)
        sender.bind(("127.0.0.1", 0))
    except OSError:
        sender.close()
        raise
    return sender


def _receiving_socket(group: str, port: int) -> socket.socket:
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        for option in (socket.SO_REUSEADDR, socket.SO_REUSEPORT, _SO_RXQ_OVFL):
            receiver.setsockopt(socket.SOL_SOCKET, option, 1)
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        receiver.bind((group, port))
        membership = socket.inet_aton(group) + _LOOPBACK
        receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    except OSError:
        receiver.close()
        raise
    return receiver


def _datagram(can_id: int, data: bytes) -> bytes:
    packed: bytes = msgpack.packb(
        {
            "timestamp": 0.0,  # whoever receives it gives it a time
            "arbitration_id": can_id & _ID_MASK,
            "is_extended_id": can_id & EXTENDED != 0,
            "is_remote_frame": False,
            "is_error_frame": False,
            "channel": None,
            "dlc": len(data),
            "data": data,
            "is_fd": False,
            "bitrate_switch": False,
            "error_state_indicator": False,
        }
    )
    return packed


def _frame(message: dict[str, Any]) -> tuple[int, bytes] | None:
    if message["is_remote_frame"] or message["is_error_frame"] or message["is_fd"]:
        return None
    data = bytes(message["data"])
    if len(data) > 8:
        sentence = f"a CAN frame must have at most 8 bytes; instead received {len(data)}"
        raise ValueError(sentence)
    extended = EXTENDED if message["is_extended_id"] else 0
    return message["arbitration_id"] & _ID_MASK | extended, data
