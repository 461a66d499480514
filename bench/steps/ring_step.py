"""What steps have in common that visit rings of poses."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bench.quantity import Seconds
from bench.steps.headings import Ring, ring_poses
from bench.steps.step import PlannedPose, Step


class RingStep(Step):
    """Base of the steps that go through rings of poses, one after the other."""

    rings: Annotated[list[Ring], Field(min_length=1)]
    """Rings of poses in order."""
    dwell: Seconds = 0.5
    """Time over which a reading is averaged."""

    def poses(self) -> list[PlannedPose]:
        """Return the poses of all rings in order."""
        return ring_poses(self.rings, self.dwell)

    @property
    def has_level(self) -> bool:
        """Whether any ring is level."""
        return any(ring.pitch == 0.0 and ring.roll == 0.0 for ring in self.rings)

    @property
    def has_tilted(self) -> bool:
        """Whether any ring is tilted."""
        return any(ring.pitch != 0.0 or ring.roll != 0.0 for ring in self.rings)
