"""Sentinel poses: the rig comes back to one pose to see whether the field is still the same."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Field, model_validator

from bench.pose import Attitude
from bench.quantity import Degrees, Milligauss, Seconds
from bench.steps.step import PlannedPose
from bench.typed_yaml import FileModel

if TYPE_CHECKING:
    from collections.abc import Sequence


class Sentinel(FileModel):
    """Come back to one pose every few poses and compare the module's raw field with the first time.

    It takes the place of a reference magnetometer: where the station has one, sentinel poses are
    left out unless `always` is set. They see a change that lasts until the next visit, not a
    vehicle that passes between two of them.
    """

    every: Annotated[int, Field(ge=2, le=360)] = 12
    """Poses between two visits; so many are repeated when a visit finds the field changed."""
    change: Milligauss = 2.5
    """Shift of the module's raw field, any axis, from which on the poses since the last good visit
    are spoiled: above what hysteresis, repeatability and warming of the module do by themselves."""
    azimuth: Degrees = 0.0
    """The pose to come back to; steps that name the same pose share its first visit."""
    pitch: Degrees = 0.0
    """Nose up."""
    roll: Degrees = 0.0
    """Right side down."""
    dwell: Seconds = 0.5
    """Time over which the field is averaged."""
    always: bool = False
    """Whether to visit it at a station with a reference magnetometer as well."""

    @model_validator(mode="after")
    def _a_change_can_be_seen(self) -> Self:
        if self.change <= 0.0:
            message = f"change must be above zero; instead received {self.change:g} mG"
            raise ValueError(message)
        return self

    def among(
        self, planned: Sequence[PlannedPose], *, with_reference: bool
    ) -> Sequence[PlannedPose]:
        """Return poses with the visits to this one: before the first, and after every few."""
        if not planned or (with_reference and not self.always):
            return planned
        visit = self.planned()
        visits = [visit]
        for first in range(0, len(planned), self.every):
            visits += [*planned[first : first + self.every], visit]
        return visits

    def planned(self) -> PlannedPose:
        """Return the pose."""
        attitude = Attitude(azimuth_deg=self.azimuth, pitch_deg=self.pitch, roll_deg=self.roll)
        return PlannedPose(attitude=attitude, dwell_s=self.dwell)
