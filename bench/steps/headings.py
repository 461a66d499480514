"""How a procedure names poses: evenly spread headings, rings of them at a tilt."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from bench.pose import Attitude
from bench.quantity import Degrees
from bench.steps.step import PlannedPose
from bench.typed_yaml import FileModel

Direction = Literal["clockwise", "counter_clockwise"]
DIRECTION_SIGN = {"clockwise": 1, "counter_clockwise": -1}


class Headings(FileModel):
    """`count` headings spread evenly over the turn, the first at `first`."""

    count: Annotated[int, Field(ge=1, le=360)]
    """Number of headings in one turn."""
    first: Degrees = 0.0
    """The first heading, from the rig's zero."""

    def azimuths_deg(self) -> list[float]:
        """Return the headings in [0, 360), clockwise from the first."""
        return [(self.first + 360.0 * index / self.count) % 360.0 for index in range(self.count)]


class Ring(Headings):
    """Headings at one tilt."""

    pitch: Degrees = 0.0
    """Nose up."""
    roll: Degrees = 0.0
    """Right side down."""
    direction: Direction = "clockwise"
    """Way round; counter_clockwise also approaches the first pose so."""

    def planned(self, dwell_s: float) -> list[PlannedPose]:
        """Return the poses of the ring in order."""
        azimuths_deg = self.azimuths_deg()
        backwards = self.direction == "counter_clockwise"
        if backwards:
            azimuths_deg = [azimuths_deg[0], *reversed(azimuths_deg[1:])]
        return [
            PlannedPose(
                attitude=Attitude(azimuth_deg=azimuth, pitch_deg=self.pitch, roll_deg=self.roll),
                direction=DIRECTION_SIGN[self.direction] if backwards else 0,
                dwell_s=dwell_s,
            )
            for azimuth in azimuths_deg
        ]


def ring_poses(rings: list[Ring], dwell_s: float) -> list[PlannedPose]:
    """Return the poses of several rings, one ring after the other."""
    return [pose for ring in rings for pose in ring.planned(dwell_s)]
