"""What a run writes to as it happens, seen from the executor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from bench.acceptance.measurement import Measurement
    from bench.acceptance.outcome import Outcome
    from bench.acceptance.verdict import Verdict
    from bench.calibration.fit import Fit
    from bench.pose import Pose


class Recorder(Protocol):
    """What a run writes as it happens; the run folder's recorder and a test's list are such."""

    def event(self, kind: str, **fields: object) -> None:
        """Write one event."""
        ...

    def step_started(self, name: str, kind: str, attempt: int = 1) -> None:
        """Say that a step begins."""
        ...

    def step_ended(self, name: str, outcome: Outcome, message: str = "") -> None:
        """Say how the step that began last ended."""
        ...

    def measurement(self, measurement: Measurement) -> None:
        """Keep a judged measurement."""
        ...

    def fit(self, fit: Fit, achieved: Mapping[str, float] | None = None) -> None:
        """Keep the result of a method and what it achieved on the verification poses."""
        ...

    def pose(self, pose: Pose) -> None:
        """Keep a pose that was visited."""
        ...

    @property
    def verdict(self) -> Verdict | None:
        """The verdict as it was recorded, once closed."""
        ...

    def close(self, verdict: Verdict) -> object:
        """Complete the record."""
        ...

    def set(self, section: str, value: Mapping[str, object] | Sequence[object]) -> None:
        """Set a section of the record."""
        ...
