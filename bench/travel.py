"""How the rig travels: limits, speeds and the azimuth's winding. Pure; `plan` uses it too."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from bench.errors import ConfigError

if TYPE_CHECKING:
    from bench.pose import Attitude

AXES: Final = ("azimuth", "pitch", "roll")
SETTLE_S: Final = 0.4
"""From the end of the travel to a settled pose."""
SAME_DEG: Final = 0.01
"""Two azimuths closer than this are one."""
APPROACH_DEG: Final = 15.0
"""Run-up for an approach from a given side after unwinding the cable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisProfile:
    """Soft limits and speed of one axis.

    Attributes
    ----------
    low_deg, high_deg : float
        Soft limits; the azimuth's are those of the cable's wrap.
    speed_dps, acceleration_dps2 : float
        Profile velocity in deg/s and acceleration in deg/s2.
    """

    low_deg: float
    high_deg: float
    speed_dps: float
    acceleration_dps2: float

    def travel_time_s(self, distance_deg: float) -> float:
        """Return the time of a trapezoidal (or triangular) move over a distance.

        >>> RIG_PROFILE["azimuth"].travel_time_s(180.0)
        2.5
        """
        distance_deg = abs(distance_deg)
        if distance_deg >= self.speed_dps**2 / self.acceleration_dps2:
            return distance_deg / self.speed_dps + self.speed_dps / self.acceleration_dps2
        return 2.0 * math.sqrt(distance_deg / self.acceleration_dps2)


RIG_PROFILE: Final = {
    "azimuth": AxisProfile(low_deg=-540.0, high_deg=540.0, speed_dps=90.0, acceleration_dps2=180.0),
    "pitch": AxisProfile(low_deg=-90.0, high_deg=90.0, speed_dps=45.0, acceleration_dps2=90.0),
    "roll": AxisProfile(low_deg=-90.0, high_deg=90.0, speed_dps=45.0, acceleration_dps2=90.0),
}
"""The shipped rig's axes."""


def azimuth_path_deg(
    present_deg: float,
    heading_deg: float,
    direction: int | None = None,
    profile: AxisProfile = RIG_PROFILE["azimuth"],
) -> tuple[float, ...]:
    """Return the wound azimuths to visit, the last of which is the heading plus whole turns.

    Parameters
    ----------
    present_deg : float
        Wound azimuth of the present set-point.
    heading_deg : float
        Heading to reach, any number of turns.
    direction : int or None
        +1 to arrive clockwise, -1 counter-clockwise, 0 or None the shortest way. Where the
        cable would wrap too far, the path unwinds first and has two points.
    profile : AxisProfile
        Limits of the azimuth.

    >>> azimuth_path_deg(350.0, 10.0)
    (370.0,)
    >>> azimuth_path_deg(10.0, 350.0, 1)
    (350.0,)
    >>> azimuth_path_deg(530.0, 200.0, 1)
    (-175.0, -160.0)
    """
    turns = math.ceil((profile.high_deg - profile.low_deg) / 360.0) + 1
    nearest = round((present_deg - heading_deg) / 360.0)
    allowed = [
        heading_deg + 360.0 * turn
        for turn in range(nearest - turns, nearest + turns + 1)
        if profile.low_deg <= heading_deg + 360.0 * turn <= profile.high_deg
    ]
    if not direction:
        return (min(allowed, key=lambda azimuth: (abs(azimuth - present_deg), abs(azimuth))),)
    side = math.copysign(1.0, direction)
    ahead = [azimuth for azimuth in allowed if side * (azimuth - present_deg) > -SAME_DEG]
    if ahead:
        return (min(ahead, key=lambda azimuth: abs(azimuth - present_deg)),)
    unwound = min(allowed, key=abs)
    return (unwound - side * APPROACH_DEG, unwound)


def travel_time_s(
    start: Attitude,
    end: Attitude,
    direction: int | None = None,
    profiles: dict[str, AxisProfile] = RIG_PROFILE,
) -> float:
    """Return the time from one attitude to another, all axes at once, without settling.

    `start.azimuth_deg` is the wound azimuth.
    """
    azimuth_s, present_deg = 0.0, start.azimuth_deg
    for azimuth_deg in azimuth_path_deg(
        present_deg, end.azimuth_deg, direction, profiles["azimuth"]
    ):
        azimuth_s += profiles["azimuth"].travel_time_s(azimuth_deg - present_deg)
        present_deg = azimuth_deg
    return max(
        azimuth_s,
        profiles["pitch"].travel_time_s(end.pitch_deg - start.pitch_deg),
        profiles["roll"].travel_time_s(end.roll_deg - start.roll_deg),
    )


def require_reachable(attitude: Attitude, profiles: dict[str, AxisProfile] = RIG_PROFILE) -> None:
    """Check pitch and roll against the soft limits; every azimuth can be reached.

    Raises
    ------
    ConfigError
        If an axis would leave its limits.
    """
    for axis, angle_deg in (("pitch", attitude.pitch_deg), ("roll", attitude.roll_deg)):
        low_deg, high_deg = profiles[axis].low_deg, profiles[axis].high_deg
        if not low_deg <= angle_deg <= high_deg:
            message = (
                f"{axis} must be between {low_deg:g} and {high_deg:g} deg; "
                f"instead received {angle_deg:g} deg"
            )
            raise ConfigError(message)
