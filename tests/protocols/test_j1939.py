"""J1939 identifiers and NAMEs, worked out by hand from SAE J1939-21 and -81."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols import j1939
from protocols.frame import EXTENDED


@pytest.mark.parametrize(
    ("can_id", "by_hand"),
    [
        # priority 6 = 110b, reserved 0, data page 0: 0x18; PF FF, PS 10, SA 80
        (j1939.pdu_id(6, 0xFF10, 0x80), 0x18FF1080),
        # VDS: PGN 65256 = FEE8h
        (j1939.pdu_id(6, 65256, 0x80), 0x18FEE880),
        # address claimed: PF EE to everybody
        (j1939.address_claimed_id(0x80), 0x18EEFF80),
        # request: PF EA, PS = destination
        (j1939.request_id(0x80), 0x18EA80F1),
        (j1939.request_id(j1939.GLOBAL_ADDRESS, 0xFE), 0x18EAFFFE),
        # priority 3 and data page 1, destination-specific
        (j1939.pdu_id(3, 0x1EF00, 0x01, 0x42), 0x0DEF4201),
    ],
)
def test_identifiers_are_those_worked_out_by_hand(can_id: int, by_hand: int) -> None:
    assert can_id == EXTENDED | by_hand


@given(st.integers(0, 7), st.integers(0, 0x3FFFF), st.integers(0, 255), st.integers(0, 255))
def test_identifier_gives_back_group_source_and_destination(
    priority: int, pgn: int, source: int, destination: int
) -> None:
    broadcast = pgn >> 8 & 0xFF >= 240
    pgn = pgn if broadcast else pgn & 0x3FF00

    can_id = j1939.pdu_id(priority, pgn, source, destination)

    assert j1939.pgn_of(can_id) == pgn
    assert j1939.source_of(can_id) == source
    assert j1939.destination_of(can_id) == (0xFF if broadcast else destination)
    assert can_id >> 26 & 7 == priority


def test_group_239_is_addressed_and_240_is_broadcast() -> None:
    assert j1939.destination_of(j1939.pdu_id(6, 0xEF00, 0x80, 0x11)) == 0x11
    assert j1939.destination_of(j1939.pdu_id(6, 0xF000, 0x80, 0x11)) == j1939.GLOBAL_ADDRESS


def test_request_asks_for_a_group_with_its_low_byte_first() -> None:
    assert j1939.pack_request(j1939.PGN_ADDRESS_CLAIMED) == bytes.fromhex("00EE00")


def test_name_has_identity_manufacturer_and_function_in_their_bits() -> None:
    name = int.from_bytes(j1939.pack_name("SN-0001"), "little")

    assert name & 0x1FFFFF == j1939.identity_number("SN-0001")
    assert name >> 21 & 0x7FF == 2047
    assert name >> 40 & 0xFF == 0x82
    assert name >> 63 == 0  # arbitrary-address capable


def test_identity_comes_back_out_of_the_name() -> None:
    for serial in ("", "SN-0001", "SN-0002", "Z" * 30):
        identity = j1939.identity_of_name(j1939.pack_name(serial))
        assert identity == j1939.identity_number(serial) <= 0x1FFFFF


def test_two_serials_have_two_names() -> None:
    names = {j1939.pack_name(f"SN-{number:04d}") for number in range(200)}

    assert len(names) == 200


def test_the_low_byte_belongs_to_the_group_from_format_240_on() -> None:
    assert j1939.pgn_of(j1939.pdu_id(6, 0xF011, 0x80)) == 0xF011
    assert j1939.pgn_of(j1939.pdu_id(6, 0xEF00, 0x80, 0x11)) == 0xEF00
