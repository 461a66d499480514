"""A recording in place of the sensors: every row is sent once, in order, one a cycle.

Rows leave at the module's sample period, whatever the recording's rate was. A reset of the
module begins again with the first row, so that a listener who asks for one misses none.

The file is the product's CSV: `# key: value` lines, a header row, then rows. A recording
without set/reset pairs has only the field v, which is sent as set = +v and reset = -v and
flagged as synthesised. Values are whole multiples of the resolution named in the preamble,
so that what the bench computes from the counts equals the file.
"""

from __future__ import annotations

import csv
import math
from typing import TYPE_CHECKING, Final

from devices.firmware import Converters
from protocols import compass

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from devices.firmware import Counts

_FIELD: Final = ("mx", "my", "mz")
_FORCE: Final = ("ax", "ay", "az")
_INT16: Final = 32767
_OFF_STEP: Final = 0.05
"""Share of a step by which a printed value may be off its step."""

Row = tuple["Counts", "Counts"]


class ReplaySensors:
    """Stands where `devices.sensors.Sensors` stands, and gives a recording's rows.

    Parameters
    ----------
    path : Path
        File in the product's CSV.

    Attributes
    ----------
    converters : Converters
        Resolutions of the file's preamble.

    Raises
    ------
    ValueError
        If the file is no such CSV; says what is wrong, and in which line.
    OSError
        If the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.pulse_current_ma = 500.0
        self.temperature_c = 25.0
        self.supply_v = 5.0
        lines = _lines(path)
        keys = _preamble(lines)
        header, rows = _table(path.name, lines)
        _require_columns(path.name, header)
        self._has_force = _FORCE[0] in header
        columns = _FIELD + (_FORCE if self._has_force else ())
        self.converters = _converters(path.name, keys, has_force=self._has_force)
        self._rows = [self._counts(path.name, line, row, columns) for line, row in rows]
        if not self._rows:
            message = f"recording {path.name} must have rows below its header; instead it has none"
            raise ValueError(message)
        self._next = 0
        self._ended = False

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def flags(self) -> int:
        """Flags for the status frame."""
        flags = compass.FLAG_SYNTHESISED
        if not self._has_force:
            flags |= compass.FLAG_NO_ACCELERATION
        if self._ended:
            flags |= compass.FLAG_REPLAY_ENDED
        return flags

    def restart(self) -> None:
        """Begin again with the first row, as after power-on."""
        self._next = 0
        self._ended = False

    def pulse(self, current_ma: float) -> None:
        """Do nothing: a recording has no film to flip."""
        del current_ma

    def sample(self, t_s: float) -> tuple[Counts, Counts, Counts] | None:
        """Return the next row as set, reset and acceleration counts; None after the last."""
        del t_s
        if self._next >= len(self._rows):
            self._ended = True
            return None
        field, force = self._rows[self._next]
        self._next += 1
        return field, (-field[0], -field[1], -field[2]), force

    def _counts(self, name: str, line: int, row: dict[str, str], columns: tuple[str, ...]) -> Row:
        values = []
        for column in columns:
            scale = (
                self.converters.mag_mg_per_count
                if column in _FIELD
                else self.converters.accel_g_per_count
            )
            count = _value(name, line, column, row.get(column)) / scale
            if not abs(count) <= _INT16:
                message = (
                    f"{column} in line {line} of recording {name} must be within "
                    f"{_INT16} steps of {scale:g}; instead received {row[column]}"
                )
                raise ValueError(message)
            if abs(count - round(count)) > _OFF_STEP:
                message = (
                    f"{column} in line {line} of recording {name} must be a whole number of steps "
                    f"of {scale:g}; instead received {row[column]}: import it with "
                    "`compass-bench import`"
                )
                raise ValueError(message)
            values.append(round(count))
        x, y, z, *force = values
        ax, ay, az = force or (0, 0, 0)
        return (x, y, z), (ax, ay, az)


def _lines(path: Path) -> list[str]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return list(file)
    except UnicodeDecodeError as error:
        message = f"recording {path.name} is not a text file: byte {error.start} is not UTF-8"
        raise ValueError(message) from error


def _preamble(lines: list[str]) -> dict[str, str]:
    keys = {}
    for line in lines:
        if not line.startswith("#"):
            break
        key, colon, value = line[1:].partition(":")
        if colon:
            keys[key.strip()] = value.strip()
    return keys


def _table(name: str, lines: list[str]) -> tuple[list[str], Iterator[tuple[int, dict[str, str]]]]:
    start = next((at for at, line in enumerate(lines) if not line.startswith("#")), len(lines))
    reader = csv.reader(lines[start:])
    header = [cell.strip() for cell in next(reader, [])]
    if not header:
        message = f"recording {name} has no header row; import it with `compass-bench import`"
        raise ValueError(message)
    return header, _named(name, header, enumerate(reader, start=start + 2))


def _named(
    name: str, header: list[str], rows: Iterable[tuple[int, list[str]]]
) -> Iterator[tuple[int, dict[str, str]]]:
    for line, cells in rows:
        if not cells:
            continue
        if len(cells) != len(header):
            message = (
                f"line {line} of recording {name} must have {len(header)} values "
                f"({', '.join(header)}); instead received {len(cells)}"
            )
            raise ValueError(message)
        yield line, dict(zip(header, cells, strict=True))


def _require_columns(name: str, header: list[str]) -> None:
    twice = next((column for column in header if header.count(column) > 1), None)
    if twice is not None:
        message = f"column {twice!r} of recording {name} is named twice"
        raise ValueError(message)
    for wanted in (_FIELD, _FORCE) if set(_FORCE) & set(header) else (_FIELD,):
        missing = [column for column in wanted if column not in header]
        if missing:
            names = ", ".join(wanted)
            message = f"recording {name} must have columns {names}; missing {missing[0]}"
            raise ValueError(message)


def _converters(name: str, keys: dict[str, str], *, has_force: bool) -> Converters:
    unit = keys.get("mag_unit", "mG")
    if unit != "mG":
        message = f"mag_unit of recording {name} must be mG; instead received {unit}"
        raise ValueError(message)
    accel = compass.ACCEL_G_PER_COUNT
    if has_force:
        accel = _number(name, keys, "accel_resolution_g", accel)
    return Converters(
        mag_mg_per_count=_number(name, keys, "mag_resolution_mg", compass.MAG_MG_PER_COUNT),
        accel_g_per_count=accel,
        mag_count_limit=_INT16,
    )


def _number(name: str, keys: dict[str, str], key: str, default: float) -> float:
    text = keys.get(key)
    if text is None:
        return default
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        message = f"{key} of recording {name} must be a positive number; instead received {text!r}"
        raise ValueError(message)
    return number


def _value(name: str, line: int, column: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        message = (
            f"{column} in line {line} of recording {name} must be a number; "
            f"instead received {text!r}"
        )
        raise ValueError(message)
    return value
