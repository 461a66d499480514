"""What every step of a procedure is: a typed entry of the file that can plan and run itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, StringConstraints

from bench.typed_yaml import FileModel

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from bench.pose import Attitude
    from bench.run_context import RunContext

StepName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
"""Lower-case letters, digits and underscores, beginning with a letter."""
OnMiss = Literal["stop", "continue"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedPose:
    """One dwell that a step intends.

    `direction` is +1 where the azimuth is to be approached clockwise, -1 counter-clockwise,
    0 where it does not matter; `dwell_s` is the time over which the reading is averaged.
    """

    attitude: Attitude
    direction: int = 0
    dwell_s: float = 0.5


class Step(FileModel, ABC):
    """Base of the closed set of steps; `kind` picks the class, `name` stands in the record."""

    fixed_duration_s: ClassVar[float] = 0.0
    """Time that the step takes beside its poses, for the plan."""

    kind: str
    """Class of the step."""
    name: StepName
    """Name of the step in the record; unique in the procedure."""
    on_miss: OnMiss = "continue"
    """Whether a missed limit of this step ends the procedure or is only counted."""
    attempts: Annotated[int, Field(ge=1, le=5)] = 1
    """How often the step may run until it passes; every attempt stays in the record."""

    @abstractmethod
    def run(self, context: RunContext) -> None:
        """Do the step: move, measure, judge.

        Raises
        ------
        BenchError
            If the bench cannot go on; a missed limit is a measurement, never an exception.
        """

    def poses(self) -> Sequence[PlannedPose]:
        """Return the dwells of the step in order, known before any bus is opened."""
        return ()

    def dwells(self, *, with_reference: bool = True) -> Sequence[PlannedPose]:
        """Return the dwells with those at a sentinel pose among them, where there is need of one.

        Without a reference magnetometer at the station there is.
        """
        del with_reference
        return self.poses()

    def measured(self) -> Sequence[str]:
        """Return the names of the measurements that the step judges; each needs a limit."""
        return ()

    def children(self) -> Sequence[Step]:
        """Return the steps inside this one."""
        return ()

    def duration_s(self) -> float:
        """Return the expected time of the step without moves and dwells."""
        return self.fixed_duration_s

    def walk(self) -> Iterator[Step]:
        """Yield this step and those inside it in the order in which they run."""
        yield self
        for child in self.children():
            yield from child.walk()
