"""A CAN frame as the bench and the devices pass it around, and its length in bits."""

from __future__ import annotations

from typing import Final, NamedTuple

EXTENDED: Final = 0x80000000
"""Bit 31 of `can_id` marks a 29-bit identifier, as in SocketCAN and in a DBC file."""

_BITS_STANDARD: Final = 47  # ISO 11898-1 data frame without data, with 3 bits of intermission
_BITS_EXTENDED: Final = 67
_STUFFABLE_STANDARD: Final = 34  # bits before the data that take part in bit stuffing
_STUFFABLE_EXTENDED: Final = 54


class Frame(NamedTuple):
    """One classic CAN data frame.

    `t_ns` is the time of reception or sending on the clock of whoever holds the frame,
    `can_id` the identifier with `EXTENDED` set for 29 bits, `data` 0 to 8 bytes.
    """

    t_ns: int
    can_id: int
    data: bytes


def frame_bits(can_id: int, length: int, *, worst: bool = False) -> int:
    """Return the bits that a data frame takes on the wire, with worst-case stuffing if asked.

    >>> frame_bits(EXTENDED, 8), frame_bits(EXTENDED, 8, worst=True)
    (131, 160)
    >>> frame_bits(0x181, 6), frame_bits(0x181, 6, worst=True)
    (95, 115)
    """
    extended = bool(can_id & EXTENDED)
    bits = (_BITS_EXTENDED if extended else _BITS_STANDARD) + 8 * length
    if worst:
        stuffable = (_STUFFABLE_EXTENDED if extended else _STUFFABLE_STANDARD) + 8 * length
        bits += (stuffable - 1) // 4
    return bits
