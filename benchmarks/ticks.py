"""Ticks per second of the whole bench, and how the ways to carry its frames compare.

One tick is 10 ms of a station: the world and its sensors, three drives and one module at
100 Hz, every frame sent, received, decoded, checked end to end and recorded (bus.blf and
samples.parquet), while the rig turns from pose to pose and dwells.

    python benchmarks/ticks.py [--poses N] [--json]

product   in-process wire, one port for the simulator: what `run` does by default
lockstep  in-process wire, one port for each node
virtual   python-can's `virtual` interface, one bus for each node
direct    the devices call the bench's subscribers, no bus at all: the floor
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import tempfile
import time
from collections import deque
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bench.bus import BenchBus
from bench.capture import Capture
from bench.module import Module
from bench.pose import Attitude
from bench.rig import Rig
from bench.sample_log import SampleLog
from devices.simulator import SimulatorOptions, build_host
from protocols.clock import SimulatedClock
from protocols.frame import Frame
from protocols.link import Wire
from protocols.sync import SYNC_ID, TICK_DONE_ID

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from protocols.link import Link

NODES = 4
DWELL_S = 0.5
STEP_DEG = 15.0
VARIANTS = ("product", "lockstep", "virtual", "direct")
TARGET_TICKS_PER_S = 10_000.0
TARGET_RATIO = 5.0


_new = tuple.__new__  # as the wire makes its frames


class Wiring(NamedTuple):
    """A way from the bench to its devices."""

    bench: Link
    devices: Link | Sequence[Link]
    serve_by: Callable[[Callable[[], None]], None]


class Result(NamedTuple):
    """What one variant did."""

    ticks: int
    frames: int
    seconds: float

    @property
    def ticks_per_s(self) -> float:
        """Ticks in a second of processor time."""
        return self.ticks / self.seconds


class DirectLink:
    """Both ends at once: a frame of the devices is a call of the bench's subscriber."""

    def __init__(self, clock: SimulatedClock) -> None:
        self._clock = clock
        self._now_ns = 0
        self._requests: deque[Frame] = deque()
        self._done: Frame | None = None
        self.serve: Callable[[], None] | None = None
        self.deliver: Callable[[Frame], None] | None = None
        self.devices = DirectDevices(self)

    def send(self, can_id: int, data: bytes) -> None:
        """Keep a request of the bench; SYNC lets the devices work at once."""
        self._now_ns = self._clock.now_ns()
        self._requests.append(_new(Frame, (self._now_ns, can_id, data)))
        if can_id == SYNC_ID and self.serve is not None:
            self.serve()

    def answer(self, can_id: int, data: bytes) -> None:
        """Hand a frame of the devices to its subscriber; keep tick-done for `poll`."""
        frame = _new(Frame, (self._now_ns, can_id, data))
        if can_id == TICK_DONE_ID or self.deliver is None:
            self._done = frame
        else:
            self.deliver(frame)

    def request(self) -> Frame | None:
        """Give the devices the next request."""
        return self._requests.popleft() if self._requests else None

    def poll(self) -> Frame | None:
        """Give the bench tick-done."""
        frame, self._done = self._done, None
        return frame

    def wait(self, timeout_s: float) -> Frame | None:
        """Return what `poll` returns."""
        del timeout_s
        return self.poll()

    def close(self) -> None:
        """Nothing to release."""


class DirectDevices:
    """The devices' end of a `DirectLink`."""

    def __init__(self, link: DirectLink) -> None:
        self.send = link.answer
        self.poll = link.request
        self.close = link.close

    def wait(self, timeout_s: float) -> Frame | None:
        """Return what `poll` returns."""
        del timeout_s
        return self.poll()


