from __future__ import annotations

import numpy as np
import pytest

from bench.frame_block import FRAME, SENT, frames_of
from bench.traffic import Traffic
from protocols.frame import EXTENDED, frame_bits

SECOND_NS = 1_000_000_000


def test_frames_and_bits_are_counted_in_their_second() -> None:
    traffic = Traffic(500_000, start_ns=5 * SECOND_NS)
    block = [(5 * SECOND_NS + i * 100_000_000, 0x181, bytes(6)) for i in range(20)]
    block += [(6 * SECOND_NS, 0x80 | SENT, b"\1"), (7 * SECOND_NS, EXTENDED | 0x18FF1080, bytes(8))]

    traffic(frames_of(block))

    rows = traffic.rows()
    assert rows["t_s"] == [0.0, 1.0]
    assert rows["rx_per_s"] == [10.0, 10.0]
    assert rows["tx_per_s"] == [0.0, 1.0]
    bits = 10 * frame_bits(0x181, 6)
    assert rows["load_percent"][0] == pytest.approx(100.0 * bits / 500_000)
    assert rows["load_percent"][1] == pytest.approx(100.0 * (bits + frame_bits(0x80, 1)) / 500_000)


def test_blocks_add_up() -> None:
    whole, parts = Traffic(500_000, 0), Traffic(500_000, 0)
    block = [(i * 7_000_000, 0x181, bytes(6)) for i in range(1000)]

    whole(frames_of(block))
    for start in range(0, 1000, 64):
        parts(frames_of(block[start : start + 64]))

    assert whole.rows() == parts.rows()


def test_run_shorter_than_a_second_has_its_one_row() -> None:
    traffic = Traffic(500_000, 0)
    traffic(frames_of([(0, 0x80, b"\1")]))

    assert traffic.rows()["rx_per_s"] == [1.0]


def test_run_without_a_frame_has_no_rows() -> None:
    traffic = Traffic(500_000, 0)
    traffic(np.zeros(0, dtype=FRAME))

    assert traffic.rows() == {"t_s": [], "rx_per_s": [], "tx_per_s": [], "load_percent": []}
