from __future__ import annotations

import numpy as np
import pytest

from bench.frame_block import SENT, frame_bits_of, frames_of
from protocols.frame import EXTENDED, frame_bits
from protocols.sync import TICK_DONE_ID


def test_given_frames_of_every_length_then_the_block_holds_them_exactly():
    block = [
        (
            10**15 + n,
            (EXTENDED | 0x1FFFFFFF if n % 2 else 0x7FF) | (SENT if n % 3 else 0),
            bytes(range(n)),
        )
        for n in range(9)
    ]
    # 0x1FFFFFFF has bit 28 as its highest: SENT does not touch an identifier
    frames = frames_of(block)

    for (t_ns, can_id, data), frame in zip(block, frames, strict=True):
        assert frame["t_ns"] == t_ns
        assert frame["can_id"] == can_id & ~SENT
        assert frame["sent"] == bool(can_id & SENT)
        assert frame["data"][: frame["length"]].tobytes() == data
        assert not frame["data"][frame["length"] :].any()


def test_given_no_frames_then_an_empty_block():
    assert len(frames_of([])) == 0


@pytest.mark.parametrize("worst", [False, True])
def test_bits_are_those_of_a_single_frame(worst: bool):
    block = [(0, can_id, bytes(n)) for can_id in (0x80, EXTENDED | 0x18FF1080) for n in range(9)]

    bits = frame_bits_of(frames_of(block), worst=worst)

    expected = [frame_bits(can_id, len(data), worst=worst) for _, can_id, data in block]
    np.testing.assert_array_equal(bits, expected)


def test_the_simulators_tick_done_takes_no_bits():
    assert frame_bits_of(frames_of([(0, TICK_DONE_ID, bytes(8))])).tolist() == [0]
