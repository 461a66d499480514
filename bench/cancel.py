"""A wish to end the run, set by a signal handler and honoured at the next tick."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from bench.errors import Aborted

if TYPE_CHECKING:
    from collections.abc import Iterator


class CancelToken:
    """Ends a run at a tick, never in the middle of one.

    Attributes
    ----------
    due : bool
        Whether the next tick is to raise `Aborted`.
    signal_number : int or None
        The signal that asked for the end; the first one counts.
    """

    def __init__(self) -> None:
        self.due = False
        self.signal_number: int | None = None
        self._shields = 0

    @property
    def requested(self) -> bool:
        """Whether the end was asked for, shielded or not."""
        return self.signal_number is not None

    def request(self, signal_number: int) -> None:
        """Ask for the end; may be called from a signal handler."""
        if self.signal_number is None:
            self.signal_number = signal_number
        self.due = self._shields == 0

    def check(self) -> None:
        """Raise `Aborted` if the end was asked for and nothing shields from it."""
        if self.due and self.signal_number is not None:
            raise Aborted(self.signal_number)

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Let ticks pass inside, as parking the rig and closing the record need them."""
        self._shields += 1
        self.due = False
        try:
            yield
        finally:
            self._shields -= 1
            self.due = self._shields == 0 and self.requested
