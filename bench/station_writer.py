"""Writes new values into a station file and leaves everything else in it as it stands.

Only the text of the values changes: comments, order and spelling of the rest are kept. What was
written is read again before it takes the file's place.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Final

import yaml

from bench.errors import BenchNotReady, ConfigError
from bench.quantity import format_quantity
from bench.station import load_station

if TYPE_CHECKING:
    from collections.abc import Mapping
    from datetime import date
    from pathlib import Path

    from bench.acceptance.reversal_evaluation import StationValue
    from bench.station import Station

ANGLE_DIGITS: Final = 4
FIELD_DIGITS: Final = 3
SHIPPED_SCHEMA: Final = "# yaml-language-server: $schema=station.schema.json\n"
Changes = dict[str, Any]
"""Value by key, as text; a section is a mapping of its own."""


def station_changes(values: Mapping[str, StationValue], *, golden: str, verified: date) -> Changes:
    """Return what a reversal writes: the seat, and the field's azimuth.

    Parameters
    ----------
    values : mapping of str to StationValue
        See `reversal_evaluation.found_values`.
    golden : str
        Serial number of the golden unit.
    verified : date
        Day of the reversal.
    """
    iron = [values[f"iron_{axis}"] for axis in "xyz"]
    level_u_deg = max(values["pitch"].u, values["roll"].u)
    seat = {
        "index": _angle(values["index"].value),
        "pitch": _angle(values["pitch"].value),
        "roll": _angle(values["roll"].value),
        "iron": f"[{', '.join(_field(one.value) for one in iron)}]",
        "index_uncertainty": _angle(values["index"].u),
        "level_uncertainty": _angle(level_u_deg),
        "iron_uncertainty": _field(max(iron[0].u, iron[1].u)),
        "iron_down_uncertainty": _field(iron[2].u),
        "verified": verified.isoformat(),
        "golden": f'"{golden}"',
    }
    azimuth = values["field_azimuth"]
    return {
        "field_azimuth": _angle(azimuth.value),
        "field_azimuth_uncertainty": _angle(azimuth.u),
        "seat": seat,
    }


def _angle(value_deg: float) -> str:
    return format_quantity(round(value_deg, ANGLE_DIGITS) + 0.0, "deg")


def _field(value_mg: float) -> str:
    return format_quantity(round(value_mg, FIELD_DIGITS) + 0.0, "mG")


def require_target(path: Path) -> None:
    """Check, before anything is measured, that a station file can be written to a path.

    Raises
    ------
    ConfigError
        If it cannot.
    """
    if path.is_dir() or not path.parent.is_dir():
        message = f"--write must be a file in a folder that exists; instead received {path}"
        raise ConfigError(message)
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        message = f"--write must be a file that can be written; instead received {path}"
        raise ConfigError(message)


def write_station(source: Path, target: Path, changes: Changes) -> Station:
    """Write a station file with changed values and return it as it is read again.

    Parameters
    ----------
    source : Path
        File whose other content is kept; it may be the target.
    target : Path

    Raises
    ------
    BenchNotReady
        If the target cannot be written, or does not read as what was written.
    """
    draft = target.with_name(f".{target.stem}.part.yaml")  # a station file ends so
    try:
        text = source.read_text(encoding="utf-8")
        if target.parent != source.parent:  # the editor's schema lies beside the shipped file
            text = text.removeprefix(SHIPPED_SCHEMA)
        draft.write_text(changed_text(text, changes), encoding="utf-8")
        station = load_station(str(draft))
        require_written(station, changes)
        draft.replace(target)
    except (OSError, ConfigError, yaml.YAMLError) as error:
        draft.unlink(missing_ok=True)
        message = f"{target}: the station file could not be written: {error}"
        raise BenchNotReady(message) from error
    return load_station(str(target))


def require_written(station: Station, changes: Changes) -> None:
    """Check that a station holds seat and field azimuth, with their U, as they were written.

    Raises
    ------
    ConfigError
        If it does not, for instance where an anchor of the file stands for several values.
    """
    seat = station.seat
    held = {
        "index": _angle(seat.index_deg),
        "pitch": _angle(seat.pitch_deg),
        "roll": _angle(seat.roll_deg),
        "iron": f"[{', '.join(map(_field, seat.iron_mg))}]",
        "index_uncertainty": _angle(seat.u_index_deg),
        "level_uncertainty": _angle(seat.u_level_deg),
        "iron_uncertainty": _field(seat.u_iron_mg),
        "iron_down_uncertainty": _field(seat.u_iron_down_mg),
        "golden": f'"{seat.golden}"',
    }
    wrong = [name for name, text in held.items() if changes["seat"][name] != text]
    field = {
        "field_azimuth": _angle(station.field_azimuth_deg),
        "field_azimuth_uncertainty": _angle(station.u_field_azimuth_deg),
    }
    wrong += [name for name, text in field.items() if changes[name] != text]
    if wrong:
        message = f"{', '.join(wrong)} must read as written; write these by hand"
        raise ConfigError(message)


def changed_text(text: str, changes: Changes) -> str:
    """Return a YAML text with changed values; keys that it lacks are added.

    >>> changed_text("dip: 1 deg  # kept", {"dip": "3 deg"})
    'dip: 3 deg  # kept'
    """
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if not isinstance(root, yaml.MappingNode):
        message = "a station file must hold a mapping of keys to values"
        raise ConfigError(message)
    for first, last, fresh in sorted(_edits(text, root, changes), reverse=True):
        text = text[:first] + fresh + text[last:]
    return text


def _edits(text: str, node: yaml.MappingNode, changes: Changes) -> list[tuple[int, int, str]]:
    """Return (begin, end, new text) of every change of a mapping."""
    present = {str(key.value): value for key, value in node.value}
    edits: list[tuple[int, int, str]] = []
    for key, fresh in changes.items():
        value = present.get(key)
        if isinstance(value, yaml.MappingNode) and isinstance(fresh, dict):
            edits += _edits(text, value, fresh)
        elif value is not None:
            edits.append((value.start_mark.index, _end(value), _inline(fresh)))
    missing = {key: fresh for key, fresh in changes.items() if key not in present}
    if missing:
        edits.append(_added(text, node, missing))
    return edits


def _added(text: str, node: yaml.MappingNode, missing: Changes) -> tuple[int, int, str]:
    if node.flow_style or not node.value:
        at = node.end_mark.index - 1
        comma = ", " if node.value else ""
        listed = ", ".join(f"{key}: {_inline(fresh)}" for key, fresh in missing.items())
        return at, at, comma + listed
    line_end = text.find("\n", _end(node))
    at = len(text) if line_end < 0 else line_end
    indent = " " * node.value[0][0].start_mark.column
    return at, at, "".join(_lines(missing, indent))


def _lines(missing: Changes, indent: str) -> list[str]:
    found = []
    for key, fresh in missing.items():
        if isinstance(fresh, dict):
            found += [f"\n{indent}{key}:", *_lines(fresh, indent + "  ")]
        else:
            found.append(f"\n{indent}{key}: {fresh}")
    return found


def _inline(fresh: str | Changes) -> str:
    if isinstance(fresh, str):
        return fresh
    return "{" + ", ".join(f"{key}: {_inline(value)}" for key, value in fresh.items()) + "}"


def _end(node: yaml.Node) -> int:
    """Return where the text of a value ends: of a block, that of its last item."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return int(node.end_mark.index)
