"""The tick: CANopen SYNC with its counter, and the simulator's tick-done frame.

SYNC (CiA 301, 7.2.5) starts every cycle of 10 ms. In lock-step the simulator's host
answers it with a tick-done frame once all its devices have spoken; hardware never does.
"""

from __future__ import annotations

import struct
from typing import Final

from protocols.frame import EXTENDED

TICK_NS: Final = 10_000_000
TICK_S: Final = 0.01
SYNC_ID: Final = 0x080
SYNC_COUNTER_OVERFLOW: Final = 240
"""Object 1019h: the counter runs 1..240, so that its low four bits are the sample group."""

TICK_DONE_ID: Final = EXTENDED | 0x18FFFEFE
"""Proprietary B, PGN 0xFFFE, source address 0xFE (null): no device of the bus."""

_TICK_DONE = struct.Struct("<IB3x")


def sync_counter(tick: int) -> int:
    """Return the SYNC counter 1..240 of tick 1, 2, 3, ..."""
    return (tick - 1) % SYNC_COUNTER_OVERFLOW + 1


SYNC_DATA: Final = tuple(bytes([counter]) for counter in range(SYNC_COUNTER_OVERFLOW + 1))
"""SYNC payload by counter."""


def pack_tick_done(tick: int, counter: int) -> bytes:
    """Return the tick-done payload: the simulator's own tick count and the SYNC counter."""
    return _TICK_DONE.pack(tick & 0xFFFFFFFF, counter)


def unpack_tick_done(data: bytes) -> tuple[int, int]:
    """Return (tick count of the simulator, SYNC counter that it answers)."""
    tick, counter = _TICK_DONE.unpack(data)
    return tick, counter
