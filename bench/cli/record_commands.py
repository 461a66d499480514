"""`judge`, `view` and `report`: what can be done with the folder of a run."""

from __future__ import annotations

import json as json_module
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from bench.cli.console import ConsoleProgress, print_verdict
from bench.errors import ConfigError
from bench.record.document import read_record
from bench.record.entries import measurement_entry
from bench.record.plain import plain

if TYPE_CHECKING:
    from pathlib import Path


def judge_run(folder: Path, *, limits: Path | None, json: bool) -> int:
    """Recompute a run's verdict from its samples and print it; return its exit code.

    Raises
    ------
    ConfigError
        If the folder is not a run's, or the limits cannot be used.
    """
    from bench.rejudge import rejudge

    judged = rejudge(folder, limits)
    if json:
        typer.echo(
            json_module.dumps(
                {
                    "verdict": plain(asdict(judged.verdict)),
                    "recorded": judged.recorded,
                    "differing": judged.differing,
                    "measurements": [measurement_entry(m) for m in judged.measurements],
                },
                indent=1,
                allow_nan=False,
            )
        )
        return judged.verdict.outcome.exit_code
    progress = ConsoleProgress()
    for measurement in judged.measurements:
        progress.measured(measurement)
    serial = str(read_record(folder)["run"]["serial"])
    print_verdict(judged.verdict, serial, None, measurements=judged.measurements)
    typer.echo(f"recorded verdict: {judged.recorded or 'none, the run was cut off'}")
    if judged.differing:
        typer.echo(f"differ from the record: {', '.join(judged.differing)}")
    return judged.verdict.outcome.exit_code


def view_run(folder: Path, *, picture: Path | None, rebuild: bool) -> int:
    """Open run.rrd in the viewer, or render it into a picture; make it where it is missing.

    Raises
    ------
    ConfigError
        If the folder is not a run's, or no picture can be taken on this machine.
    """
    from dashboards.recorder import write_recording
    from dashboards.viewer import ViewerFailed, open_viewer, take_picture

    read_record(folder)
    recording = folder / "run.rrd"
    if rebuild or not recording.exists():
        write_recording(recording)
    if picture is None:
        return open_viewer(recording)
    try:
        complaints = take_picture(recording, picture)
    except ViewerFailed as error:
        raise ConfigError(str(error)) from error
    for complaint in complaints:
        typer.echo(complaint, err=True)
    typer.echo(picture)
    return int(bool(complaints))


def write_report(folder: Path) -> int:
    """Write report.html anew from record.json and print its path.

    Raises
    ------
    ConfigError
        If the folder is not a run's.
    """
    from bench.record.report import rewrite_report

    typer.echo(rewrite_report(folder))
    return 0
