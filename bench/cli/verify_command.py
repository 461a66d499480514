"""`compass-bench verify`: the bench itself, by reversal of a golden unit."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from typing import TYPE_CHECKING, Any, Final

import typer

from bench.acceptance.outcome import Outcome
from bench.acceptance.reversal_evaluation import CHANGES, change_over_u, values_of
from bench.cli.run_command import SERIAL_PATTERN, RunRequest, finished_run
from bench.errors import ConfigError
from bench.station import load_station
from bench.station_writer import require_target, station_changes, write_station

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from bench.acceptance.reversal_evaluation import StationValue
    from bench.cli.run_command import FinishedRun
    from bench.station import Station

PROCEDURE: Final = "bench_verify"
NOT_VERIFIED: Final = 5
"""Exit code: the file does not hold, or the golden unit failed."""
LABELS: Final = {
    "index": "seat index",
    "pitch": "seat pitch",
    "roll": "seat roll",
    "iron_x": "fixture iron, forward",
    "iron_y": "fixture iron, right",
    "iron_z": "fixture iron, down",
    "field_azimuth": "field azimuth",
    "dip": "dip (not written)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyRequest:
    """Options of the command: those of `run`, the golden unit, and where to write."""

    run: RunRequest
    write: Path | None = None


def today() -> date:
    """Return the day, in UTC."""
    return datetime.now(UTC).date()


def verify_bench(request: VerifyRequest, *, day: Callable[[], date] = today) -> int:
    """Run the reversal, show file and finding side by side, write the file; return the exit code.

    0: the file holds. 5: a value lies outside its uncertainty, or the golden unit failed. The file
    is written wherever the reversal itself is sound, also when the former values do not hold.

    Raises
    ------
    ConfigError
        If an option cannot be used; nothing is measured then.
    BenchNotReady
        If the file cannot be written.
    """
    asked = request.run
    station = load_station(str(asked.site) if asked.site else "default")
    if request.write is not None:
        require_target(request.write)
    run = finished_run(_with_golden(asked, station))
    section = run.recorder.record["reversal"]
    sound = "found" in section and not _missed(run, CHANGES)
    if "found" in section and not (asked.json or asked.quiet):
        _show(values_of(section["former"]), values_of(section["found"]), _limits(run))
    if sound and request.write is not None:
        _write(request.write, station, section, golden=run.serial, verified=day())
    elif request.write is not None:
        typer.echo(f"{request.write} was not written: the run does not tell the seat", err=True)
    elif run.exit_code == 0 or sound:
        typer.echo("nothing was written; --write FILE writes a station file", err=True)
    return _exit_code(run, sound=sound)


def _with_golden(asked: RunRequest, station: Station) -> RunRequest:
    serial = asked.serial or station.seat.golden or None
    if serial is None and (asked.no_input or not sys.stdin.isatty()):
        message = (
            "--golden must be the serial number of the golden unit; instead received none, and "
            f"{station.path} names none"
        )
        raise ConfigError(message)
    if serial is not None and not SERIAL_PATTERN.fullmatch(serial):
        message = (
            "--golden must be 1 to 32 letters, digits, dots, dashes or underscores; "
            f"instead received {serial!r}"
        )
        raise ConfigError(message)
    return replace(asked, procedure=PROCEDURE, serial=serial)


def _missed(run: FinishedRun, but: Mapping[str, Any]) -> list[str]:
    """Return the names of what missed its limits, or stopped the run, beside some."""
    measured = run.recorder.record["measurements"]
    bad = (Outcome.FAIL.value, Outcome.ERROR.value)
    missed = [m["name"] for m in measured if m["outcome"] in bad and m["name"] not in but]
    steps = run.recorder.record["steps"]
    return missed + [s["name"] for s in steps if s["message"] or s["outcome"] is None]


def _exit_code(run: FinishedRun, *, sound: bool) -> int:
    failed = run.verdict.outcome is Outcome.FAIL
    changed = sound and run.verdict.outcome is Outcome.ERROR
    return NOT_VERIFIED if failed or changed else run.exit_code


def _write(
    path: Path, station: Station, section: Mapping[str, Any], *, golden: str, verified: date
) -> None:
    changes = station_changes(values_of(section["found"]), golden=golden, verified=verified)
    written = write_station(station.path, path, changes)
    typer.echo(f"station file written: {written.path}", err=True)


def _limits(run: FinishedRun) -> dict[str, float]:
    """Return the largest E_n number of each value, by its limit."""
    high = {m["name"]: m["high"] for m in run.recorder.record["measurements"]}
    return {part: high[name] for name, parts in CHANGES.items() for part in parts if name in high}


def _show(
    former: Mapping[str, StationValue],
    found: Mapping[str, StationValue],
    limits: Mapping[str, float],
) -> None:
    typer.echo(f"{'':22}{'station file':>24}{'reversal':>24}{'E_n':>8}")
    for name, label in LABELS.items():
        before, now = former[name], found[name]
        if now.told:
            number = change_over_u(before, now)
            said = f"{_said(now):>24}{number:8.2f}{'  changed' if number > limits[name] else ''}"
        else:
            said = f"{'not told: file holds':>24}"
        typer.echo(f"{label:22}{_said(before):>24}{said}")


def _said(one: StationValue) -> str:
    digits = 3 if one.unit == "deg" else 2
    return f"{one.value:+.{digits}f} ± {one.u:.{digits}f} {one.unit}"
