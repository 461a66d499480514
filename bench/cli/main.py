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

from bench.cli import layout_options, options
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
    faults: options.Faults = None,
    nvm: options.Nvm = None,
    replay: options.Replay = None,
    *,
    json: options.Json = False,
    realtime: options.Realtime = False,
    no_input: options.NoInput = False,
    dashboard: options.Dashboard = True,
) -> None:
    """Run a procedure on one unit; exit 0 PASS, 1 FAIL, 3 MARGINAL, 4 ERROR."""
    given = {**locals(), "faults": tuple(faults or ())}  # options by their names in RunRequest
    from bench.cli.run_command import RunRequest, run_procedure

    raise typer.Exit(run_procedure(RunRequest(**given)))


@app.command()
def verify(  # noqa: PLR0913 - one parameter an option of the command line
    golden: Annotated[
        str | None,
        typer.Option("--golden", help="Serial number of the golden unit; else the station file's."),
    ] = None,
    interface: options.Interface = None,
    channel: options.Channel = None,
    bitrate: options.Bitrate = 500_000,
    rig_interface: options.RigInterface = None,
    rig_channel: options.RigChannel = None,
    site: options.Site = None,
    limits: options.Limits = None,
    out: options.Out = Path("runs"),
    seed: options.Seed = 1,
    faults: options.Faults = None,
    nvm: options.Nvm = None,
    write: Annotated[
        Path | None, typer.Option("--write", help="Station file to write with what was found.")
    ] = None,
    *,
    json: options.Json = False,
    realtime: options.Realtime = False,
    no_input: options.NoInput = False,
    dashboard: options.Dashboard = True,
) -> None:
    """Verify the bench by reversal of a golden unit; exit 0 verified, 5 not verified."""
    given = {**locals(), "faults": tuple(faults or ())}  # options by their names in RunRequest
    from bench.cli.run_command import RunRequest
    from bench.cli.verify_command import VerifyRequest, verify_bench

    path, serial = given.pop("write"), given.pop("golden")
    run = RunRequest(procedure="bench_verify", serial=serial, **given)
    raise typer.Exit(verify_bench(VerifyRequest(run=run, write=path)))


@app.command()
def simulate(  # noqa: PLR0913 - one parameter an option of the command line
    interface: options.Interface = None,
    channel: options.Channel = None,
    bitrate: options.Bitrate = 500_000,
    serial: Annotated[
        str, typer.Option("--serial", help="Serial number of the virtual unit.")
    ] = "SN0001",
    part: options.Part = "CB-AMR3",
    site: options.Site = None,
    seed: options.Seed = 1,
    faults: options.Faults = None,
    nvm: options.Nvm = None,
    replay: options.Replay = None,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", min=0.0, max=1e9, help="End after so much wall time."),
    ] = None,
    *,
    free_running: Annotated[
        bool,
        typer.Option("--free-running", help="Devices run on their own clocks, as hardware does."),
    ] = False,
) -> None:
    """Run the virtual rig and module as a process of their own, on any channel."""
    given = {**locals(), "faults": tuple(faults or ())}  # options by their names in SimulateRequest
    from bench.cli.simulate_command import SimulateRequest, simulate_devices

    raise typer.Exit(simulate_devices(SimulateRequest(**given)))


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
    order: Annotated[
        str,
        typer.Option(
            "--order",
            help="Order of compensation: body; for study soft_first, tilt_first, tilt_reversed.",
        ),
    ] = "body",
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
            order=order,
            declination_deg=declination,
            json=json,
        )
    )


@app.command(name="import")
def import_(  # noqa: PLR0913 - one parameter an option of the command line
    source: Annotated[Path, typer.Argument(help="Foreign recording with the magnetometer.")],
    target: Annotated[Path, typer.Argument(help="CSV of the product to write.")],
    preset: layout_options.Preset = None,
    accelerometer: layout_options.Accelerometer = None,
    columns: layout_options.Columns = None,
    accel_columns: layout_options.AccelColumns = None,
    field: layout_options.Field = None,
    accel: layout_options.Accel = None,
    quaternion: layout_options.Quaternion = None,
    field_unit: options.FieldUnit = None,
    accel_unit: layout_options.AccelUnit = None,
    mg_per_count: layout_options.MgPerCount = None,
    g_per_count: layout_options.GPerCount = None,
    field_axes: layout_options.FieldAxes = None,
    accel_axes: layout_options.AccelAxes = None,
    time: layout_options.Time = None,
    rate_hz: layout_options.Rate = None,
    skip_lines: layout_options.SkipLines = None,
    delimiter: layout_options.Delimiter = None,
    resample: layout_options.Resample = None,
) -> None:
    """Bring a foreign recording into the product's CSV."""
    layout = dict(locals())  # every option by its name, as ImportOptions calls it too
    from bench.cli.recording_commands import import_recording

    for name in ("source", "target", "preset", "accelerometer"):
        del layout[name]
    raise typer.Exit(import_recording(source, target, preset, accelerometer, layout))


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
def reproduce(
    paper: Annotated[
        str | None, typer.Argument(help="cho_park, skula, caruso or konvalin; all if left out.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for README.md, results.json and the figures (SVG)."),
    ] = None,
    *,
    json: options.Json = False,
) -> None:
    """Reproduce the papers' tables and figures; exit 1 if a number does not hold."""
    from bench.cli.reproduce_command import reproduce_papers

    raise typer.Exit(reproduce_papers(paper, json=json, out=out))


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

    before = {number: signal.signal(number, _abort) for number in (signal.SIGINT, signal.SIGTERM)}
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
    except OSError as error:
        what = error.filename or "standard output or a file"
        typer.echo(f"compass-bench: {what} cannot be used: {error.strerror or error}", err=True)
        sys.exit(4)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


if __name__ == "__main__":
    main()
