"""Frames in batches, over a pair of datagram sockets in the place of a CAN interface."""

from __future__ import annotations

import os
import socket
import struct
from typing import TYPE_CHECKING

import pytest

from protocols.frame import EXTENDED
from protocols.message_batch import FRAMES, MessageBatch

if TYPE_CHECKING:
    from collections.abc import Iterator

Pair = tuple[MessageBatch, MessageBatch, socket.socket]


@pytest.fixture
def pair() -> Iterator[Pair]:
    """Return a sending and a receiving batch, and the sending socket."""
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with near, far:
        yield (
            MessageBatch(near.fileno(), controlled=False),
            MessageBatch(far.fileno(), controlled=True),
            near,
        )


def test_what_waits_comes_in_order_by_one_call(pair: Pair) -> None:
    sender, receiver, _ = pair
    frames = [(0x100 + n, bytes(range(n))) for n in range(8)] + [(EXTENDED | 0x18FF1080, b"\xff")]

    assert sender.send(frames) == 9
    received, drops = receiver.receive()

    assert [(can_id, data[:length]) for can_id, length, data in received] == frames
    assert drops is None


def test_the_bytes_are_those_of_struct_can_frame(pair: Pair) -> None:
    sender, receiver, near = pair
    near.send(struct.pack("=IB3x8s", 0x123, 2, b"\x01\x02"))

    assert receiver.receive() == ([(0x123, 2, b"\x01\x02" + bytes(6))], None)
    assert sender.send([(0x7FF, b"")]) == 1
    assert receiver.receive() == ([(0x7FF, 0, bytes(8))], None)


def test_an_earlier_batch_leaves_nothing_in_a_later_one(pair: Pair) -> None:
    sender, receiver, _ = pair
    sender.send([(0x111, b"\xff" * 8)] * FRAMES)
    assert len(receiver.receive()[0]) == FRAMES

    sender.send([(0x112, b"\x01")])

    assert receiver.receive()[0] == [(0x112, 1, b"\x01" + bytes(7))]


def test_receiving_nothing_does_not_block(pair: Pair) -> None:
    with pytest.raises(BlockingIOError):
        pair[1].receive()


def test_more_than_the_kernel_takes_is_sent_in_part_and_then_refused(pair: Pair) -> None:
    sender, receiver, _ = pair
    batch = [(0x100, b"")] * (FRAMES + 1)
    taken = sent = sender.send(batch)
    while sent == FRAMES:
        taken += (sent := sender.send(batch))

    with pytest.raises(BlockingIOError):
        sender.send(batch)
    received = 0
    while received < taken:
        received += len(receiver.receive()[0])
    assert received == taken
    with pytest.raises(BlockingIOError):
        receiver.receive()


def test_a_closed_socket_is_an_error_of_the_system() -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    batch = MessageBatch(near.fileno(), controlled=True)
    near.close()
    far.close()

    with pytest.raises(OSError, match=os.strerror(9)):
        batch.receive()
    with pytest.raises(OSError, match=os.strerror(9)):
        batch.send([(1, b"")])
