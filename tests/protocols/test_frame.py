"""Bit counts of ISO 11898-1, added up by hand from its frame format."""

from __future__ import annotations

import pytest

from protocols.frame import EXTENDED, Frame, frame_bits

# SOF 1, identifier 11, RTR 1, IDE 1, r0 1, DLC 4, CRC 15 + delimiter 1, ACK 2, EOF 7, interframe 3
STANDARD_BITS = 1 + 11 + 1 + 1 + 1 + 4 + 15 + 1 + 2 + 7 + 3
# and SRR 1, 18 more bits of identifier, one more reserved bit
EXTENDED_BITS = STANDARD_BITS + 1 + 18 + 1


@pytest.mark.parametrize("length", range(9))
def test_nominal_bits_are_the_fields_of_the_frame(length: int) -> None:
    assert frame_bits(0x123, length) == STANDARD_BITS + 8 * length
    assert frame_bits(EXTENDED | 0x123, length) == EXTENDED_BITS + 8 * length


@pytest.mark.parametrize("length", range(9))
def test_worst_case_adds_one_bit_after_every_four_of_the_stuffed_part(length: int) -> None:
    # SOF to CRC sequence is stuffed: a run of five costs a bit, then every four more
    standard = 1 + 11 + 3 + 4 + 15 + 8 * length
    extended = standard + 20

    assert frame_bits(1, length, worst=True) == frame_bits(1, length) + (standard - 1) // 4
    id_29 = EXTENDED | 1
    assert frame_bits(id_29, length, worst=True) == frame_bits(id_29, length) + (extended - 1) // 4


def test_frames_compare_by_value() -> None:
    assert Frame(5, 0x80, b"\x01") == Frame(5, 0x80, b"\x01")
    assert Frame(5, 0x80, b"\x01") != Frame(5, 0x80 | EXTENDED, b"\x01")
