"""A pose of the rig and the purpose for which a step visits it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Attitude of the seat: heading clockwise from the rig's zero, pitch nose up, roll right down.

    ned_from_body = Rz(azimuth) Ry(pitch) Rx(roll), intrinsic z-y-x.
    """

    azimuth_deg: float
    pitch_deg: float = 0.0
    roll_deg: float = 0.0


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
