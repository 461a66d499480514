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
STOPPED: Final = "stops at one value: the sensor is saturated; degauss the module"
"""What a refusal says of an axis."""


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
    held = saturated(np.asarray(field_mg, dtype=float))
    return "xyz"[int(np.argmax(held))] if held.any() else None


def saturated(field_mg: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which axes, shape (..., k), of readings (..., n, k) are held at one extreme value."""
    held = np.zeros((*field_mg.shape[:-2], field_mg.shape[-1]), dtype=bool)
    if field_mg.shape[-2] < FEWEST:
        return held
    columns = np.ascontiguousarray(np.swapaxes(field_mg, -1, -2))
    ordered = np.sort(columns, axis=-1)
    often = ordered[..., FEWEST - 1] == ordered[..., 0]
    often |= ordered[..., -FEWEST] == ordered[..., -1]
    if not often.any():
        return held
    spread = SPREAD**2 * columns.var(axis=-1).sum(axis=-1)
    for axis in range(field_mg.shape[-1]):
        others_mg = np.delete(columns, axis, axis=-2)
        for side_mg in (columns[..., axis, :], -columns[..., axis, :]):
            held[..., axis] |= _held(side_mg, others_mg, spread)
    return held


def _held(
    values_mg: NDArray[np.float64], others_mg: NDArray[np.float64], spread: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return, shape (...), whether the largest values (..., n) are held while the others vary.

    The others, shape (..., k, n), are looked at only where the largest value comes back often.
    """
    at_end = values_mg == values_mg.max(axis=-1, keepdims=True)
    count = at_end.sum(axis=-1)
    held = (count >= FEWEST) & (count < values_mg.shape[-1])
    if not held.any():
        return np.asarray(held)
    inside_mg = np.where(at_end, -np.inf, values_mg)
    beside = inside_mg == inside_mg.max(axis=-1, keepdims=True)
    mean_mg = np.where(at_end[..., None, :], others_mg, 0.0).sum(axis=-1) / count[..., None]
    off_mg = np.where(at_end[..., None, :], others_mg - mean_mg[..., None], 0.0)
    varied = (off_mg**2).sum(axis=(-2, -1)) / count > spread
    return np.asarray(held & varied & (count >= HELD_SHARE * beside.sum(axis=-1)))
