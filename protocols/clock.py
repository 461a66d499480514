"""One injected clock in integer nanoseconds."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Source of time for every wait, timeout and time stamp."""

    def now_ns(self) -> int:
        """Return the time in nanoseconds since an arbitrary start."""
        ...


class SimulatedClock:
    """Time that passes only when it is advanced."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Return the simulated time in nanoseconds."""
        return self._now_ns

    def advance(self, step_ns: int) -> None:
        """Let `step_ns` nanoseconds pass."""
        self._now_ns += step_ns


class MonotonicClock:
    """The machine's monotonic clock, starting at zero when made."""

    def __init__(self) -> None:
        self._start_ns = time.monotonic_ns()

    def now_ns(self) -> int:
        """Return the nanoseconds since this clock was made."""
        return time.monotonic_ns() - self._start_ns
