"""UDP multicast on this machine: groups apart, own frames left out, strangers ignored."""

from __future__ import annotations

import os
import socket

import can
import msgpack
import pytest

from protocols.frame import EXTENDED
from protocols.link_faults import FaultCounter
from protocols.multicast_port import MulticastPort, is_multicast_group
from protocols.pycan_link import PyCanLink

GROUP, OTHER_GROUP = "239.74.251.1", "239.74.251.2"
PORT = 45_000 + os.getpid() % 2_000  # no other run hears us
FRAMES = [(0x181, b"\x01\x02"), (EXTENDED | 0x18FF1080, bytes(range(8))), (0x7FF, b"")]


@pytest.fixture
def faults():
    return FaultCounter(GROUP)


@pytest.fixture
def open_port(faults):
    opened = []

    def open_one(group=GROUP):
        opened.append(MulticastPort(group, faults, PORT))
        return opened[-1]

    yield open_one
    for port in opened:
        port.close()


def received(port, count):
    return [port.receive(5.0) for _ in range(count)]


def test_frames_reach_the_others_of_the_group_in_order_and_not_their_sender(open_port):
    first, second, third = open_port(), open_port(), open_port()

    for can_id, data in FRAMES:
        first.send(can_id, data)

    assert received(second, 3) == FRAMES
    assert received(third, 3) == FRAMES
    assert first.receive(0.02) is None


def test_another_group_on_the_same_port_hears_nothing(open_port):
    first, second, stranger = open_port(), open_port(), open_port(OTHER_GROUP)

    first.send(*FRAMES[0])

    assert second.receive(5.0) == FRAMES[0]
    assert stranger.receive(0.02) is None


def test_nothing_leaves_this_machine(open_port):
    port = open_port()

    assert port._sender.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL) == 0
    assert port._sender.getsockname()[0] == "127.0.0.1"


def test_datagrams_that_are_no_can_frames_are_left_out(open_port):
    first, second = open_port(), open_port()
    too_long = {
        "arbitration_id": 1, "is_extended_id": False, "is_remote_frame": False,
        "is_error_frame": False, "is_fd": False, "data": bytes(9),
    }  # fmt: skip
    remote = {**too_long, "is_remote_frame": True, "data": b""}

    for datagram in (b"x", b"", msgpack.packb([1]), msgpack.packb(too_long), msgpack.packb(remote)):
        first._sender.sendto(datagram, (GROUP, PORT))
    first.send(*FRAMES[0])

    assert second.receive(5.0) == FRAMES[0]


def test_frames_that_the_kernel_drops_are_counted(open_port, faults):
    first, second = open_port(), open_port()
    second._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)

    for _ in range(2000):
        first.send(*FRAMES[1])
    while second.receive(0.0) is not None:
        pass
    first.send(*FRAMES[0])
    while second.receive(1.0) != FRAMES[0]:
        pass

    assert faults.counts["receive_dropped"] > 1000


def test_programs_on_python_cans_own_bus_hear_it_and_are_heard(open_port):
    port = open_port()
    try:
        bus = can.Bus(interface="udp_multicast", channel=GROUP, port=PORT, fd=False)
    except can.CanError as error:
        pytest.skip(f"python-can's bus needs a network here: {error}")

    with bus:
        port.send(*FRAMES[1])
        heard = bus.recv(5.0)
        bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=b"\x07"))
        answer = port.receive(5.0)

    assert (heard.arbitration_id, heard.is_extended_id) == (0x18FF1080, True)
    assert bytes(heard.data) == FRAMES[1][1]
    assert answer == (0x123, b"\x07")


@pytest.mark.parametrize(
    ("channel", "expected"),
    [
        (None, True),
        ("239.1.2.3", True),
        ("224.0.0.1", True),
        ("10.0.0.1", False),
        ("ff15::1", False),
    ],
)
def test_only_ipv4_groups_are_taken(channel, expected):
    assert is_multicast_group(channel) is expected


def test_a_link_on_a_group_uses_this_port():
    with PyCanLink("udp_multicast", GROUP, port=PORT) as link:
        assert isinstance(link._port, MulticastPort)
