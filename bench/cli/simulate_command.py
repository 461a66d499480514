"""`compass-bench simulate`: the virtual devices as a process of their own."""

from __future__ import annotations

import signal
from dataclasses import dataclass
from typing import TYPE_CHECKING

import typer

from bench.cli.bus_options import is_in_process, open_link
from bench.errors import ConfigError
from bench.station import load_station
from devices.simulator import SimulatorOptions, simulate
from protocols.clock import MonotonicClock
from protocols.compass import PART_THREE_AXIS

if TYPE_CHECKING:
    from pathlib import Path

    from bench.station import Station


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateRequest:
    """Options of the command."""

    interface: str | None
    channel: str | None
    bitrate: int
    serial: str
    part: str = PART_THREE_AXIS
    site: Path | None
    seed: int
    faults: tuple[str, ...]
    nvm: Path | None
    replay: Path | None
    seconds: float | None
    free_running: bool


def simulator_options(
    *,
    serial: str,
    part: str,
    seed: int,
    faults: tuple[str, ...],
    nvm: Path | None,
    replay: Path | None,
    station: Station,
) -> SimulatorOptions:
    """Return the options of the virtual devices on a station.

    Raises
    ------
    ConfigError
        If a part or a fault does not exist, or the memory's file cannot be one.
    """
    if nvm is not None and (not nvm.parent.is_dir() or (nvm.exists() and not nvm.is_file())):
        message = f"--nvm must be a file in a folder that exists; instead received {nvm}"
        raise ConfigError(message)
    try:
        return SimulatorOptions(
            serial=serial,
            part=part,
            seed=seed,
            faults=faults,
            nvm=nvm,
            replay=replay,
            horizontal_mg=station.horizontal_mg,
            dip_deg=station.dip_deg,
            declination_deg=station.declination_deg,
            reference_address=station.reference.address if station.reference else None,
        )
    except (ValueError, OSError) as error:
        raise refused(error) from error


def refused(error: ValueError | OSError) -> ConfigError:
    """Return the error of an option that the virtual devices do not take."""
    if isinstance(error, OSError) and error.filename is not None:
        return ConfigError(f"{error.filename} cannot be used: {error.strerror}")
    return ConfigError(str(error))


def simulate_devices(request: SimulateRequest) -> int:
    """Run rig and module until a signal or the time ends it; return the exit code.

    Raises
    ------
    ConfigError
        If no channel is named or an option cannot be used.
    LinkError
        If the channel cannot be opened.
    """
    if is_in_process(request.interface, request.channel):
        message = "simulate needs --interface and --channel of a bus that the bench can reach"
        raise ConfigError(message)
    options = simulator_options(
        serial=request.serial,
        part=request.part,
        seed=request.seed,
        faults=request.faults,
        nvm=request.nvm,
        replay=request.replay,
        station=load_station(str(request.site) if request.site else "default"),
    )
    clock = MonotonicClock()
    link = open_link(request.interface, request.channel, request.bitrate, clock)
    ended: list[int] = []
    typer.echo(
        f"virtual rig and module {request.serial} ({request.part}, seed {request.seed}) on "
        f"{request.interface} {request.channel or ''}, "
        f"{'on their own clocks' if request.free_running else 'in lock-step'}; end with Ctrl-C",
        err=True,
    )
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _: ended.append(received))
    try:
        simulate(
            options,
            link,
            free_running=request.free_running,
            stop=lambda: bool(ended),
            seconds=request.seconds,
            clock=clock,
        )
    except (ValueError, OSError) as error:
        raise refused(error) from error
    finally:
        link.close()
    return 0
