"""The bus of a run: with virtual devices in this process, or a channel with others on it."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bench.bus import BenchBus, detect_mode
from bench.cli.bus_options import is_in_process, open_link
from bench.errors import ConfigError
from protocols.clock import MonotonicClock, SimulatedClock
from protocols.compass import PART_THREE_AXIS, PARTS
from protocols.link import Wire
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.cli.run_command import RunRequest
    from bench.station import Station
    from protocols.pycan_link import PyCanLink


@dataclass(slots=True, kw_only=True)
class RunBus:
    """An open bus, its clock, and what is to be closed with it."""

    bus: BenchBus
    clock: SimulatedClock | MonotonicClock
    virtual: bool
    closers: list[Callable[[], None]] = field(default_factory=list)

    def close(self) -> None:
        """Leave the bus and end what was started for it."""
        self.bus.close()
        for close in self.closers:
            close()


def connect(request: RunRequest, serial: str, station: Station, part: str | None = None) -> RunBus:
    """Open the bus of a run.

    Parameters
    ----------
    request : RunRequest
    serial : str
        Serial number of the unit; a virtual one has it.
    station : Station
        Site of the virtual devices.
    part : str, optional
        Part number that the procedure asks for. Virtual devices are made of it where there is
        such a part; else the unit has three axes, and the procedure finds the wrong part.

    Raises
    ------
    ConfigError
        If options contradict each other.
    LinkError
        If a channel cannot be opened.
    """
    if is_in_process(request.interface, request.channel):
        run_bus = _with_virtual_devices(request, serial, station, part)
    else:
        run_bus = _on_channel(request)
    if request.realtime and isinstance(run_bus.clock, SimulatedClock):
        run_bus.bus.add_hook(_RealTime(run_bus.bus))
    return run_bus


def _with_virtual_devices(
    request: RunRequest, serial: str, station: Station, part: str | None
) -> RunBus:
    from bench.cli.simulate_command import refused, simulator_options
    from devices.simulator import build_host

    options = simulator_options(
        serial=serial,
        part=part if part in PARTS else PART_THREE_AXIS,
        seed=request.seed,
        faults=request.faults,
        nvm=request.nvm,
        replay=request.replay,
        station=station,
    )
    wire = Wire()
    clock = SimulatedClock()
    link = wire.attach()
    device_link = wire.attach()
    try:
        host = build_host(options, device_link)
    except (ValueError, OSError) as error:
        raise refused(error) from error
    wire.add_server(host.serve)
    mode = detect_mode(link, clock)  # as across processes, so that both give the same frames
    bus = BenchBus(link, clock, mode=mode, bitrate=request.bitrate)
    return RunBus(bus=bus, clock=clock, virtual=True, closers=[device_link.close])


def _on_channel(request: RunRequest) -> RunBus:
    for name, value in (
        ("--fault", request.faults),
        ("--nvm", request.nvm),
        ("--replay", request.replay),
    ):
        if value:
            message = (
                f"{name} must be given to `compass-bench simulate` where the devices run, "
                f"not to a run on {request.interface} {request.channel or ''}"
            )
            raise ConfigError(message)
    wall = MonotonicClock()
    link = open_link(request.interface, request.channel, request.bitrate, wall)
    rig_link: PyCanLink | None = None
    if request.rig_interface or request.rig_channel:
        rig_link = open_link(
            request.rig_interface or request.interface, request.rig_channel, request.bitrate, wall
        )
    try:
        mode = detect_mode(rig_link or link, wall)
    except BaseException:
        link.close()
        if rig_link is not None:
            rig_link.close()
        raise
    clock: SimulatedClock | MonotonicClock = wall
    if mode == "lockstep":
        link.clock = clock = SimulatedClock()
        if rig_link is not None:
            rig_link.clock = clock
    bus = BenchBus(link, clock, mode=mode, rig_link=rig_link, bitrate=request.bitrate)
    return RunBus(bus=bus, clock=clock, virtual=False)


class _RealTime:
    """Holds simulated time to the wall clock, for watching."""

    def __init__(self, bus: BenchBus) -> None:
        self._bus = bus
        self._start_s = time.monotonic()

    def __call__(self) -> None:
        ahead_s = self._bus.tick_count * TICK_S - (time.monotonic() - self._start_s)
        if ahead_s > 0.0:
            time.sleep(ahead_s)
