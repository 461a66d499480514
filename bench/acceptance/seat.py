"""The seat between rig and unit: where it points, and what its iron adds.

A run on one seat calibrates the unit in that seat: its index would become the unit's, and the
fixture's iron part of the unit's hard iron. The station's file knows both from `verify`: the fits
see the attitudes of the seat, and take the iron out of their offsets (`calibration.fixture`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bench.calibration.fixture import SeatFound
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from bench.calibration.fixture import SeatPosition


def is_turned(seat: SeatPosition) -> bool:
    """Whether the seat's axes are not the rig's inner ones."""
    return bool(seat.index_deg or seat.pitch_deg or seat.roll_deg)


def has_iron(seat: SeatPosition) -> bool:
    """Whether the fixture adds a field."""
    return any(seat.iron_mg)


def seat_attitude(readings: NDArray[np.void], seat: SeatPosition) -> NDArray[np.float64]:
    """Return ned_from_seat, shape (n, 3, 3), of the rig's measured attitudes."""
    inner = ned_from_body(
        readings["rig_azimuth_deg"], readings["rig_pitch_deg"], readings["rig_roll_deg"]
    )
    if not is_turned(seat):
        return inner
    return inner @ ned_from_body(seat.index_deg, seat.pitch_deg, seat.roll_deg)


def seat_angles_deg(
    readings: NDArray[np.void], seat: SeatPosition
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return azimuth, pitch and roll of the seat, each shape (n,); the rig's own where square.

    The azimuth stays within half a turn of the rig's, so that wound turns are kept.
    """
    azimuth_deg = np.array(readings["rig_azimuth_deg"], dtype=float)
    if not is_turned(seat):
        pitch_deg = np.array(readings["rig_pitch_deg"], dtype=float)
        return azimuth_deg, pitch_deg, np.array(readings["rig_roll_deg"], dtype=float)
    turn = seat_attitude(readings, seat)
    own_deg = np.rad2deg(np.arctan2(turn[:, 1, 0], turn[:, 0, 0]))
    wound_deg = own_deg + 360.0 * np.round((azimuth_deg - own_deg) / 360.0)
    pitch_deg = np.rad2deg(-np.arcsin(np.clip(turn[:, 2, 0], -1.0, 1.0)))
    return wound_deg, pitch_deg, np.rad2deg(np.arctan2(turn[:, 2, 1], turn[:, 2, 2]))


def seat_of(entry: Mapping[str, Any]) -> SeatFound:
    """Return the seat of a record's station; a square one without iron where it names none."""
    forward_mg, right_mg, down_mg = entry.get("iron_mg") or (0.0, 0.0, 0.0)
    return SeatFound(
        index_deg=float(entry.get("index_deg") or 0.0),
        pitch_deg=float(entry.get("pitch_deg") or 0.0),
        roll_deg=float(entry.get("roll_deg") or 0.0),
        iron_mg=(float(forward_mg), float(right_mg), float(down_mg)),
    )
