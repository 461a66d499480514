"""Frames of the bus in bulk: what every recorder of traffic is given.

The bus keeps the frames of the last ticks as tuples and hands them on in blocks, because a
conversion of thousands at once costs a third of a microsecond a frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from protocols.frame import EXTENDED
from protocols.sync import TICK_DONE_ID

if TYPE_CHECKING:
    from numpy.typing import NDArray

SENT: Final = 0x20000000
"""Bit 29 of an identifier inside a block's tuples: the bench sent the frame."""
BLOCK_FRAMES: Final = 4096
"""Frames in a full block."""

FRAME: Final = np.dtype(
    [
        ("t_ns", "<i8"),  # the bench's clock
        ("can_id", "<u4"),  # with EXTENDED for 29 bits
        ("length", "u1"),  # 0..8
        ("sent", "?"),  # by the bench
        ("data", "u1", 8),  # padded with zeros
    ]
)

FrameSink = Callable[["NDArray[np.void]"], None]
"""Takes a block, ndarray of FRAME, shape (n,); must neither keep nor change it."""


def frames_of(block: Sequence[tuple[int, int, bytes]]) -> NDArray[np.void]:
    """Return a block as ndarray of FRAME, shape (n,).

    Parameters
    ----------
    block : sequence of (t_ns, can_id, data)
        Frames; `can_id` with `SENT` where the bench sent it.
    """
    frames = np.zeros(len(block), dtype=FRAME)
    if not block:
        return frames
    times_ns, identifiers, datas = zip(*block, strict=True)
    marked = np.array(identifiers, dtype=np.int64)
    frames["t_ns"] = times_ns
    frames["can_id"] = marked & ~SENT
    frames["sent"] = (marked & SENT) != 0
    frames["length"] = np.fromiter(map(len, datas), dtype=np.uint8, count=len(datas))
    padded = b"".join([data.ljust(8, b"\0") for data in datas])
    frames["data"] = np.frombuffer(padded, dtype=np.uint8).reshape(-1, 8)
    return frames


def frame_bits_of(frames: NDArray[np.void], *, worst: bool = False) -> NDArray[np.int64]:
    """Return the bits that each frame takes on the wire, shape (n,); 0 for tick-done frames.

    Parameters
    ----------
    frames : ndarray of FRAME, shape (n,)
    worst : bool
        With worst-case bit stuffing (ISO 11898-1), as `protocols.frame.frame_bits`.
    """
    extended = (frames["can_id"] & EXTENDED) != 0
    data_bits = 8 * frames["length"].astype(np.int64)
    bits = data_bits + np.where(extended, 67, 47)
    if worst:
        bits += (data_bits + np.where(extended, 54, 34) - 1) // 4
    return np.where(frames["can_id"] == TICK_DONE_ID, 0, bits)
