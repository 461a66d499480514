"""Serial-line CAN adapters (slcan) without hardware: two pseudo-terminals joined as a bus."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass
class SlcanBus:
    """Paths of two adapters on one bus, and the commands that each was given."""

    paths: tuple[str, str]
    commands: tuple[list[str], list[str]]


class _Adapters(threading.Thread):
    """Answers commands as a LAWICEL CAN232 does and passes data frames to the other adapter."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._pairs = [pty.openpty(), pty.openpty()]
        for master, slave in self._pairs:
            tty.setraw(master)
            tty.setraw(slave)
        self._buffers = [b"", b""]
        self._quit_read, self._quit_write = os.pipe()
        self.commands: tuple[list[str], list[str]] = ([], [])
        self.paths = (os.ttyname(self._pairs[0][1]), os.ttyname(self._pairs[1][1]))

    def run(self) -> None:
        masters = [master for master, _ in self._pairs]
        while True:
            ready, _, _ = select.select([*masters, self._quit_read], [], [])
            if self._quit_read in ready:
                return
            for side, master in enumerate(masters):
                if master in ready:
                    self._read(side, os.read(master, 4096))

    def _read(self, side: int, data: bytes) -> None:
        *lines, self._buffers[side] = (self._buffers[side] + data).split(b"\r")
        for line in lines:
            if line[:1] in (b"t", b"T"):
                os.write(self._pairs[1 - side][0], line + b"\r")
                os.write(self._pairs[side][0], b"z\r" if line[:1] == b"t" else b"Z\r")
            else:
                self.commands[side].append(line.decode())
                os.write(self._pairs[side][0], b"\r")

    def close(self) -> None:
        os.write(self._quit_write, b"q")
        self.join()
        for descriptor in (*self._pairs[0], *self._pairs[1], self._quit_read, self._quit_write):
            os.close(descriptor)


@pytest.fixture
def slcan_bus() -> Iterator[SlcanBus]:
    """Return two emulated slcan adapters that hear each other."""
    adapters = _Adapters()
    adapters.start()
    yield SlcanBus(adapters.paths, adapters.commands)
    adapters.close()
