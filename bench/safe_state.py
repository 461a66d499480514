"""Promises for the end of a run: the rig is parked, the module restored, whatever happened."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.cancel import CancelToken
    from bench.recorder import Recorder

_log = logging.getLogger(f"compassbench.{__name__}")


class SafeState:
    """A stack of named actions that all run, last promised first, errors or not."""

    def __init__(self, cancel: CancelToken, recorder: Recorder) -> None:
        self._cancel = cancel
        self._recorder = recorder
        self._promises: list[tuple[str, Callable[[], object]]] = []

    def promise(self, name: str, action: Callable[[], object]) -> None:
        """Promise an action, before whatever it undoes is begun; the same name only once."""
        if all(name != promised for promised, _ in self._promises):
            self._promises.append((name, action))

    def keep(self) -> list[str]:
        """Run all promised actions, shielded from the wish to end, and return what failed."""
        failures: list[str] = []
        while self._promises:
            name, action = self._promises.pop()
            try:
                with self._cancel.shielded():
                    action()
            except (Exception, KeyboardInterrupt) as fault:  # the next promises count as much
                sentence = f"could not {name}: {fault}"
                failures.append(sentence)
                _log.error("%s", sentence)
                self._recorder.event("teardown_failed", action=name, message=str(fault))
            else:
                self._recorder.event("teardown", action=name)
        return failures
