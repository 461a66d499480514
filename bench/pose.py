"""A pose of the rig and the purpose for which a step visits it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from protocols.angles import wrap_180_deg

SAME_POSE_DEG: Final = 1.0
"""Attitudes whose angles all differ by less are one pose."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Attitude of the seat: heading clockwise from the rig's zero, pitch nose up, roll right down.

    ned_from_body = Rz(azimuth) Ry(pitch) Rx(roll), intrinsic z-y-x.
    """

    azimuth_deg: float
    pitch_deg: float = 0.0
    roll_deg: float = 0.0

    def is_at(self, other: Attitude) -> bool:
        """Whether both are one pose.

        >>> Attitude(azimuth_deg=359.9).is_at(Attitude(azimuth_deg=0.0))
        True
        """
        turns_deg = (
            float(wrap_180_deg(self.azimuth_deg - other.azimuth_deg)),
            self.pitch_deg - other.pitch_deg,
            self.roll_deg - other.roll_deg,
        )
        return all(abs(turn_deg) < SAME_POSE_DEG for turn_deg in turns_deg)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """One dwell of a run.

    `position` counts the dwells of a run from 0; `step` is the name of the procedure's
    step; `direction` is +1 if the azimuth was approached clockwise, -1 counter-clockwise,
    0 if it did not matter.
    """

    position: int
    step: str
    attitude: Attitude
    direction: int = 0
