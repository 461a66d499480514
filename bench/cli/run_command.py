"""`compass-bench run`: joins bench, devices and dashboards for one run."""

from __future__ import annotations

import json as json_module
import re
import select
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import typer

from bench.acceptance.verdict import verdict_of
from bench.capture import Capture
from bench.cli.console import ConsoleProgress, print_verdict
from bench.cli.run_bus import RunBus, connect
from bench.errors import Aborted, BenchError, BusFault, ConfigError, ModuleSilent
from bench.executor import FAULT_NAMES, OTHER_FAULT, execute
from bench.module import Module
from bench.pairing import LatencyEstimate
from bench.plan import predictions, require_observable
from bench.procedure_loader import procedure_path
from bench.record.entries import measurement_of
from bench.record.recorder import RunRecorder
from bench.reference import Reference
from bench.rig import Rig
from bench.run_context import RunContext
from bench.run_files import RunFiles, load_run_files
from bench.sample_log import SampleLog
from bench.signals import SignalWatch
from bench.software import config_files, require_own_names, software_section
from bench.traffic import Traffic
from protocols.clock import MonotonicClock, SimulatedClock

if TYPE_CHECKING:
    from bench.acceptance.verdict import Verdict
    from bench.bus import BenchBus

SERIAL_PATTERN: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,31}")

_ASKING_S: Final = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRequest:
    """Options of the command."""

    procedure: str
    serial: str | None = None
    interface: str | None = None
    channel: str | None = None
    bitrate: int = 500_000
    rig_interface: str | None = None
    rig_channel: str | None = None
    site: Path | None = None
    limits: Path | None = None
    out: Path = Path("runs")
    seed: int = 1
    faults: tuple[str, ...] = ()
    nvm: Path | None = None
    replay: Path | None = None
    json: bool = False
    realtime: bool = False
    no_input: bool = False
    dashboard: bool = True
    quiet: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRun:
    """A run that has its verdict and its record."""

    exit_code: int
    serial: str
    recorder: RunRecorder
    verdict: Verdict


def run_procedure(request: RunRequest) -> int:
    """Run a procedure, print its verdict and return the exit code; raises as `finished_run`."""
    return finished_run(request).exit_code


def finished_run(request: RunRequest) -> FinishedRun:
    """Run a procedure and print its verdict.

    Raises
    ------
    ConfigError
        If a file or option cannot be used; no record is begun.
    LinkError
        If the channel cannot be opened; no record is begun.
    BenchNotReady
        If the record cannot be written.
    """
    require_own_names()
    files = load_run_files(request.procedure, site=request.site, limits=request.limits)
    judged = predictions(files.procedure, files.station, judged_only=True)
    require_observable(files.procedure, judged)  # else a good unit would fail
    serial = _serial(request)
    try:
        run_bus = connect(request, serial, files.station, files.procedure.part)
    except (ModuleSilent, BusFault) as fault:
        return _not_started(request, serial, files, fault)
    cancel = run_bus.bus.cancel
    with SignalWatch(cancel) as watch:
        watch.deafen()  # the run itself listens; before and after it signals only count
        try:
            recorder = _recorder(request, serial, files, run_bus.clock, virtual=run_bus.virtual)
            context = _context(request, serial, files, run_bus, recorder)
            verdict = execute(files.procedure, context)
        finally:
            run_bus.close()
        _show(request, serial, recorder, verdict)
    code = verdict.outcome.exit_code
    if cancel.signal_number is not None:
        code = Aborted(cancel.signal_number).exit_code
    return FinishedRun(exit_code=code, serial=serial, recorder=recorder, verdict=verdict)


def _not_started(
    request: RunRequest, serial: str, files: RunFiles, fault: BenchError
) -> FinishedRun:
    """Leave a record of a run that could not start."""
    recorder = _recorder(request, serial, files, MonotonicClock(), virtual=False)
    name = FAULT_NAMES.get(type(fault), OTHER_FAULT)
    verdict = replace(verdict_of([], error=str(fault)), first_failure=name)
    recorder.close(verdict)
    _show(request, serial, recorder, verdict)
    code = verdict.outcome.exit_code
    return FinishedRun(exit_code=code, serial=serial, recorder=recorder, verdict=verdict)


def _show(request: RunRequest, serial: str, recorder: RunRecorder, verdict: Verdict) -> None:
    if request.json:
        typer.echo(json_module.dumps(recorder.record, indent=1, allow_nan=False))
    elif not request.quiet:
        print_verdict(
            verdict,
            serial,
            recorder.folder,
            measurements=map(measurement_of, recorder.record["measurements"]),
            record=recorder.record,
        )


