"""Delimited text with a preamble: reads any recording, writes the product's own.

The product's recording::

    # format: compass-bench/recording/1
    # mag_unit: mG
    # mag_resolution_mg: 0.917431
    # rate_hz: 75
    t_s,mx,my,mz
    0.000000,241.284,-337.615,-388.991

Lines that begin with ``#`` are comments; ``# key: value`` is kept. The first other line names
the columns, unless the caller names them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

DELIMITERS: Final = (",", ";", "\t")
LARGEST: Final = 1e12
"""No value of a recording is as large, in any unit; squares of larger ones overflow."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows of text under named columns, with the line of the file that each row stood on."""

    path: Path
    names: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    preamble: Mapping[str, str]

    def has(self, *names: str) -> bool:
        """Return whether every one of these columns is there."""
        return all(name in self.names for name in names)

    def has_any(self, *names: str) -> bool:
        """Return whether any of these columns is there."""
        return any(name in self.names for name in names)

    def numbers(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return columns as numbers, shape (n, len(names)).

        Raises
        ------
        ConfigError
            If a column is missing or a value is not a finite number; says file and line.
        """
        cells = np.array(self._cells(names), dtype=str)
        try:
            values = cells.astype(np.float64)
        except ValueError:
            values = np.array([[_number(cell) for cell in row] for row in cells])
        bad = np.argwhere(~(np.abs(values) < LARGEST))
        if len(bad):
            row, column = bad[0]
            bound = f" below {LARGEST:g}" if np.isfinite(values[row, column]) else ""
            message = (
                f"{self.path}:{self.lines[row]}: {names[column]} must be a finite number{bound}; "
                f"instead received {str(cells[row, column])!r}"
            )
            raise ConfigError(message)
        return values

    def decimals(self, names: Sequence[str]) -> int:
        """Return the largest number of decimals that these columns are printed with."""
        return max(decimals_of(cell) for row in self._cells(names) for cell in row)

    def _cells(self, names: Sequence[str]) -> list[list[str]]:
        for name in names:
            if name not in self.names:
                message = (
                    f"{self.path}: column {name!r} is missing; the columns are "
                    f"{', '.join(self.names)}"
                )
                raise ConfigError(message)
        places = [self.names.index(name) for name in names]
        return [[row[place] for place in places] for row in self.rows]


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def decimals_of(cell: str) -> int:
    """Return how many decimals a number is printed with, negative for tens and hundreds.

    >>> decimals_of("-0.0391"), decimals_of("17"), decimals_of("2.50e-3"), decimals_of("1e2")
    (4, 0, 5, -2)
    """
    mantissa, _, exponent = cell.strip().lower().partition("e")
    return len(mantissa.partition(".")[2]) - int(exponent or 0)


def read_table(
    path: Path,
    *,
    names: Sequence[str] | None = None,
    skip_lines: int = 0,
    delimiter: str | None = None,
) -> Table:
    """Read a delimited text file.

    Parameters
    ----------
    path : Path
        The file.
    names : sequence of str, optional
        The columns of a file that does not name them itself.
    skip_lines : int, default 0
        Lines of a foreign preamble to skip at the start.
    delimiter : str, optional
        The separator; without it the first of comma, semicolon and tab that the first line
        holds, else blanks.

    Raises
    ------
    ConfigError
        If the file cannot be read, is empty, names no columns, or has rows of another length.
    """
    preamble: dict[str, str] = {}
    kept: list[tuple[int, str]] = []
    for number, text in enumerate(_read_lines(path), start=1):
        line = text.strip()
        if number <= skip_lines or not line:
            continue
        if line.startswith("#"):
            key, colon, value = line.lstrip("# ").partition(":")
            if colon:
                preamble[key.strip()] = value.strip()
            continue
        kept.append((number, line))
    if not kept:
        message = f"{path} is empty: it holds no line with values"
        raise ConfigError(message)
    if delimiter is None:
        delimiter = next((mark for mark in DELIMITERS if mark in kept[0][1]), None)
    split = [(number, _split(line, delimiter)) for number, line in kept]
    if names is None:
        names = _header(path, *split.pop(0))
    return _checked_table(path, tuple(names), split, preamble)


def _read_lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        message = f"{path} is not a text file: byte {error.start} is not UTF-8"
        raise ConfigError(message) from error
    except OSError as error:
        message = f"{path} cannot be read: {error.strerror}"
        raise ConfigError(message) from error


def _split(line: str, delimiter: str | None) -> tuple[str, ...]:
    return tuple(cell.strip() for cell in line.split(delimiter))


def _header(path: Path, line: int, cells: tuple[str, ...]) -> tuple[str, ...]:
    number = next((cell for cell in cells if np.isfinite(_number(cell))), None)
    if number is not None:
        message = (
            f"{path}:{line}: the first line must name the columns; instead received "
            f"{number!r}: skip lines that are neither, or name the columns yourself"
        )
        raise ConfigError(message)
    twice = next((name for name in cells if cells.count(name) > 1), None)
    if twice is not None:
        message = f"{path}:{line}: column {twice!r} is named twice"
        raise ConfigError(message)
    return cells


def _checked_table(
    path: Path,
    names: tuple[str, ...],
    split: list[tuple[int, tuple[str, ...]]],
    preamble: dict[str, str],
) -> Table:
    if not split:
        message = f"{path} is empty: it names columns but holds no rows"
        raise ConfigError(message)
    for line, cells in split:
        if len(cells) != len(names):
            message = (
                f"{path}:{line}: a row must hold {len(names)} values ({', '.join(names)}); "
                f"instead received {len(cells)}"
            )
            raise ConfigError(message)
    lines, rows = zip(*split, strict=True)
    return Table(path, names, rows, lines, preamble)


def write_table(
    path: Path,
    columns: Mapping[str, tuple[NDArray[np.float64], int]],
    preamble: Mapping[str, str],
) -> None:
    """Write columns, each shape (n,) with its number of decimals, below a preamble.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    """
    lines = [f"# {key}: {value}" for key, value in preamble.items()]
    lines.append(",".join(columns))
    row = ",".join(f"{{:.{decimals}f}}" for _, decimals in columns.values())
    lines.extend(
        row.format(*values)
        for values in zip(*((column + 0.0).tolist() for column, _ in columns.values()), strict=True)
    )
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        message = f"{path} cannot be written: {error.strerror}"
        raise ConfigError(message) from error
