"""What happens in a run, one JSON object a line, flushed as it happens."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Protocol

from bench.record.plain import plain

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

EVENTS_FILE = "events.ndjson"


class Sink(Protocol):
    """A consumer of events: progress on the terminal, a dashboard, a database."""

    def on_event(self, event: Mapping[str, object]) -> None:
        """Take one event: `seq`, `t_s`, `wall_utc`, `event` and the fields of its kind."""
        ...

    def close(self) -> None:
        """Finish; no event follows."""
        ...


class EventLog:
    """The sink that writes events.ndjson."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", encoding="utf-8", newline="\n")

    def on_event(self, event: Mapping[str, object]) -> None:
        """Write one line and flush it."""
        self._file.write(json.dumps(plain(event), allow_nan=False, separators=(",", ":")) + "\n")
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_events(path: Path) -> list[dict[str, object]]:
    """Return the events of a file; a last line cut off by a crash is left out."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n")]