def _serial(request: RunRequest) -> str:
    serial = request.serial
    if serial is None:
        if request.no_input or not sys.stdin.isatty():
            message = "--serial must be the serial number of the unit; instead received none"
            raise ConfigError(message)
        serial = typer.prompt("Scan the serial number", err=True).strip()
    if not SERIAL_PATTERN.fullmatch(serial):
        message = (
            "--serial must be 1 to 32 letters, digits, dots, dashes or underscores; "
            f"instead received {serial!r}"
        )
        raise ConfigError(message)
    return serial


def _recorder(
    request: RunRequest,
    serial: str,
    files: RunFiles,
    clock: SimulatedClock | MonotonicClock,
    *,
    virtual: bool,
) -> RunRecorder:
    products = {}
    if request.dashboard:
        from dashboards.recorder import write_recording

        products["run.rrd"] = write_recording
    recorder = RunRecorder(
        request.out,
        serial,
        files.procedure.name,
        clock=clock,
        procedure_version=files.procedure.version,
        seed=request.seed if virtual else None,
        products=products,
    )
    _record_conditions(recorder, request, files)
    return recorder


def _record_conditions(recorder: RunRecorder, request: RunRequest, files: RunFiles) -> None:
    """Write down with what software, files and bus the run is made; copy the files."""
    recorder.set("software", software_section())
    copies = {
        "procedure": procedure_path(request.procedure),
        "limits": files.limits.path,
        "station": files.station.path,
    }
    hashes = config_files(copies, recorder.path("config"))
    limits = {"limits_id": files.limits.id, "limits_version": files.limits.version}
    recorder.set("config", {**hashes, **limits})
    recorder.set(
        "bus",
        {
            "interface": request.interface or "lockstep",
            "channel": request.channel,
            "bitrate": request.bitrate,
        },
    )


def _context(
    request: RunRequest, serial: str, files: RunFiles, run_bus: RunBus, recorder: RunRecorder
) -> RunContext:
    bus = run_bus.bus
    traffic = Traffic(request.bitrate, bus.start_ns)
    capture = Capture(recorder.path("bus.blf"), start_ns=bus.start_ns)
    bus.add_sink(capture)
    bus.add_sink(traffic)
    module = Module(bus)
    rig = Rig(bus) if files.procedure.uses_rig else None
    sensor = files.station.reference
    reference = None if sensor is None else Reference(bus, sensor.address)
    samples = SampleLog(recorder.path("samples.parquet"), module, rig, reference=reference)
    latency = LatencyEstimate() if bus.mode == "free" and rig is not None else None
    if latency is not None:
        samples.add_sink(latency)
    context = RunContext(
        bus=bus,
        module=module,
        sample_log=samples,
        station=files.station,
        limits=files.limits,
        recorder=recorder,
        procedure=files.procedure,
        serial=serial,
        rig=rig,
        reference=reference,
        ask=None if request.no_input or not sys.stdin.isatty() else partial(_ask, bus),
    )
    if not (request.json or request.quiet):
        context.progress = ConsoleProgress()
    context.finish = [
        ("close the samples", samples.close),
        ("hand over the last frames", bus.flush),
        ("close the capture", capture.close),
        ("record the latency", lambda: _record_latency(recorder, latency)),
        ("record the traffic", lambda: recorder.set("bus", {"traffic": traffic.rows()})),
        ("name the faults", lambda: recorder.set("injected_faults", list(request.faults))),
    ]
    return context


def _record_latency(recorder: RunRecorder, latency: LatencyEstimate | None) -> None:
    if latency is not None:
        recorder.set("bus", {"pairing": latency.entry()})


def _ask(bus: BenchBus, question: str) -> str:
    """Return the operator's answer; the wish to end the run is honoured while waiting.

    On a real bus time goes on meanwhile, as the drives would stop otherwise.

    Raises
    ------
    ConfigError
        If the terminal has no answer to give any more.
    """
    typer.echo(f"{question}: ", nl=False, err=True)
    while not select.select([sys.stdin], [], [], 0.0)[0]:
        if bus.mode == "lockstep":
            bus.cancel.check()
            time.sleep(_ASKING_S)
        else:
            bus.tick()
    answer = sys.stdin.readline()
    if not answer:
        message = f"the operator must answer {question!r}; instead the terminal was closed"
        raise ConfigError(message)
    return answer.strip()
