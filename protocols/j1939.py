"""J1939 identifiers and the compass module's network management (SAE J1939-21, -81)."""

from __future__ import annotations

import zlib
from typing import Final

from protocols.frame import EXTENDED

PGN_REQUEST: Final = 59904
PGN_ADDRESS_CLAIMED: Final = 60928
PGN_VEHICLE_DIRECTION: Final = 65256
GLOBAL_ADDRESS: Final = 0xFF
NULL_ADDRESS: Final = 0xFE
TESTER_ADDRESS: Final = 0xF1
"""Source address of the bench, also the UDS tester (ISO 15765-2 normal fixed addressing)."""
MODULE_ADDRESS: Final = 0x80
"""Default source address of the compass module."""


def pdu_id(priority: int, pgn: int, source: int, destination: int = GLOBAL_ADDRESS) -> int:
    """Return the CAN identifier of a parameter group, with `EXTENDED` set.

    >>> hex(pdu_id(6, 0xFF10, 0x80))
    '0x98ff1080'
    """
    pgn_field = pgn if (pgn >> 8 & 0xFF) >= 240 else (pgn & 0x3FF00) | destination
    return EXTENDED | priority << 26 | pgn_field << 8 | source


def pgn_of(can_id: int) -> int:
    """Return the parameter group number of a 29-bit identifier."""
    pgn = can_id >> 8 & 0x3FFFF
    return pgn if (pgn >> 8 & 0xFF) >= 240 else pgn & 0x3FF00


def source_of(can_id: int) -> int:
    """Return the source address of a 29-bit identifier."""
    return can_id & 0xFF


def destination_of(can_id: int) -> int:
    """Return the destination address, `GLOBAL_ADDRESS` for a broadcast group."""
    return can_id >> 8 & 0xFF if (can_id >> 16 & 0xFF) < 240 else GLOBAL_ADDRESS


def address_claimed_id(source: int) -> int:
    """Return the identifier of PGN 60928 from `source` to everybody."""
    return pdu_id(6, PGN_ADDRESS_CLAIMED, source)


def request_id(destination: int, source: int = TESTER_ADDRESS) -> int:
    """Return the identifier of PGN 59904 to `destination`."""
    return pdu_id(6, PGN_REQUEST, source, destination)


def pack_request(pgn: int) -> bytes:
    """Return the three bytes that ask for a parameter group."""
    return pgn.to_bytes(3, "little")


def identity_number(serial: str) -> int:
    """Return the 21-bit identity number of a NAME for a serial number."""
    return zlib.crc32(serial.encode("ascii")) & 0x1FFFFF


def pack_name(serial: str) -> bytes:
    """Return the 64-bit NAME: identity number, function 'magnetic compass' (vendor area).

    Manufacturer code 2047 is the one reserved for 'unassigned'; the arbitrary-address
    bit is clear, so that a duplicate address shows as an error and not as a new address.
    """
    name = identity_number(serial) | 2047 << 21 | 0x82 << 40
    return name.to_bytes(8, "little")


def identity_of_name(data: bytes) -> int:
    """Return the 21-bit identity number in an address claim."""
    return int.from_bytes(data, "little") & 0x1FFFFF
