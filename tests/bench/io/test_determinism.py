"""Same seed, same bytes: the frames and the samples of a run do not depend on its bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from bench.bus import BenchBus
from bench.capture import Capture
from bench.module import Module
from bench.pose import Attitude
from bench.rig import Rig
from bench.sample_log import SampleLog
from devices.simulator import SimulatorOptions, build_host
from protocols.clock import SimulatedClock
from protocols.link import Wire
from protocols.pycan_link import PyCanLink

if TYPE_CHECKING:
    from pathlib import Path

    from protocols.frame import Frame
    from protocols.link import Link


class ServedLink:
    """A python-can link whose devices work in this thread when nothing is there to read."""

    def __init__(self, link: PyCanLink) -> None:
        self._link = link
        self.send = link.send
        self.close = link.close
        self.serve = lambda: None

    def poll(self) -> Frame | None:
        frame = self._link.poll()
        if frame is None:
            self.serve()
            frame = self._link.poll()
        return frame

    def wait(self, timeout_s: float) -> Frame | None:
        del timeout_s
        return self.poll()


def run(link: Link, clock: SimulatedClock, folder: Path) -> tuple[bytes, bytes]:
    folder.mkdir()
    with Capture(folder / "bus.blf") as capture:
        bus = BenchBus(link, clock, sinks=[capture])
        module, rig = Module(bus), Rig(bus)
        with SampleLog(folder / "samples.parquet", module, rig) as log:
            module.wait_ready()
            module.identity()
            rig.connect()
            rig.home()
            rig.move_to(Attitude(azimuth_deg=15.0, pitch_deg=10.0), direction=1)
            log.begin_dwell(0)
            bus.run_for(0.5)
            dwell = log.end_dwell()
            module.diagnostics.unlock()
            rig.park()
        bus.close()
    return (folder / "bus.blf").read_bytes(), dwell.tobytes()


def on_wire(folder: Path, seed: int) -> tuple[bytes, bytes]:
    wire = Wire()
    host = build_host(SimulatorOptions(seed=seed), wire.attach())
    wire.add_server(host.serve)
    return run(wire.attach(), SimulatedClock(), folder)


def on_python_can(folder: Path, seed: int, channel: str) -> tuple[bytes, bytes]:
    clock = SimulatedClock()
    devices = PyCanLink("virtual", channel, clock=clock)
    link = ServedLink(PyCanLink("virtual", channel, clock=clock))
    link.serve = build_host(SimulatorOptions(seed=seed), devices).serve
    try:
        return run(link, clock, folder)
    finally:
        devices.close()


def test_given_one_seed_then_two_runs_have_the_same_frames_and_samples(tmp_path):
    assert on_wire(tmp_path / "a", 3) == on_wire(tmp_path / "b", 3)


def test_given_another_bus_then_the_frames_and_samples_are_the_same(tmp_path):
    assert on_wire(tmp_path / "a", 3) == on_python_can(tmp_path / "b", 3, "determinism")


@pytest.mark.parametrize("part", [0, 1])
def test_given_another_seed_then_frames_and_samples_differ(tmp_path, part):
    assert on_wire(tmp_path / "a", 3)[part] != on_wire(tmp_path / "b", 4)[part]
