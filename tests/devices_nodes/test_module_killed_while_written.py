"""A module process killed by SIGKILL at any frame of the coefficient write.

GIVEN a module with old coefficients in its file, WHEN its process dies after frame k of
the sequence unlock, write, read back, commit, reset, THEN the next process comes up with
the old coefficients or the new, and with the new from the commit on.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.util
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from devices.coefficient_store import CoefficientStore
from protocols import uds
from protocols.sync import SYNC_ID, TICK_DONE_ID
from protocols.uds import DEFAULT_COEFFICIENTS, pack_coefficients

HERE = Path(__file__).parent
OLD = pack_coefficients(
    dataclasses.replace(DEFAULT_COEFFICIENTS, version=1, mag_offset_mg=(1.0, 1.0, 1.0))
)
NEW = pack_coefficients(
    dataclasses.replace(
        DEFAULT_COEFFICIENTS,
        version=2,
        mag_offset_mg=(2.0, 2.0, 2.0),
        mag_matrix=(2.0,) * 9,
        accel_offset_g=(2.0,) * 3,
        accel_matrix=(2.0,) * 9,
        hk_mg=(8192.0, 0.0, 4096.0),
    )
)
REQUEST, RESPONSE = uds.physical_request_id(0x80), uds.physical_response_id(0x80)
FLOW_CONTROL = b"\x30\x00\x00"
WRITE = b"\x2e\x01\x01" + NEW
FRAMES_OF_WRITE = 1 + -(-(len(WRITE) - 6) // 7)
COMMIT_FRAME = 3 + FRAMES_OF_WRITE + 2
LAST_FRAME = COMMIT_FRAME + 1


def load_victim():
    specification = importlib.util.spec_from_file_location("victim", HERE / "victim.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def fork_module():
    """Return what starts a module process on a file: (path) -> (pid, link)."""
    link_type = load_victim().SocketLink
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    server = subprocess.Popen(
        [sys.executable, str(HERE / "victim.py"), str(far.fileno())],
        pass_fds=[far.fileno()],
        env={**os.environ, "PYTHONPATH": str(HERE.parents[1])},
    )
    far.close()

    def fork(path):
        bus, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        socket.send_fds(near, [str(path).encode()], [other.fileno()])
        other.close()
        return int(near.recv(32)), link_type(bus)

    yield fork
    near.close()
    assert server.wait(10) == 0


def kill(pid):
    """Kill a process and wait until it is gone."""
    os.kill(pid, signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError):
        while True:
            os.kill(pid, 0)
            time.sleep(0.001)


def tick(link):
    """Let one tick pass and return the data of the module's answers."""
    link.send(SYNC_ID, b"\x01")
    answers = []
    while True:
        frame = link.wait(10.0)
        assert frame is not None, "the module process hangs"
        if frame.can_id == TICK_DONE_ID:
            return answers
        if frame.can_id == RESPONSE:
            answers.append(frame.data)


def frames_of_the_sequence(link):
    """Yield after every frame sent to the module; the caller kills it where it likes."""

    def send(data):
        link.send(REQUEST, data.ljust(8, b"\xcc"))

    for payload in (b"\x10\x03", b"\x27\x01"):
        send(bytes((len(payload),)) + payload)
        yield
        answer = tick(link)
    send(b"\x06\x27\x02" + uds.security_key(answer[0][3:7]))
    yield
    assert tick(link)[0][1] == 0x67
    send(bytes((0x10, len(WRITE))) + WRITE[:6])
    yield
    answer = tick(link)
    for number, start in enumerate(range(6, len(WRITE), 7), start=1):
        send(bytes((0x20 | number & 15,)) + WRITE[start : start + 7])
        yield
        answer = tick(link)
    assert answer[-1][:4] == b"\x03\x6e\x01\x01"
    send(b"\x03\x22\x01\x01")
    yield
    tick(link)
    send(FLOW_CONTROL)
    yield
    tick(link)
    for payload in (b"\x31\x01\x02\x02", b"\x11\x01"):
        send(bytes((len(payload),)) + payload)
        yield
        assert tick(link)[0][1] == payload[0] + 0x40


def coefficients_of(link):
    """Boot a module and return the bank that it uses."""
    for _ in range(35):
        tick(link)
    link.send(REQUEST, b"\x03\x22\x01\x00".ljust(8, b"\xcc"))
    first = tick(link)[0]
    length = (first[0] & 15) << 8 | first[1]
    bank = first[2:]
    link.send(REQUEST, FLOW_CONTROL.ljust(8, b"\xcc"))
    for _ in range(3):
        bank += b"".join(data[1:] for data in tick(link))
    return bank[3:length]


@pytest.mark.parametrize("after_tick", [False, True], ids=["in the tick", "after the tick"])
@pytest.mark.parametrize("last_frame", range(LAST_FRAME + 1))
def test_a_killed_module_comes_up_with_the_old_or_the_new(
    fork_module, tmp_path, last_frame, after_tick
):
    path = tmp_path / "module.nvm"
    store = CoefficientStore(path)
    store.boot()
    store.stage(OLD)
    store.commit()
    victim, link = fork_module(path)
    for _ in range(35):
        tick(link)
    for number, _ in enumerate(frames_of_the_sequence(link)):
        if number == last_frame:
            if after_tick:
                tick(link)
            else:
                link.send(SYNC_ID, b"\x01")
            kill(victim)
            break
    else:
        pytest.fail(f"the sequence has no frame {last_frame}")
    link.close()

    _, survivor = fork_module(path)
    bank = coefficients_of(survivor)
    survivor.close()

    assert bank in (OLD, NEW)
    if last_frame < COMMIT_FRAME:
        assert bank == OLD
    elif after_tick or last_frame > COMMIT_FRAME:
        assert bank == NEW


def test_the_whole_sequence_writes_the_new(fork_module, tmp_path):
    path = tmp_path / "module.nvm"
    victim, link = fork_module(path)
    for _ in range(35):
        tick(link)
    count = sum(1 for _ in frames_of_the_sequence(link))

    assert count == LAST_FRAME + 1
    assert coefficients_of(link) == NEW
    kill(victim)
    link.close()
