"""Benches and virtual stations as processes of their own, on the loopback of this machine."""

from __future__ import annotations

import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
numbers = itertools.count(1)


@dataclass
class Process:
    """One command of the product that runs or has ended."""

    forge: Forge
    number: int
    out: Path
    err: Path
    code: int | None = None

    def wait(self, timeout_s: float = 60.0) -> int:
        """Return the exit code; -N where signal N ended it."""
        end_s = time.monotonic() + timeout_s
        while (code := self.ended()) is None:
            assert time.monotonic() < end_s, f"still runs:\n{self.err.read_text()}"
            time.sleep(0.005)
        return code

    def ended(self) -> int | None:
        """Return the exit code, or None while it runs."""
        if self.code is None:
            self.code = self.forge.ask({"wait": self.number})
        return self.code

    def send(self, number: int) -> None:
        os.kill(self.number, number)

    def until_it_says(self, words: str, timeout_s: float = 30.0) -> None:
        """Wait for words on its standard error."""
        end_s = time.monotonic() + timeout_s
        while words not in self.err.read_text():
            assert time.monotonic() < end_s, self.err.read_text()
            time.sleep(0.005)

    def end(self) -> None:
        if self.ended() is None:
            self.send(signal.SIGKILL)
            self.wait()


@dataclass
class Forge:
    """The process that all others are forked from."""

    server: subprocess.Popen[str]
    folder: Path
    running: list[Process] = field(default_factory=list)
    talking: threading.Lock = field(default_factory=threading.Lock)

    def ask(self, order: object) -> int | None:
        with self.talking:
            self.server.stdin.write(json.dumps(order) + "\n")
            self.server.stdin.flush()
            return json.loads(self.server.stdout.readline())

    def start(self, *argv: object, trips: tuple[dict, ...] = ()) -> Process:
        """Start `compass-bench ARGV`."""
        stem = self.folder / f"{next(numbers)}-{argv[0]}"
        out, err = stem.with_suffix(".out"), stem.with_suffix(".err")
        out.touch()
        err.touch()
        order = {"argv": [str(each) for each in argv], "out": str(out), "err": str(err)}
        process = Process(self, self.ask({**order, "trips": trips}), out, err)
        self.running.append(process)
        return process


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, str(HERE / "forge.py")],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip
    yield process
    process.stdin.close()
    assert process.wait(10) == 0
    process.stdout.close()


@pytest.fixture
def forge(server, tmp_path):
    """Return what starts commands of the product; none of them outlives the test."""
    forge = Forge(server, tmp_path)
    yield forge
    for process in forge.running:
        process.end()


@pytest.fixture(scope="session")
def new_group():
    """Return what makes multicast groups that nobody else uses."""
    return lambda: f"239.74.{os.getpid() % 250 + 1}.{next(numbers) % 250 + 1}"


@pytest.fixture
def bus(new_group):
    """Return the options of a bus of this test alone."""
    return ("--interface", "udp_multicast", "--channel", new_group())


@pytest.fixture(scope="session")
def short_procedure(tmp_path_factory):
    """Return the main job with few poses: about 40 s of simulated time."""
    path = tmp_path_factory.mktemp("procedures") / "short.yaml"
    path.write_text((HERE / "short.yaml").read_text())
    return path
