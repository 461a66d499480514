"""Noise in blocks: drawn by numpy, handed out one row a tick."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK: Final = 4096
"""Rows of a block, a power of two."""


class NormalStream:
    """Standard normal numbers, one at a call."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._left: list[float] = []

    def __call__(self) -> float:
        """Return the next number."""
        if not self._left:
            self._left = self._rng.standard_normal(512).tolist()
        return self._left.pop()


def pink_block(rng: np.random.Generator, columns: int) -> NDArray[np.float64]:
    """Return 1/f noise of unit variance, shape (BLOCK, columns).

    Voss's sum of rows: row k holds its random value for 2^k samples, so that every octave
    of frequency carries the same power, from the sample rate down to one cycle a block.
    """
    octaves = BLOCK.bit_length()
    pink = np.zeros((BLOCK, columns))
    for octave in range(octaves):
        held = 1 << octave
        pink += np.repeat(rng.standard_normal((BLOCK // held, columns)), held, axis=0)
    pink /= np.sqrt(octaves)
    return pink
