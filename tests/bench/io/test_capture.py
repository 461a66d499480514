from __future__ import annotations

import shutil
import subprocess
from datetime import UTC, datetime

import can
import numpy as np
import pytest

from bench.capture import Capture
from bench.errors import BenchNotReady
from bench.frame_block import SENT, frames_of
from protocols.frame import EXTENDED


def random_block(count: int, seed: int = 1) -> list[tuple[int, int, bytes]]:
    rng = np.random.default_rng(seed)
    block = []
    for number in range(count):
        extended = rng.random() < 0.5
        can_id = int(rng.integers(2**29)) | EXTENDED if extended else int(rng.integers(2**11))
        sent = SENT if rng.random() < 0.3 else 0
        data = rng.bytes(int(rng.integers(9)))
        block.append((number * 1_234_567, can_id | sent, data))
    return block


def test_given_random_frames_when_read_by_python_can_then_all_are_equal(tmp_path):
    block = random_block(7000)
    with Capture(tmp_path / "bus.blf") as capture:
        capture(frames_of(block[:100]))
        capture(frames_of(block[100:]))

    with can.BLFReader(str(tmp_path / "bus.blf")) as reader:
        assert reader.object_count == len(block)
        messages = list(reader)
    assert len(messages) == len(block)
    for (t_ns, can_id, data), message in zip(block, messages, strict=True):
        assert message.arbitration_id == can_id & 0x1FFFFFFF & (~SENT)
        assert message.is_extended_id == bool(can_id & EXTENDED)
        assert message.is_rx == (not can_id & SENT)
        assert bytes(message.data) == data
        assert message.timestamp == pytest.approx(t_ns * 1e-9, abs=1e-9)


def test_given_a_start_then_times_count_from_it_and_the_date_is_kept(tmp_path):
    started = datetime(2026, 11, 22, 3, 4, 5, 678000, tzinfo=UTC)
    with Capture(tmp_path / "bus.blf", start_ns=5_000, started=started) as capture:
        capture(frames_of([(5_250, 0x80, b"\x01")]))

    with can.BLFReader(str(tmp_path / "bus.blf")) as reader:
        (message,) = list(reader)
    assert message.timestamp - started.timestamp() == pytest.approx(250e-9, abs=1e-6)


def test_given_the_same_frames_then_the_same_bytes(tmp_path):
    for name in ("a.blf", "b.blf"):
        with Capture(tmp_path / name) as capture:
            capture(frames_of(random_block(500)))

    assert (tmp_path / "a.blf").read_bytes() == (tmp_path / "b.blf").read_bytes()


def test_given_a_run_that_was_killed_then_what_was_written_can_be_read(tmp_path):
    capture = Capture(tmp_path / "bus.blf")
    capture(frames_of(random_block(3000)))
    capture._file.flush()
    shutil.copy(tmp_path / "bus.blf", tmp_path / "killed.blf")
    capture.close()
    capture.close()

    with can.BLFReader(str(tmp_path / "killed.blf")) as reader:
        assert len(list(reader)) == 3000


def test_given_no_such_folder_then_one_sentence(tmp_path):
    with pytest.raises(BenchNotReady, match="cannot be written"):
        Capture(tmp_path / "nowhere" / "bus.blf")


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_the_capture(tmp_path):
    block = [(n * 10_000_000, 0x80, bytes([n])) for n in range(1, 6)]
    with Capture(tmp_path / "bus.blf") as capture:
        capture(frames_of(block))

    shown = subprocess.run(
        ["tshark", "-r", str(tmp_path / "bus.blf"), "-T", "fields", "-e", "can.id", "-e", "data"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split("\n")
    assert len([line for line in shown if line.startswith("128")]) == 5
