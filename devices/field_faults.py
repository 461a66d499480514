"""What comes near the rig: the vehicles of the faults of kind `field`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from devices.world import Forklift
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from devices.faults import ActiveFault

MOMENT_NED_AM2: Final = (150.0, 210.0, 150.0)
"""Magnetic moment of a forklift or of a steel rack, remanent and induced, A m2: 300 in all."""
AISLE_M: Final = 4.0
"""Distance of the aisle from the rig, on the side away from the reference magnetometer, m."""
UNLOADING_S: Final = 20.0
"""How long the forklift stands beside the rig, s."""


def vehicle_of(active: ActiveFault) -> Forklift:
    """Return what a fault of kind `field` puts near the rig; its moment goes with the strength.

    Raises
    ------
    ValueError
        If the fault is of another kind.
    """
    north, east, down = MOMENT_NED_AM2
    moment = (north * active.strength, east * active.strength, down * active.strength)
    starts_s = active.tick * TICK_S
    if active.fault.name == "forklift":
        return Forklift(
            moment_ned_am2=moment,
            start_ned_m=(-20.0, -AISLE_M, 0.0),
            starts_s=starts_s,
            stands_s=UNLOADING_S,
        )
    if active.fault.name == "field_step":
        return Forklift(
            moment_ned_am2=moment,
            start_ned_m=(0.0, -AISLE_M, 0.0),
            velocity_ned_mps=(0.0, 0.0, 0.0),
            starts_s=starts_s,
        )
    message = f"fault must be of something near the rig; instead received {active.fault.name}"
    raise ValueError(message)
