"""A bench on a wire: with a simulator of a few lines, or with the whole virtual station."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

from bench.bus import BenchBus
from bench.module import Module
from bench.rig import Rig
from devices.simulator import SimulatorOptions, build_host
from protocols.clock import SimulatedClock
from protocols.link import Wire
from protocols.sync import SYNC_ID, TICK_DONE_ID, pack_tick_done

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from devices.host import Host
    from protocols.frame import Frame


class Echo:
    """A lock-step simulator that sends what a test tells it, then tick-done."""

    def __init__(self, wire: Wire) -> None:
        self.port = wire.attach()
        self.heard: list[Frame] = []
        self.says: Callable[[int], list[tuple[int, bytes]]] = lambda _: []
        self.alive = True
        self.tick = 0
        wire.add_server(self.serve)

    def serve(self) -> None:
        """Answer every SYNC that waits."""
        while (frame := self.port.poll()) is not None:
            self.heard.append(frame)
            if frame.can_id == SYNC_ID and self.alive:
                self.tick += 1
                for can_id, data in self.says(self.tick):
                    self.port.send(can_id, data)
                self.port.send(TICK_DONE_ID, pack_tick_done(self.tick, frame.data[0]))


@dataclass
class Station:
    """A whole virtual station with its bench."""

    wire: Wire
    host: Host
    bus: BenchBus
    rig: Rig
    module: Module
    frames: list[Frame] = field(default_factory=list)


def station_with(**options: object) -> Station:
    """Return a station whose simulator has these options."""
    wire = Wire()
    host = build_host(SimulatorOptions(**options), wire.attach())  # type: ignore[arg-type]
    wire.add_server(host.serve)
    bus = BenchBus(wire.attach(), SimulatedClock())
    return Station(wire, host, bus, Rig(bus), Module(bus))


@pytest.fixture
def wire() -> Wire:
    return Wire()


@pytest.fixture
def echo(wire: Wire) -> Echo:
    return Echo(wire)


@pytest.fixture
def bus(wire: Wire, echo: Echo) -> BenchBus:
    del echo
    return BenchBus(wire.attach(), SimulatedClock())


@pytest.fixture
def make_station() -> Callable[..., Station]:
    return station_with


@pytest.fixture
def station(make_station: Callable[..., Station]) -> Iterator[Station]:
    made = make_station()
    yield made
    assert made.module.lost == 0, made.module.losses
