"""Traffic on the bus second by second, for the record and the dashboard."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.frame_block import frame_bits_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SECOND_NS: Final = 1_000_000_000


class Traffic:
    """Counts frames and bits of each second of a run; a `FrameSink`.

    Parameters
    ----------
    bitrate : int
        Bit rate in bit/s.
    start_ns : int
        Time of the bench's clock at the start of the run.
    """

    def __init__(self, bitrate: int, start_ns: int) -> None:
        self._bitrate = bitrate
        self._start_ns = start_ns
        self._received: list[int] = []
        self._sent: list[int] = []
        self._bits: list[int] = []

    def __call__(self, frames: NDArray[np.void]) -> None:
        """Count a block, ndarray of FRAME."""
        seconds = np.maximum((frames["t_ns"] - self._start_ns) // _SECOND_NS, 0)
        length = int(seconds.max(initial=-1)) + 1
        for row in (self._received, self._sent, self._bits):
            row.extend([0] * (length - len(row)))
        bits = frame_bits_of(frames)
        for row, weights in (
            (self._received, ~frames["sent"]),
            (self._sent, frames["sent"]),
            (self._bits, bits),
        ):
            counts = np.bincount(seconds, weights=weights, minlength=length)
            for second in np.flatnonzero(counts):
                row[second] += int(counts[second])

    def rows(self) -> dict[str, list[float]]:
        """Return columns of equal length: t_s, rx_per_s, tx_per_s, load_percent.

        The last second of a run is not a whole one and left out where others are there.
        """
        length = max(len(self._bits) - 1, min(len(self._bits), 1))
        return {
            "t_s": [float(second) for second in range(length)],
            "rx_per_s": [float(count) for count in self._received[:length]],
            "tx_per_s": [float(count) for count in self._sent[:length]],
            "load_percent": [100.0 * bits / self._bitrate for bits in self._bits[:length]],
        }
