"""A controller that goes bus-off or takes no more frames, by the kernel's own slcan on a pty.

The kernel makes a real CAN interface of it, with a controller's states and a transmit queue,
which vcan has not. The adapter here passes frames on between that interface and vcan0.
"""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import socket
import struct
import subprocess
import threading
import tty
from typing import TYPE_CHECKING, Any, Self

import pytest

from bench.bus import BenchBus
from bench.errors import BusFault
from protocols.clock import MonotonicClock
from protocols.frame import EXTENDED
from protocols.pycan_link import PyCanLink

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.timeout(120),
    pytest.mark.filterwarnings("ignore:.*use of fork.*:DeprecationWarning"),
]

IN_THE_RUN = 100  # SYNC at which the controller goes bus-off

_TIOCSETD = 0x5423
_N_SLCAN = 17
_SIOCGIFNAME = 0x8910
_FRAME = struct.Struct("=IB3x8s")
_LINE = re.compile(rb"t([0-9A-F]{3})(\d)([0-9A-F]*)|T([0-9A-F]{8})(\d)([0-9A-F]*)")
_SYNC_LINE = b"t0801"


class KernelSlcan:
    """An interface of the kernel, up, and the adapter behind it in a thread.

    Raises
    ------
    OSError
        If the kernel has no slcan or this user may not attach it.
    """

    def __init__(self) -> None:
        self.bus_off_at_sync = 0
        self._syncs = 0
        self._reading = True
        self._line = b""
        self._master, self._slave = pty.openpty()
        self.channel = self._attached()
        self._quit_read, self._quit_write = os.pipe()
        self._vcan = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._vcan.bind(("vcan0",))
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def _attached(self) -> str:
        """Give the terminal to the kernel; return the name of the interface that it makes."""
        try:
            tty.setraw(self._slave)
            fcntl.ioctl(self._slave, _TIOCSETD, struct.pack("i", _N_SLCAN))
            name: bytes = fcntl.ioctl(self._slave, _SIOCGIFNAME, bytes(40))
        except OSError:
            os.close(self._slave)
            os.close(self._master)
            raise
        return name.split(b"\0")[0].decode()

    def __enter__(self) -> Self:
        self._thread.start()
        up = ["ip", "link", "set", self.channel, "up", "type", "can", "bitrate", "500000"]
        subprocess.run(up, check=True, capture_output=True)
        return self

    def __exit__(self, *_: object) -> None:
        subprocess.run(["ip", "link", "set", self.channel, "down"], check=False)
        os.write(self._quit_write, b"q")
        self._thread.join()
        self._vcan.close()
        for number in (self._slave, self._master, self._quit_read, self._quit_write):
            os.close(number)

    def stop_reading(self) -> None:
        """Take no more frames from the computer, as on a bus where nobody acknowledges."""
        self._reading = False

    def _serve(self) -> None:
        while True:
            inputs = [self._vcan, self._quit_read, *([self._master] if self._reading else [])]
            ready, _, _ = select.select(inputs, [], [], 0.05)
            if self._quit_read in ready:
                return
            if self._master in ready:
                self._to_vcan(os.read(self._master, 4096))
            if self._vcan in ready:
                can_id, length, data = _FRAME.unpack(self._vcan.recv(16))
                word = f"T{can_id & 0x1FFFFFFF:08X}" if can_id >> 31 else f"t{can_id:03X}"
                os.write(self._master, f"{word}{length}{data[:length].hex().upper()}\r".encode())

    def _to_vcan(self, received: bytes) -> None:
        *lines, self._line = (self._line + received).split(b"\r")
        for line in lines:
            if (found := _LINE.fullmatch(line)) is None:
                continue  # the kernel opens and closes its channel
            standard, short, content, extended, long, more = found.groups()
            can_id = int(standard, 16) if standard else int(extended, 16) | 1 << 31
            data = bytes.fromhex((content if standard else more).decode())
            self._vcan.send(_FRAME.pack(can_id, int(short or long), data))
            self._count(line)

    def _count(self, line: bytes) -> None:
        self._syncs += line.startswith(_SYNC_LINE)
        if line.startswith(_SYNC_LINE) and self._syncs == self.bus_off_at_sync:
            os.write(self._master, b"sb000255\r")


@pytest.fixture
def adapter() -> Iterator[KernelSlcan]:
    try:
        adapter = KernelSlcan()
    except OSError as error:
        pytest.skip(f"no slcan of the kernel: {error}")
    with adapter:
        yield adapter


def test_a_controller_that_goes_bus_off_in_the_run_is_an_error(
    station: Callable[..., AbstractContextManager[int]],
    bench_run: Callable[..., Any],
    adapter: KernelSlcan,
    tmp_path: Path,
) -> None:
    adapter.bus_off_at_sync = IN_THE_RUN

    with station():
        done = bench_run(tmp_path, channel=adapter.channel)

    assert (done.code, done.record["verdict"]["outcome"]) == (4, "ERROR")
    assert done.record["first_failure"] == "bus_fault"
    assert f"channel {adapter.channel} is bus-off" in done.record["verdict"]["reason"]
    assert done.record["bus"]["faults"]["bus_off"] == 1
    assert IN_THE_RUN - 10 < done.record["run"]["ticks"] < IN_THE_RUN + 20


def send_many(bus: BenchBus) -> None:
    for _ in range(5_000):
        bus.send(EXTENDED | 0x18DA80F1, bytes(8))


def test_a_channel_that_takes_no_more_frames_is_a_fault_of_the_bus(adapter: KernelSlcan) -> None:
    with PyCanLink("socketcan", adapter.channel) as link:
        bus = BenchBus(link, MonotonicClock(), mode="free")
        adapter.stop_reading()

        with pytest.raises(BusFault, match=r"had no room to send \d+ times \(ENOBUFS\)"):
            send_many(bus)

        assert bus.faults["send_blocked"] > 0
