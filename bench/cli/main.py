"""compass-bench: every command of the product.

Modules that cost time to import are imported by the commands that need them, so that
``compass-bench --help`` answers at once.
"""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Annotated

import typer

from bench.cli import options
from bench.errors import Aborted, BenchError

app = typer.Typer(
    name="compass-bench",
    help="Hardware-in-the-loop test bench over CAN for electronic compass modules.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Procedure = Annotated[
    str, typer.Argument(help="Name of a shipped procedure, or the path of a YAML file.")
]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a run, or the link `latest`.")]


@app.command()
def run(  # noqa: PLR0913 - one parameter an option of the command line
    procedure: Procedure,
    serial: options.Serial = None,
    interface: options.Interface = None,
    channel: options.Channel = None,
    bitrate: options.Bitrate = 500_000,
    rig_interface: options.RigInterface = None,
    rig_channel: options.RigChannel = None,
    site: options.Site = None,
    limits: options.Limits = None,
    out: options.Out = Path("runs"),
    seed: options.Seed = 1,
    fault: options.Fault = None,
    nvm: options.Nvm = None,
    replay: options.Replay = None,
    *,
    json: options.Json = False,
    realtime: Annotated[
        bool, typer.Option("--realtime", help="Hold the simulated clock to the wall clock.")
    ] = False,
    no_input: Annotated[
        bool, typer.Option("--no-input", help="Never ask; a prompt is an error.")
    ] = False,
    dashboard: Annotated[
        bool, typer.Option("--dashboard/--no-dashboard", help="Write run.rrd at the end.")
    ] = True,
) -> None:
    """Run a procedure on one unit; exit 0 PASS, 1 FAIL, 3 MARGINAL, 4 ERROR."""
    from bench.cli.run_command import RunRequest, run_procedure

    request = RunRequest(
        procedure=procedure,
        serial=serial,
        interface=interface,
        channel=channel,
        bitrate=bitrate,
        rig_interface=rig_interface,
        rig_channel=rig_channel,
        site=site,
        limits=limits,
        out=out,
        seed=seed,
        faults=tuple(fault or ()),
        nvm=nvm,
        replay=replay,
        json=json,
        realtime=realtime,
        no_input=no_input,
        dashboard=dashboard,
    )
    raise typer.Exit(run_procedure(request))


@app.command()
def simulate(  # noqa: PLR0913 - one parameter an option of the command line
    interface: options.Interface = None,
    channel: options.Channel = None,
    bitrate: options.Bitrate = 500_000,
    serial: Annotated[
        str, typer.Option("--serial", help="Serial number of the virtual unit.")
    ] = "SN0001",
    site: options.Site = None,
    seed: options.Seed = 1,
    fault: options.Fault = None,
    nvm: options.Nvm = None,
    replay: options.Replay = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0.0, help="End after so much wall time.")
    ] = None,
    *,
    free_running: Annotated[
        bool,
        typer.Option("--free-running", help="Devices run on their own clocks, as hardware does."),
    ] = False,
) -> None:
    """Run the virtual rig and module as a process of their own, on any channel."""
    from bench.cli.simulate_command import SimulateRequest, simulate_devices

    request = SimulateRequest(
        interface=interface,
        channel=channel,
        bitrate=bitrate,
        serial=serial,
        site=site,
        seed=seed,
        faults=tuple(fault or ()),
        nvm=nvm,
        replay=replay,
        seconds=seconds,
        free_running=free_running,
    )
    raise typer.Exit(simulate_devices(request))


@app.command()
def plan(
    procedure: Procedure,
    site: options.Site = None,
    limits: options.Limits = None,
    bitrate: options.Bitrate = 500_000,
    *,
    json: options.Json = False,
) -> None:
    """Show poses, travel, time, bus load and what each fit can observe; opens no bus."""
    from bench.cli.plan_command import show_plan

    raise typer.Exit(show_plan(procedure, site=site, limits=limits, bitrate=bitrate, json=json))


@app.command()
def fit(
    recording: Annotated[
        Path, typer.Argument(help="CSV: mx,my,mz [,ax,ay,az] [,heading_deg,...].")
    ],
    method: Annotated[str, typer.Option("--method", "-m", help="A method's name, or all.")] = "all",
    unit: options.FieldUnit = None,
    holdout: Annotated[
        str, typer.Option("--holdout", help="blocks: judge on rows not fitted; none.")
    ] = "blocks",
    declination: Annotated[
        float,
        typer.Option("--declination", help="East declination in deg, where headings are true."),
    ] = 0.0,
    *,
    json: options.Json = False,
) -> None:
    """Calibrate from a recording without a bus; exit 1 where the method refuses."""
    from bench.cli.recording_commands import fit_recording

    raise typer.Exit(
        fit_recording(
            recording,
            method=method,
            unit=unit,
            holdout=holdout,
            declination_deg=declination,
            json=json,
        )
    )


