"""A link on real SocketCAN: frames, own frames, lost frames, error frames, dead channels."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from typing import TYPE_CHECKING

import can
import pytest

from protocols.errors import LinkError
from protocols.frame import EXTENDED
from protocols.link_faults import FaultCounter, LinkFault
from protocols.pycan_link import PyCanLink
from protocols.socketcan_port import SocketCanPort

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

pytestmark = pytest.mark.vcan

ERROR = 0x20000000
REMOTE = 0x40000000


@pytest.fixture
def link() -> Iterator[PyCanLink]:
    with PyCanLink("socketcan", "vcan0") as link:
        yield link


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


def drain(port: SocketCanPort) -> int:
    """Return how many frames a port gives before it has nothing for a tenth of a second."""
    return sum(1 for _ in iter(lambda: port.receive(0.1), None))


def test_frames_of_both_kinds_go_both_ways(link: PyCanLink) -> None:
    with PyCanLink("socketcan", "vcan0") as other:
        link.send(0x181, b"\x01\x02\x03\x04\x05\x06")
        link.send(EXTENDED | 0x18FF1080, bytes(range(8)))
        heard = [other.wait(10.0), other.wait(10.0)]
        other.send(0x080, b"\x07")
        answer = link.wait(10.0)

    assert [(frame.can_id, frame.data) for frame in heard if frame] == [
        (0x181, b"\x01\x02\x03\x04\x05\x06"),
        (EXTENDED | 0x18FF1080, bytes(range(8))),
    ]
    assert answer is not None
    assert (answer.can_id, answer.data) == (0x080, b"\x07")


@pytest.mark.parametrize("length", range(9))
def test_every_length_arrives_as_sent(link: PyCanLink, node: socket.socket, length: int) -> None:
    node.send((0x123).to_bytes(4, "little") + bytes((length, 0, 0, 0)) + b"\xa5" * 8)

    frame = link.wait(10.0)

    assert frame is not None
    assert frame.data == b"\xa5" * length


def test_own_frames_are_not_heard_even_if_the_socket_receives_them(node: socket.socket) -> None:
    bus = can.Bus(interface="socketcan", channel="vcan0", receive_own_messages=True)
    with PyCanLink.on_bus(bus) as link:
        link.send(0x111, b"\x01")
        node.send(bytes.fromhex("22010000 01000000 0200000000000000"))
        frame = link.wait(10.0)

        assert link.interface == "socketcan"
        assert frame is not None
        assert frame.can_id == 0x122
        assert link.wait(0.1) is None


def test_a_burst_is_received_whole_or_its_losses_are_counted(
    link: PyCanLink, node: socket.socket, raw_frame: Callable[[int, bytes], bytes]
) -> None:
    sent = 5_000
    for number in range(sent):
        node.send(raw_frame(0x300 + number % 256, number.to_bytes(4, "little")))
    time.sleep(0.2)
    node.send(raw_frame(0x7F0, b""))  # brings the kernel's count of what came before

    received = 0
    while (frame := link.wait(10.0)) is not None and frame.can_id != 0x7F0:
        received += 1

    assert received + link.dropped == sent
    assert (link.faults == []) == (link.dropped == 0)


def test_frames_that_the_kernel_drops_are_counted_exactly(
    node: socket.socket, raw_frame: Callable[[int, bytes], bytes]
) -> None:
    faults = FaultCounter("vcan0")
    port = SocketCanPort(can.Bus(interface="socketcan", channel="vcan0"), faults)
    port_socket = port._bus.socket  # type: ignore[attr-defined]
    port_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    for number in range(2_000):
        node.send(raw_frame(0x300, number.to_bytes(4, "little")))
    received = drain(port)
    node.send(raw_frame(0x301, b""))  # brings the kernel's count

    assert port.receive(10.0) == (0x301, b"")
    port.close()
    assert 0 < received < 2_000
    assert faults.counts[LinkFault.RECEIVE_DROPPED] == 2_000 - received
    assert faults.kinds == ["receive_dropped"]


def test_the_receive_buffer_is_larger_than_the_default() -> None:
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as plain:
        default = plain.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    bus = can.Bus(interface="socketcan", channel="vcan0")
    port = SocketCanPort(bus, FaultCounter("vcan0"))

    granted = bus.socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    port.close()

    assert granted >= 2 * default if os.geteuid() == 0 else granted >= default


def test_error_frames_are_typed_faults_and_no_data(
    link: PyCanLink, node: socket.socket, raw_frame: Callable[[int, bytes], bytes]
) -> None:
    node.send(raw_frame(ERROR | 0x004, bytes((0, 0x10, 0, 0, 0, 0, 0, 0))))
    node.send(raw_frame(ERROR | 0x040, bytes(8)))
    node.send(raw_frame(ERROR | 0x004, bytes((0, 0x01, 0, 0, 0, 0, 0, 0))))
    node.send(raw_frame(REMOTE | 0x181, b""))
    node.send(raw_frame(0x181, b"\x01"))

    frame = link.wait(10.0)

    assert frame is not None
    assert (frame.can_id, frame.data) == (0x181, b"\x01")
    assert link.faults == ["error_passive", "bus_off", "controller_overflow"]


def test_a_channel_that_does_not_exist_is_one_sentence_that_says_what_to_do() -> None:
    with pytest.raises(LinkError) as caught:
        PyCanLink("socketcan", "vcan9")

    assert str(caught.value) == (
        "channel vcan9 does not exist on interface socketcan: bring it up with "
        "`ip link add dev vcan9 type vcan && ip link set vcan9 up` "
        "or name another with --channel"
    )


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may bring an interface down")
def test_a_channel_that_goes_down_in_use_is_an_error_of_the_link() -> None:
    ip("link", "add", "dev", "vcan7", "type", "vcan")
    try:
        ip("link", "set", "vcan7", "up")
        with PyCanLink("socketcan", "vcan7") as link:
            ip("link", "set", "vcan7", "down")

            with pytest.raises(LinkError, match=r"vcan7 .* cannot be read: Network is down"):
                link.wait(10.0)
            with pytest.raises(LinkError, match="Network is down"):
                link.send(0x181, b"")
    finally:
        ip("link", "delete", "vcan7")


def test_closing_takes_no_longer_than_the_reader_looks_up() -> None:
    link = PyCanLink("socketcan", "vcan0")
    start_s = time.monotonic()

    link.close()

    assert time.monotonic() - start_s < 2.0
