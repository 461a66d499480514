"""How a golden unit can sit in the seat: as marked, or turned by 180 deg about one of its axes."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Mounting(StrEnum):
    """Where the unit's forward axis points, and which side of it is up."""

    AS_MARKED = "as_marked"
    TURNED = "turned"
    TURNED_OVER = "turned_over"


SEAT_FROM_UNIT: Final[dict[Mounting, NDArray[np.float64]]] = {
    Mounting.AS_MARKED: np.eye(3),
    Mounting.TURNED: np.diag([-1.0, -1.0, 1.0]),
    Mounting.TURNED_OVER: np.diag([1.0, -1.0, -1.0]),
}
"""Rotation with v_seat = seat_from_unit @ v_unit; each is its own inverse.

`turned` is by 180 deg about the down axis, `turned_over` about the forward axis.
"""


def nearest_mounting(turn: NDArray[np.float64]) -> tuple[Mounting, float]:
    """Return the mounting nearest to a rotation, shape (3, 3), and what is left, in degrees.

    >>> nearest_mounting(np.diag([-1.0, -1.0, 1.0]))
    (<Mounting.TURNED: 'turned'>, 0.0)
    """
    traces = {name: float(np.trace(turn.T @ own)) for name, own in SEAT_FROM_UNIT.items()}
    best = max(traces, key=lambda name: traces[name])
    cosine = min(max((traces[best] - 1.0) / 2.0, -1.0), 1.0)
    return best, float(np.rad2deg(np.arccos(cosine)))
