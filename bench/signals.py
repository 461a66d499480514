"""SIGINT and SIGTERM end a run at the next tick; a second one ends what still runs at once."""

from __future__ import annotations

import signal
import threading
from typing import TYPE_CHECKING, Final, Self

from bench.errors import Aborted

if TYPE_CHECKING:
    from types import FrameType

    from bench.cancel import CancelToken

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class SignalWatch:
    """Turns signals into wishes of a `CancelToken` while its block runs.

    The first signal is a wish: the run ends at the next tick, the rig is parked and the
    record closed. The second raises `Aborted` where the program stands, which ends a hanging
    step or one action of the teardown. Further ones, and all during `deafen`, only count.
    Outside the main thread Python gives no signals and nothing is installed.
    """

    def __init__(self, cancel: CancelToken) -> None:
        self.received = 0
        self._cancel = cancel
        self._deaf = False
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._before.clear()

    def deafen(self) -> None:
        """Let nothing interrupt from now on: the record is being closed."""
        self._deaf = True

    def _on_signal(self, number: int, _: FrameType | None) -> None:
        self.received += 1
        self._cancel.request(number)
        if self.received == 2 and not self._deaf:
            raise Aborted(number)
