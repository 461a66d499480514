"""Files that come with the product: procedures, limits and stations, by name or by path."""

from __future__ import annotations

import difflib
import hashlib
from pathlib import Path
from typing import Final, Literal

from bench.errors import ConfigError

Folder = Literal["procedures", "limits", "stations"]

_ROOT: Final = Path(__file__).parent
_SINGULAR: Final = {"procedures": "procedure", "limits": "limits file", "stations": "station"}


def shipped_names(folder: Folder) -> list[str]:
    """Return the names of the shipped files of one kind, in alphabetical order."""
    return sorted(path.stem for path in (_ROOT / folder).glob("*.yaml"))


def find_file(folder: Folder, name: str, *, beside: Path | None = None) -> Path:
    """Return the file that a name means: a path, or the name of a shipped file.

    Parameters
    ----------
    folder : str
        Kind of file.
    name : str
        ``eol_three_axis``, or a path that ends in .yaml or .yml.
    beside : Path or None
        Folder in which a relative path is looked for first.

    Raises
    ------
    ConfigError
        If there is no such file; the sentence suggests the nearest shipped name.
    """
    if name.endswith((".yaml", ".yml")):
        choices = [Path(name)] if beside is None else [beside / name, Path(name)]
        for path in choices:
            if path.is_file():
                return path
        message = f"{_SINGULAR[folder]} {name}: there is no such file"
        raise ConfigError(message)
    names = shipped_names(folder)
    if name in names:
        return _ROOT / folder / f"{name}.yaml"
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(names)}"
    message = f"unknown {_SINGULAR[folder]} {name!r}; {hint}"
    raise ConfigError(message)


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
