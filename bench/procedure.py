"""A procedure: identity, the limits and station it uses, and its steps in order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from bench.steps.adaptive_poses import AdaptivePoses
from bench.steps.check_bus import CheckBus
from bench.steps.collect import Collect
from bench.steps.compare import Compare
from bench.steps.fit import FitMethods
from bench.steps.home import Home
from bench.steps.identify import Identify
from bench.steps.mount import Mount
from bench.steps.noise import Noise
from bench.steps.poses import Poses
from bench.steps.prompt import Prompt
from bench.steps.returns import Returns
from bench.steps.reversal import Reversal
from bench.steps.set_reset import SetReset
from bench.steps.step import Step, StepName
from bench.steps.sweep import Sweep
from bench.steps.verify import Verify
from bench.steps.wait import Wait
from bench.steps.write import Write
from bench.typed_yaml import FileModel

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from bench.run_context import RunContext

MOST_STEPS: Final = 10_000
"""Most steps of a procedure, all rounds counted."""


class Group(Step):
    """Steps under one name; `attempts` repeats all of them together."""

    kind: Literal["group"]
    steps: Annotated[list[AnyStep], Field(min_length=1)]
    """Steps in order."""

    def run(self, context: RunContext) -> None:
        """Run the steps in order; a critical failure inside ends the procedure."""
        for step in self.steps:
            context.run_step(step)

    def children(self) -> Sequence[Step]:
        """Return the steps of the group."""
        return self.steps


class Repeat(Step):
    """The same steps several times; every round is judged, under the step's name and its number."""

    kind: Literal["repeat"]
    times: Annotated[int, Field(ge=1, le=1000)]
    """Number of rounds."""
    steps: Annotated[list[AnyStep], Field(min_length=1)]
    """Steps of a round."""

    def run(self, context: RunContext) -> None:
        """Run the rounds one after the other."""
        for number in range(1, self.times + 1):
            for step in self.steps:
                context.run_step(step, f"_{number}")

    def children(self) -> Sequence[Step]:
        """Return the steps of all rounds."""
        return self.steps * self.times


AnyStep = Annotated[
    CheckBus
    | Identify
    | Home
    | SetReset
    | Noise
    | Sweep
    | Poses
    | AdaptivePoses
    | FitMethods
    | Write
    | Verify
    | Compare
    | Returns
    | Collect
    | Mount
    | Reversal
    | Wait
    | Prompt
    | Group
    | Repeat,
    Field(discriminator="kind"),
]
"""The closed set of steps."""


