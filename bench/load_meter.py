"""Load of the bus from the bits of its frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.frame_block import frame_bits_of
from protocols.frame import EXTENDED

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class LoadMeter:
    """Adds up the bits on the wire.

    Where the rig has a bus of its own, 11-bit identifiers are its load and 29-bit ones the
    module's; on one bus they share it.

    Attributes
    ----------
    frames : int
        Frames counted.
    """

    def __init__(self, bitrate: int, *, buses: int = 1) -> None:
        self.bitrate = bitrate
        self.frames = 0
        self._buses = buses
        self._bits = [[0, 0], [0, 0]]  # [11 or 29 bits][nominal or worst]

    def add(self, frames: NDArray[np.void]) -> None:
        """Count a block, ndarray of FRAME."""
        self.frames += len(frames)
        extended = (frames["can_id"] & EXTENDED) != 0
        for worst in (False, True):
            bits = frame_bits_of(frames, worst=worst)
            total, of_module = int(bits.sum()), int(bits[extended].sum())
            self._bits[0][worst] += total - of_module
            self._bits[1][worst] += of_module

    def percent(self, duration_s: float, *, worst: bool = False) -> float:
        """Return the mean load of the busier bus over a duration, in per cent."""
        rig_bits, module_bits = self._bits[0][worst], self._bits[1][worst]
        bits = rig_bits + module_bits if self._buses == 1 else max(rig_bits, module_bits)
        return 100.0 * bits / (self.bitrate * duration_s) if duration_s > 0.0 else 0.0
