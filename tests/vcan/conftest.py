"""What the vcan tests share: raw sockets of a second node, and candump as a listener."""

from __future__ import annotations

import socket
import struct
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

CHANNEL = "vcan0"
LISTENERS = Path("/proc/net/can/rcvlist_all")


@pytest.fixture
def node() -> Iterator[socket.socket]:
    """Return a raw socket of another node on the channel."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
        raw.bind((CHANNEL,))
        raw.settimeout(10.0)
        yield raw


@pytest.fixture
def raw_frame() -> Callable[[int, bytes], bytes]:
    """Return struct can_frame of an identifier with its flags and data."""

    def pack(can_id: int, data: bytes) -> bytes:
        return struct.pack("=IB3x8s", can_id, len(data), data)

    return pack


def listeners() -> int:
    """Return how many sockets listen to everything on the channel."""
    return LISTENERS.read_text().count(f"{CHANNEL} ")


@pytest.fixture
def candump() -> Callable[..., contextmanager[list[str]]]:
    """Return a context that records `count` frames as lines of `candump -L`."""

    @contextmanager
    def record(count: int) -> Iterator[list[str]]:
        lines: list[str] = []
        before = listeners()
        command = ["candump", "-L", "-T", "20000", "-n", str(count), CHANNEL]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            deadline_s = time.monotonic() + 20.0
            while listeners() <= before and time.monotonic() < deadline_s:
                time.sleep(0.01)
            yield lines
            output, _ = process.communicate(timeout=30.0)
        lines.extend(output.splitlines(keepends=True))

    return record