class ServedLink:
    """A link of python-can whose devices, in the same thread, work when nothing is there."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self.serve: Callable[[], None] | None = None
        self.send = link.send
        self.close = link.close

    def poll(self) -> Frame | None:
        """Take the next frame; let the devices work if there is none."""
        frame = self._link.poll()
        if frame is None and self.serve is not None:
            self.serve()
            frame = self._link.poll()
        return frame

    def wait(self, timeout_s: float) -> Frame | None:
        """Return what `poll` returns."""
        del timeout_s
        return self.poll()


def wiring(variant: str, clock: SimulatedClock, closing: ExitStack) -> Wiring:
    """Return the links of a variant; what has to be closed is left to `closing`."""
    if variant in ("product", "lockstep"):
        wire = Wire()
        count = 1 if variant == "product" else NODES
        ports = [wire.attach() for _ in range(count)]
        return Wiring(wire.attach(), ports[0] if count == 1 else ports, wire.add_server)
    if variant == "direct":
        direct = DirectLink(clock)
        return Wiring(direct, direct.devices, _setter(direct))
    from protocols.pycan_link import PyCanLink

    links = [PyCanLink("virtual", "benchmark", clock=clock) for _ in range(NODES + 1)]
    for link in links:
        closing.callback(link.close)
    served = ServedLink(links[0])
    return Wiring(served, links[1:], _setter(served))


def _setter(link: DirectLink | ServedLink) -> Callable[[Callable[[], None]], None]:
    def serve_by(serve: Callable[[], None]) -> None:
        link.serve = serve

    return serve_by


def measure(variant: str, folder: Path, poses: int) -> Result:
    """Run `poses` poses on a variant and count the ticks and the processor time."""
    with ExitStack() as closing:
        clock = SimulatedClock()
        bench_link, device_links, serve_by = wiring(variant, clock, closing)
        host = build_host(SimulatorOptions(), device_links)
        serve_by(host.serve)
        capture = closing.enter_context(Capture(folder / f"{variant}.blf"))
        bus = BenchBus(bench_link, clock, sinks=[capture])
        closing.callback(bus.flush)
        if isinstance(bench_link, DirectLink):
            bench_link.deliver = bus.receive
        module, rig = Module(bus), Rig(bus)
        log = closing.enter_context(SampleLog(folder / f"{variant}.parquet", module, rig))
        module.wait_ready()
        module.identity()
        rig.connect()
        rig.home()
        turn(bus, rig, log, 4)  # warm
        ticks, frames, start_s = bus.tick_count, bus.frames, time.process_time()
        turn(bus, rig, log, poses)
        bus.flush()
        log.flush()
        seconds = time.process_time() - start_s
        if module.lost or module.incomplete:
            message = f"{variant}: {module.lost} frames lost; the figure would be worthless"
            raise RuntimeError(message)
        return Result(bus.tick_count - ticks, bus.frames - frames, seconds)


def turn(bus: BenchBus, rig: Rig, log: SampleLog, poses: int) -> None:
    """Visit headings clockwise, dwelling at each."""
    for position in range(poses):
        rig.move_to(Attitude(azimuth_deg=STEP_DEG * position), direction=1)
        log.begin_dwell(position)
        bus.run_for(DWELL_S)
        log.end_dwell()


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure every variant and print ticks a second and ratios; 1 if a target is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--poses", type=int, default=48, help="poses of each variant")
    parser.add_argument("--repeat", type=int, default=3, help="best of so many")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.ERROR)
    with tempfile.TemporaryDirectory() as name:
        rounds = [  # in turn, so that a slow minute of the machine meets all of them
            {variant: measure(variant, Path(name), options.poses) for variant in VARIANTS}
            for _ in range(options.repeat)
        ]
        results = {
            variant: max((each[variant] for each in rounds), key=lambda r: r.ticks_per_s)
            for variant in VARIANTS
        }
    report = {
        variant: {
            "ticks": result.ticks,
            "ticks_per_s": round(result.ticks_per_s),
            "us_per_tick": round(1e6 / result.ticks_per_s, 1),
            "frames_per_tick": round(result.frames / result.ticks, 2),
        }
        for variant, result in results.items()
    }
    ratio = results["lockstep"].ticks_per_s / results["virtual"].ticks_per_s
    floor = results["product"].ticks_per_s / results["direct"].ticks_per_s
    if options.json:
        print(json.dumps(report | {"lockstep_to_virtual": ratio, "product_to_direct": floor}))
    else:
        for variant, figures in report.items():
            print(f"{variant:9}" + "".join(f"  {key} {figures[key]}" for key in figures))
        print(f"lockstep is {ratio:.1f} times as fast as virtual (at least {TARGET_RATIO:g})")
        print(f"product reaches {100.0 * floor:.0f} % of the floor")
    reached = results["product"].ticks_per_s >= TARGET_TICKS_PER_S and ratio >= TARGET_RATIO
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
