"""A short exchange with a virtual module in this process: whether the installation works."""

from __future__ import annotations

from bench.bus import BenchBus
from bench.module import Module
from devices.simulator import SimulatorOptions, build_host
from protocols.clock import SimulatedClock
from protocols.link import Wire


def answer_of_virtual_module(serial: str) -> str:
    """Return the serial number that a virtual module of that serial gives over UDS."""
    wire = Wire()
    link = wire.attach()
    host = build_host(SimulatorOptions(serial=serial, seed=1), wire.attach())
    wire.add_server(host.serve)
    bus = BenchBus(link, SimulatedClock())
    module = Module(bus)
    module.wait_ready(5.0)
    answer = module.identity().serial
    bus.close()
    return answer
