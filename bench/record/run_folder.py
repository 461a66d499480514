"""The folder of one run: written under a `.part` name, renamed when it is whole.

```
<out>/<date>/<serial>/<time>-<procedure>.part/   while the run lasts, and after a crash
<out>/<date>/<serial>/<time>-<procedure>/        whole
<out>/latest                                     symbolic link to the newest whole folder
```
"""

from __future__ import annotations

import logging
import os
import re
from typing import TYPE_CHECKING, Final

from bench.errors import BenchNotReady, ConfigError

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

LATEST: Final = "latest"
PART: Final = ".part"

_log = logging.getLogger(f"compassbench.{__name__}")


class RunFolder:
    """A run's folder under its `.part` name until `complete` renames it.

    Raises
    ------
    ConfigError
        If the folder cannot be made or written.
    """

    def __init__(self, out_dir: Path, serial: str, procedure: str, started: datetime) -> None:
        self._out_dir = out_dir
        parent = out_dir / f"{started:%Y-%m-%d}" / _path_part(serial)
        name = f"{started:%H%M%S}-{_path_part(procedure)}"
        try:
            parent.mkdir(parents=True, exist_ok=True)
            self._final = _reserve(parent, name)
            self.path = self._final.with_name(self._final.name + PART)
            (self.path / "config").mkdir()
        except OSError as fault:
            message = (
                f"output folder {out_dir} must be writable; instead received "
                f"{fault.strerror or fault}: choose another with --out"
            )
            raise ConfigError(message) from fault

    def complete(self) -> Path:
        """Rename the folder to its final name, point `latest` to it and return it.

        Raises
        ------
        BenchNotReady
            If it cannot be renamed; the `.part` folder then stays as it is.
        """
        try:
            self.path.rename(self._final)
        except OSError as fault:
            message = (
                f"run folder {self.path} could not be renamed to {self._final.name} "
                f"({fault.strerror or fault}): it is complete, rename it by hand"
            )
            raise BenchNotReady(message) from fault
        self.path = self._final
        self._point_latest()
        return self.path

    def _point_latest(self) -> None:
        link = self._out_dir / LATEST
        fresh = self._out_dir / f".{LATEST}-{os.getpid()}"
        try:
            fresh.unlink(missing_ok=True)
            fresh.symlink_to(self.path.relative_to(self._out_dir), target_is_directory=True)
            fresh.replace(link)
        except OSError as fault:
            fresh.unlink(missing_ok=True)
            _log.warning("link %s could not point to %s: %s", link, self.path, fault)


def _reserve(parent: Path, name: str) -> Path:
    """Make a free `.part` folder; runs that start in one second get -2, -3, ..."""
    for count in range(1, 1000):
        final = parent / (name if count == 1 else f"{name}-{count}")
        if final.exists():
            continue
        try:
            final.with_name(final.name + PART).mkdir()
        except FileExistsError:
            continue
        return final
    message = f"{parent / name} exists a thousand times"
    raise FileExistsError(message)


def _path_part(name: str) -> str:
    """Return the name with what does not belong into a file name replaced by underscores.

    >>> _path_part("../SN 1")
    '_SN_1'
    """
    return re.sub(r"[^A-Za-z0-9._-]+", "_", name).lstrip(".") or "_"
