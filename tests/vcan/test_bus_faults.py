"""What a channel does wrong during a run makes the run an ERROR and stands in its record."""

from __future__ import annotations

import socket
import struct
import threading
from typing import TYPE_CHECKING, Any

import pytest

from protocols import socketcan_port
from protocols.pycan_link import PyCanLink
from protocols.sync import SYNC_ID

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager
    from pathlib import Path

    Station = Callable[..., AbstractContextManager[int]]

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.timeout(120),
    pytest.mark.filterwarnings("ignore:.*use of fork.*:DeprecationWarning"),
]

ERROR_FRAME = 0x20000000
IN_THE_RUN = 100  # SYNC at which something happens


class AtSync(threading.Thread):
    """Does something in the middle of a run, seen on the bus by its SYNC frames."""

    def __init__(self, action: Callable[[], object]) -> None:
        super().__init__(daemon=True)
        self._action = action
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        only_sync = struct.pack("=II", SYNC_ID, 0xDFFFFFFF)
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, only_sync)
        self._socket.bind(("vcan0",))
        self._socket.settimeout(20.0)

    def run(self) -> None:
        with self._socket:
            for _ in range(IN_THE_RUN):
                self._socket.recv(16)
            self._action()


def assert_error(done: Any, fault: str, words: str) -> None:
    record = done.record
    assert (done.code, record["verdict"]["outcome"]) == (4, "ERROR")
    assert record["first_failure"] == "bus_fault"
    assert record["bus"]["faults"].get(fault, 0) > 0
    assert words in record["verdict"]["reason"]
    assert IN_THE_RUN < record["run"]["ticks"] < IN_THE_RUN + 2_000
    assert not record["coefficients"]


@pytest.mark.parametrize(
    ("error_class", "state", "fault", "words"),
    [
        (0x040, 0x00, "bus_off", "channel vcan0 is bus-off: check wiring"),
        (0x004, 0x20, "error_passive", "channel vcan0 is error-passive: check wiring"),
        (0x004, 0x01, "controller_overflow", "adapter's buffer was full"),
        (0x008, 0x00, "bus_error", "channel vcan0 reports 1 bus errors"),
    ],
)
def test_an_error_frame_in_the_run_is_an_error_of_its_kind(
    station: Station,
    bench_run: Callable[..., Any],
    node: socket.socket,
    raw_frame: Callable[[int, bytes], bytes],
    tmp_path: Path,
    error_class: int,
    state: int,
    fault: str,
    words: str,
) -> None:
    frame = raw_frame(ERROR_FRAME | error_class, bytes((0, state, 0, 0, 0, 0, 0, 0)))

    with station():
        AtSync(lambda: node.send(frame)).start()
        done = bench_run(tmp_path)

    assert_error(done, fault, words)
    assert done.record["bus"]["faults"] == {fault: 1}
    assert done.record["bus"]["dropped"] == 0


def test_a_warning_is_recorded_and_the_run_goes_on(
    station: Station,
    bench_run: Callable[..., Any],
    node: socket.socket,
    raw_frame: Callable[[int, bytes], bytes],
    tmp_path: Path,
) -> None:
    frame = raw_frame(ERROR_FRAME | 0x004, bytes((0, 0x08, 0, 0, 0, 0, 0, 0)))
    procedure = tmp_path / "listen.yaml"
    procedure.write_text(
        "name: listen\nversion: '1.0'\ntitle: Listen\ndescription: The bus alone.\n"
        "limits: eol_three_axis\nsteps:\n  - {kind: check_bus, name: bus, listen: 2 s}\n"
    )

    with station():
        AtSync(lambda: node.send(frame)).start()
        done = bench_run(tmp_path / "runs", procedure)

    assert (done.code, done.record["verdict"]["outcome"]) == (0, "PASS")
    assert done.record["bus"]["faults"] == {"error_warning": 1}


def test_frames_that_the_bench_did_not_read_in_time_are_an_error_and_counted(
    station: Station,
    bench_run: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    burst = [(0x555, b"\xa5" * 8)] * 64

    with station(), PyCanLink("socketcan", "vcan0") as babbler:
        monkeypatch.setattr(socketcan_port, "RECEIVE_BUFFER_BYTES", 16_384)  # some 40 frames
        AtSync(lambda: [babbler.send_all(burst) for _ in range(50)]).start()
        done = bench_run(tmp_path)

    assert_error(done, "receive_dropped", "frames because this computer did not read them in time")
    bus = done.record["bus"]
    assert bus["dropped"] == bus["faults"]["receive_dropped"] > 0
