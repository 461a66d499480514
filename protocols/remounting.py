"""The virtual operator: the bench asks it to put the unit into the seat in another way.

```
byte          0          1        2..7
Remount       mounting   0        0       bench to simulator
RemountDone   mounting   result   0       simulator to bench, when the unit sits
```
Both frames belong to the simulator, as tick-done does: on a real bench a person is asked instead,
and no device ever sends or reads them.
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Final

from protocols.frame import EXTENDED
from protocols.frame_layout import FrameLayout, SignalLayout

REMOUNT_ID: Final = EXTENDED | 0x18FFFDFE
"""Proprietary B, PGN 0xFFFD, source address 0xFE (null): no device of the bus."""
REMOUNT_DONE_ID: Final = EXTENDED | 0x18FFFCFE

_FRAME: Final = struct.Struct("<BB6x")


class MountCode(IntEnum):
    """How the unit is to sit: as marked, turned about down, turned over about forward."""

    AS_MARKED = 0
    TURNED = 1
    TURNED_OVER = 2


class RemountResult(IntEnum):
    """What came of it."""

    DONE = 0
    RIG_NOT_LEVEL = 1


def pack_remount(mounting: MountCode) -> bytes:
    """Return the payload that asks for a mounting."""
    return _FRAME.pack(mounting, 0)


def unpack_remount(data: bytes) -> MountCode:
    """Return the mounting that is asked for.

    Raises
    ------
    ValueError
        If the payload is not eight bytes, or names none.
    """
    return MountCode(_unpacked(data)[0])


def pack_remount_done(mounting: MountCode, result: RemountResult) -> bytes:
    """Return the payload that says what came of it."""
    return _FRAME.pack(mounting, result)


def unpack_remount_done(data: bytes) -> tuple[MountCode, RemountResult]:
    """Return (mounting, result).

    Raises
    ------
    ValueError
        If the payload is not eight bytes, or names no mounting or result.
    """
    mounting, result = _unpacked(data)
    return MountCode(mounting), RemountResult(result)


def _unpacked(data: bytes) -> tuple[int, int]:
    if len(data) != _FRAME.size:
        message = f"remount frame must have {_FRAME.size} bytes; instead received {len(data)}"
        raise ValueError(message)
    first, second = _FRAME.unpack(data)
    return first, second


def remount_frames(bench: str, simulator: str) -> tuple[FrameLayout, ...]:
    """Return the layouts of both frames."""
    mountings = {code.value: code.name.lower() for code in MountCode}
    results = {code.value: code.name.lower() for code in RemountResult}
    mounting = SignalLayout(name="Mounting", start=0, length=8, values=mountings)
    return (
        FrameLayout(
            can_id=REMOUNT_ID,
            name="Remount",
            length=8,
            sender=bench,
            receiver=simulator,
            comment="lock-step only: asks the virtual operator to remount the unit",
            signals=(mounting,),
        ),
        FrameLayout(
            can_id=REMOUNT_DONE_ID,
            name="RemountDone",
            length=8,
            sender=simulator,
            comment="lock-step only: the virtual operator has remounted the unit, or could not",
            signals=(mounting, SignalLayout(name="Result", start=8, length=8, values=results)),
        ),
    )