class Procedure(FileModel):
    """What is done to one unit, as it stands in a file of bench/procedures."""

    name: StepName
    """Name by which the command line knows the procedure."""
    version: Annotated[str, StringConstraints(pattern=r"^\d+\.\d+$")]
    """Version, major.minor; every change of the file raises it."""
    title: str
    """What the procedure does, in a few words."""
    description: str = ""
    """What it is for, in sentences."""
    on_pass: str = ""
    """What the operator does with a unit that passed; none given: it is released."""
    limits: str
    """Name of a shipped limits file or path of one."""
    station: str = "default"
    """Name of a shipped station file or path of one."""
    steps: Annotated[list[AnyStep], Field(min_length=1)]
    """Steps in order."""

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        seen: set[str] = set()
        for step in self._declared(self.steps):
            if step.name in seen:
                message = f"names of steps must be unique; instead received {step.name!r} twice"
                raise ValueError(message)
            seen.add(step.name)
        return self

    @model_validator(mode="after")
    def _end_comes(self) -> Self:
        count = _step_count(self.steps)
        if count > MOST_STEPS:
            message = f"steps of all rounds must be at most {MOST_STEPS}; instead received {count}"
            raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _what_is_written_is_judged(self) -> Self:
        """Require a fit before each write, and a verification after it but none before it."""
        declared = list(self._declared(self.steps))
        for place, step in enumerate(declared):
            if not isinstance(step, Write):
                continue
            before, after = declared[:place], declared[place + 1 :]
            if not any(isinstance(other, FitMethods) for other in before):
                message = f"step {step.name} must come after a fit; there is none"
                raise ValueError(message)
            if not any(isinstance(other, Verify) for other in after):
                message = (
                    f"step {step.name} must be followed by a verify step: "
                    "coefficients that nothing judges are not released"
                )
                raise ValueError(message)
            early = next((other for other in before if isinstance(other, Verify)), None)
            if early is not None:
                message = f"step {early.name} must come after the write of step {step.name}"
                raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _what_is_compared_is_fitted(self) -> Self:
        declared = list(self._declared(self.steps))
        for place, step in enumerate(declared):
            before = declared[:place]
            if isinstance(step, Compare) and not any(isinstance(b, FitMethods) for b in before):
                message = f"step {step.name} must come after a fit; there is none"
                raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _a_reversal_has_its_mountings(self) -> Self:
        declared = list(self._declared(self.steps))
        mounts = [step for step in declared if isinstance(step, Mount)]
        reversals = sum(isinstance(step, Reversal) for step in self.walk())
        if reversals > 1 or (mounts and not reversals):
            message = (
                "a procedure that remounts the unit must have one reversal step; "
                f"instead received {reversals or 'none'}"
            )
            raise ValueError(message)
        for place, step in enumerate(declared):
            before = {other.mounting for other in declared[:place] if isinstance(other, Mount)}
            if isinstance(step, Reversal) and len(before) < 2:
                message = (
                    f"step {step.name} must come after at least two different mountings; "
                    f"instead received {len(before)}"
                )
                raise ValueError(message)
            if mounts and isinstance(step, FitMethods | Write | Verify):
                message = (
                    f"step {step.name} must not stand in a procedure that remounts the unit: "
                    "its coefficients would be those of several mountings"
                )
                raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _verification_poses_are_others(self) -> Self:
        declared = list(self._declared(self.steps))
        used = [
            pose.attitude
            for step in declared
            if isinstance(step, Sweep | Poses)
            for pose in step.poses()
        ]
        used += [
            attitude
            for step in declared
            if isinstance(step, AdaptivePoses)
            for attitude in step.candidates()
        ]
        for step in declared:
            for pose in step.poses() if isinstance(step, Verify | Compare) else ():
                if any(pose.attitude.is_at(other) for other in used):
                    at = pose.attitude
                    message = (
                        f"step {step.name} must verify at poses of its own; instead received the "
                        f"calibration pose azimuth {at.azimuth_deg:g}, pitch {at.pitch_deg:g}, "
                        f"roll {at.roll_deg:g} deg"
                    )
                    raise ValueError(message)
        return self

    @staticmethod
    def _declared(steps: Sequence[Step]) -> Iterator[Step]:
        for step in steps:
            yield step
            if isinstance(step, Group | Repeat):
                yield from Procedure._declared(step.steps)

    def walk(self) -> Iterator[Step]:
        """Yield every step in the order in which it runs, repetitions included."""
        for step in self.steps:
            yield from step.walk()

    def named_steps(self) -> dict[str, Step]:
        """Return the steps of a whole run by the names under which they stand in its record."""
        return dict(_named_in_record(self.steps))

    @property
    def part(self) -> str | None:
        """Part number that the identify step names, or None."""
        parts = (step.part for step in self.walk() if isinstance(step, Identify))
        return next((part for part in parts if part is not None), None)

    @property
    def uses_rig(self) -> bool:
        """Whether any step moves the rig."""
        return any(isinstance(step, Home) or step.poses() for step in self.walk())

    @property
    def pose_count(self) -> int:
        """Number of dwells of the whole procedure."""
        return sum(len(step.poses()) for step in self.walk())

    def measured(self) -> tuple[str, ...]:
        """Return the names of all measurements that the procedure judges, in order."""
        return tuple(dict.fromkeys(name for step in self.walk() for name in step.measured()))


def _step_count(steps: Sequence[Step]) -> int:
    count = 0
    for step in steps:
        inner = _step_count(step.steps) if isinstance(step, Group | Repeat) else 0
        count += 1 + inner * (step.times if isinstance(step, Repeat) else 1)
    return count


def _named_in_record(steps: Sequence[Step], suffix: str = "") -> Iterator[tuple[str, Step]]:
    for step in steps:
        yield step.name + suffix, step
        if isinstance(step, Group):
            yield from _named_in_record(step.steps, suffix)
        elif isinstance(step, Repeat):
            for number in range(1, step.times + 1):
                yield from _named_in_record(step.steps, f"{suffix}_{number}")


Group.model_rebuild()
Repeat.model_rebuild()
Procedure.model_rebuild()
