"""What the vcan tests share: a second node, candump as a listener, virtual stations, a real run."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from bench.cli.run_command import RunRequest, run_procedure
from bench.cli.simulate_command import SimulateRequest, simulate_devices

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

CHANNEL = "vcan0"
LISTENERS = Path("/proc/net/can/rcvlist_all")
ROOT = Path(__file__).parents[2]
SHORT = ROOT / "tests" / "system" / "processes" / "short.yaml"


@dataclass(frozen=True)
class Done:
    """A run that has ended: its exit code and its folder."""

    code: int
    folder: Path

    @property
    def record(self) -> dict[str, Any]:
        return json.loads((self.folder / "record.json").read_text())


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


def until_more_listen(before: int) -> None:
    deadline_s = time.monotonic() + 20.0
    while listeners() <= before and time.monotonic() < deadline_s:
        time.sleep(0.01)


@pytest.fixture
def candump() -> Callable[..., AbstractContextManager[list[str]]]:
    """Return a context that records `count` frames as lines of `candump -L`."""

    @contextmanager
    def record(count: int) -> Iterator[list[str]]:
        lines: list[str] = []
        before = listeners()
        command = ["candump", "-L", "-T", "20000", "-n", str(count), CHANNEL]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            until_more_listen(before)
            yield lines
            output, _ = process.communicate(timeout=30.0)
        lines.extend(output.splitlines(keepends=True))

    return record


@contextmanager
def virtual_station(**options: Any) -> Iterator[int]:
    """Run `compass-bench simulate` on vcan0 in a fork of this process; give its number."""
    given = {
        "interface": "socketcan", "channel": CHANNEL, "bitrate": 500_000, "serial": "SN0001",
        "site": None, "seed": 1, "faults": (), "nvm": None, "replay": None, "seconds": None,
        "free_running": False, **options,
    }  # fmt: skip
    before = listeners()
    sys.stdout.flush()
    number = os.fork()
    if number == 0:
        code = 99
        try:
            code = simulate_devices(SimulateRequest(**given))
        finally:
            os._exit(code)
    try:
        until_more_listen(before)
        yield number
    finally:
        os.kill(number, signal.SIGTERM)
        _, status = os.waitpid(number, 0)
    assert os.waitstatus_to_exitcode(status) == 0


@pytest.fixture(scope="session")
def station() -> Callable[..., AbstractContextManager[int]]:
    """Return what runs a virtual rig and module on vcan0, in a process of their own."""
    return virtual_station


@pytest.fixture(scope="session")
def bench_run() -> Callable[..., Done]:
    """Return what runs a procedure on a channel, in this process."""

    def run(out: Path, procedure: Path | str = SHORT, channel: str | None = CHANNEL) -> Done:
        request = RunRequest(
            procedure=str(procedure), serial="SN0001", out=out, channel=channel,
            interface=None if channel is None else "socketcan",
            dashboard=False, no_input=True, quiet=True,
        )  # fmt: skip
        code = run_procedure(request)
        return Done(code, Path(os.path.realpath(out / "latest")))

    return run


@dataclass(frozen=True)
class Recorded:
    """A short real run in lock-step across two processes, and what candump heard of it."""

    done: Done
    log: Path


def _candump_of_the_page() -> list[str]:
    page = (ROOT / "docs" / "how-to" / "read-the-bus.md").read_text()
    return re.search(r"^(candump .*) > bus.log$", page, re.MULTILINE).group(1).split()


@pytest.fixture(scope="session")
def recorded_run(
    tmp_path_factory: pytest.TempPathFactory, bench_run: Callable[..., Done]
) -> Recorded:
    """Return a short run on vcan0 with its candump log."""
    folder = tmp_path_factory.mktemp("recorded")
    log, before = folder / "bus.log", listeners()
    with (
        log.open("w") as file,
        subprocess.Popen(_candump_of_the_page(), stdout=file) as process,
    ):
        until_more_listen(before)
        with virtual_station():
            done = bench_run(folder / "runs")
        time.sleep(0.2)
        process.terminate()
    return Recorded(done, log)