@app.command(name="import")
def import_(  # noqa: PLR0913 - one parameter an option of the command line
    source: Annotated[Path, typer.Argument(help="Foreign recording with the magnetometer.")],
    target: Annotated[Path, typer.Argument(help="CSV of the product to write.")],
    preset: Annotated[
        str | None, typer.Option("--preset", help="Known format; `list` names them.")
    ] = None,
    accel: Annotated[
        Path | None, typer.Option("--accel", help="Second file with the accelerometer.")
    ] = None,
    columns: options.Names = None,
    accel_columns: options.Names = None,
    field: Annotated[
        str | None, typer.Option("--field", help="Columns of the magnetometer's x, y, z.")
    ] = None,
    accel_field: Annotated[
        str | None, typer.Option("--accel-field", help="Columns of the accelerometer's x, y, z.")
    ] = None,
    quaternion: Annotated[
        str | None,
        typer.Option("--quaternion", help="Columns w, x, y, z, from the sensor to ENU."),
    ] = None,
    unit: options.FieldUnit = None,
    accel_unit: Annotated[
        str | None, typer.Option("--accel-unit", help="g, mg, m/s2 or counts.")
    ] = None,
    mg_per_count: Annotated[
        float | None, typer.Option("--mg-per-count", min=0.0, help="Size of a count.")
    ] = None,
    g_per_count: Annotated[
        float | None, typer.Option("--g-per-count", min=0.0, help="Size of a count.")
    ] = None,
    axes: Annotated[
        str | None,
        typer.Option("--axes", help="Sensor's axes along forward, right, down: x,-y,-z."),
    ] = None,
    accel_axes: Annotated[
        str | None, typer.Option("--accel-axes", help="As --axes, of the accelerometer.")
    ] = None,
    time: Annotated[str | None, typer.Option("--time", help="Column of the time in s.")] = None,
    rate_hz: Annotated[
        float | None, typer.Option("--rate", min=0.001, help="Rate without a time column, Hz.")
    ] = None,
    skip_rows: Annotated[
        int | None, typer.Option("--skip-rows", min=0, help="Lines before the data or its header.")
    ] = None,
    delimiter: Annotated[
        str | None, typer.Option("--delimiter", help="Separator; found by itself without.")
    ] = None,
    resample: Annotated[
        str | None,
        typer.Option("--resample", help="Second file onto the first: linear or nearest."),
    ] = None,
) -> None:
    """Bring a foreign recording into the product's CSV."""
    from bench.cli.recording_commands import import_recording, names

    layout = {
        "columns": names(columns),
        "accel_columns": names(accel_columns),
        "field": names(field),
        "accel": names(accel_field),
        "quaternion": names(quaternion),
        "field_unit": unit,
        "accel_unit": accel_unit,
        "mg_per_count": mg_per_count,
        "g_per_count": g_per_count,
        "field_axes": axes,
        "accel_axes": accel_axes,
        "time": time,
        "rate_hz": rate_hz,
        "skip_lines": skip_rows,
        "delimiter": delimiter,
        "resample": resample,
    }
    raise typer.Exit(import_recording(source, target, preset, accel, layout))


@app.command()
def judge(folder: RunFolder, limits: options.Limits = None, *, json: options.Json = False) -> None:
    """Recompute a run's verdict from its raw samples, also against other limits."""
    from bench.cli.record_commands import judge_run

    raise typer.Exit(judge_run(folder, limits=limits, json=json))


@app.command()
def view(
    folder: RunFolder,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", help="Write the dashboard to a PNG instead of opening it."),
    ] = None,
    *,
    rebuild: Annotated[
        bool, typer.Option("--rebuild", help="Make run.rrd anew from the samples.")
    ] = False,
) -> None:
    """Open a run's recording in rerun."""
    from bench.cli.record_commands import view_run

    raise typer.Exit(view_run(folder, picture=picture, rebuild=rebuild))


@app.command()
def report(folder: RunFolder) -> None:
    """Write a run's report.html anew and print its path."""
    from bench.cli.record_commands import write_report

    raise typer.Exit(write_report(folder))


@app.command()
def doctor(*, json: options.Json = False) -> None:
    """Check this machine and this installation; exit 1 if something must be mended."""
    from bench.cli.doctor import examine

    raise typer.Exit(examine(json=json))


@app.command()
def schema() -> None:
    """Print the JSON Schema of procedure files, for completion in an editor."""
    from bench.cli.catalogue_commands import print_schema

    raise typer.Exit(print_schema())


@app.command()
def faults(*, json: options.Json = False) -> None:
    """List the faults that the virtual devices can have."""
    from bench.cli.catalogue_commands import print_faults

    raise typer.Exit(print_faults(json=json))


def _abort(number: int, _: object) -> None:
    """End a command that has nothing to bring into a safe state."""
    raise Aborted(number)


def main() -> None:
    """Run the command line; every expected error is one sentence and an exit code."""
    from protocols.errors import LinkError

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _abort)
    try:
        app()
    except BenchError as error:
        typer.echo(f"compass-bench: {error}", err=True)
        sys.exit(error.exit_code)
    except LinkError as error:
        typer.echo(f"compass-bench: {error}", err=True)
        sys.exit(2)
    except BrokenPipeError:
        sys.exit(141)


if __name__ == "__main__":
    main()
