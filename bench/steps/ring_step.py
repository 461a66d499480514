"""What steps have in common that visit rings of poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from bench.quantity import Seconds
from bench.steps.headings import Ring, ring_poses
from bench.steps.sentinel import Sentinel  # noqa: TC001  (pydantic reads it)
from bench.steps.step import PlannedPose, Step

if TYPE_CHECKING:
    from collections.abc import Sequence


class RingStep(Step):
    """Base of the steps that go through rings of poses, one after the other."""

    rings: Annotated[list[Ring], Field(min_length=1)]
    """Rings of poses in order."""
    dwell: Seconds = 0.5
    """Time over which a reading is averaged."""
    sentinel: Sentinel | None = None
    """Pose to come back to between the others, where the station has no reference magnetometer."""

    def poses(self) -> list[PlannedPose]:
        """Return the poses of all rings in order."""
        return ring_poses(self.rings, self.dwell)

    def dwells(self, *, with_reference: bool = True) -> Sequence[PlannedPose]:
        """Return the dwells with those at the sentinel pose."""
        planned = self.poses()
        if self.sentinel is None:
            return planned
        return self.sentinel.among(planned, with_reference=with_reference)

    @property
    def has_level(self) -> bool:
        """Whether any ring is level."""
        return any(ring.pitch == 0.0 and ring.roll == 0.0 for ring in self.rings)

    @property
    def has_tilted(self) -> bool:
        """Whether any ring is tilted."""
        return any(ring.pitch != 0.0 or ring.roll != 0.0 for ring in self.rings)
