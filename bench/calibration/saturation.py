"""Whether readings stopped at the end of a converter's range."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

FEWEST: Final = 4
"""Equal extreme readings from which an axis can be called saturated."""
HELD_SHARE: Final = 3
"""So many times more often than the level beside it, or the resolution is merely coarse."""
SPREAD: Final = 0.2
"""Spread of the other two axes meanwhile, over the readings' extent. At the true extreme of a
turn it is near zero: the module then points one way."""


def saturated_axis(field_mg: NDArray[np.float64]) -> str | None:
    """Return the first axis, x, y or z, that is held at one extreme value; None if none is.

    Parameters
    ----------
    field_mg : ndarray, shape (n, 3)
        Readings, or means of readings: the mean of a wholly held dwell is the limit itself.

    Examples
    --------
    >>> turn = np.arange(0.0, 2.0 * np.pi, 0.1)
    >>> circle = 500.0 * np.column_stack([np.cos(turn), np.sin(turn), 0.3 * np.sin(2.0 * turn)])
    >>> saturated_axis(circle), saturated_axis(np.minimum(circle, [300.0, 800.0, 800.0]))
    (None, 'x')
    """
    extent_mg = float(np.sqrt(field_mg.var(axis=0).sum()))
    for axis, name in enumerate("xyz"):
        others_mg = np.delete(field_mg, axis, axis=1)
        levels, counts = np.unique(field_mg[:, axis], return_counts=True)
        for end, beside in ((0, 1), (-1, -2)):
            if len(levels) < 2 or counts[end] < max(FEWEST, HELD_SHARE * counts[beside]):
                continue
            held_mg = others_mg[field_mg[:, axis] == levels[end]]
            if float(np.sqrt(held_mg.var(axis=0).sum())) > SPREAD * extent_mg:
                return name
    return None
