"""A whole virtual station and its bench in this process, on one Wire."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

from bench.bus import BenchBus
from bench.executor import execute
from bench.limit_set import load_limits
from bench.module import Module
from bench.procedure_loader import load_procedure
from bench.reference import Reference
from bench.rig import Rig
from bench.run_context import RunContext
from bench.sample_log import SampleLog
from bench.station import load_station
from devices.simulator import SimulatorOptions, build_host
from protocols.clock import SimulatedClock
from protocols.compass import PART_THREE_AXIS
from protocols.link import Wire

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from bench.acceptance.measurement import Measurement
    from bench.acceptance.verdict import Verdict
    from bench.calibration.fit import Fit
    from bench.pose import Pose
    from bench.procedure import Procedure
    from devices.host import Host
    from protocols.link import Link


@dataclass
class ListRecorder:
    """Keeps what a run writes, in order."""

    entries: list[tuple[str, object]] = field(default_factory=list)
    sections: dict[str, object] = field(default_factory=dict)
    measurements: list[Measurement] = field(default_factory=list)
    achieved: dict[str, object] = field(default_factory=dict)
    verdict: Verdict | None = None

    def event(self, kind: str, **fields: object) -> None:
        self.entries.append((kind, fields))

    def step_started(self, name: str, kind: str, attempt: int = 1) -> None:
        self.entries.append(("step_started", (name, kind, attempt)))

    def step_ended(self, name: str, outcome: object, message: str = "") -> None:
        self.entries.append(("step_ended", (name, outcome, message)))

    def measurement(self, measurement: Measurement) -> None:
        self.measurements.append(measurement)

    def fit(self, fit: Fit, achieved: object = None) -> None:
        self.achieved[fit.method] = achieved

    def pose(self, pose: Pose) -> None:
        self.entries.append(("pose", pose))

    def set(self, section: str, value: object) -> None:
        self.sections[section] = value

    def close(self, verdict: Verdict) -> None:
        self.verdict = verdict

    def kinds(self) -> list[str]:
        return [kind for kind, _ in self.entries]

    def events(self, kind: str) -> list[object]:
        return [content for each, content in self.entries if each == kind]


@dataclass
class InProcessRun:
    """A run with its devices, before and after it is executed."""

    context: RunContext
    host: Host
    verdict: Verdict | None = None

    @property
    def recorder(self) -> ListRecorder:
        recorder = self.context.recorder
        assert isinstance(recorder, ListRecorder)
        return recorder

    def execute(self) -> Verdict:
        return execute(self.context.procedure, self.context)

    def value(self, name: str) -> float:
        return next(m.value for m in self.context.measurements if m.name == name)


@pytest.fixture(scope="session")
def prepare() -> Callable[..., InProcessRun]:
    """Return what makes a run of a procedure on a virtual unit, ready to be executed."""
    return _prepare


def _prepare(
    procedure: str | Procedure = "eol_three_axis",
    *,
    serial: str = "SN0001",
    scanned: str | None = None,
    seed: int = 1,
    faults: tuple[str, ...] = (),
    replay: Path | None = None,
    nvm: Path | None = None,
    between: Callable[[Link], Link] = lambda link: link,
) -> InProcessRun:
    loaded = load_procedure(procedure) if isinstance(procedure, str) else procedure
    wire = Wire()
    options = SimulatorOptions(
        serial=serial, seed=seed, faults=faults, replay=replay, nvm=nvm,
        part=loaded.part or PART_THREE_AXIS,
    )  # fmt: skip
    host = build_host(options, between(wire.attach()))
    wire.add_server(host.serve)
    bus = BenchBus(wire.attach(), SimulatedClock())
    module = Module(bus)
    rig = Rig(bus) if loaded.uses_rig else None
    station = load_station(loaded.station)
    reference = Reference(bus, station.reference.address) if station.reference else None
    context = RunContext(
        bus=bus,
        module=module,
        rig=rig,
        reference=reference,
        sample_log=SampleLog(None, module, rig, reference=reference),
        station=station,
        limits=load_limits(loaded.limits),
        recorder=ListRecorder(),
        procedure=loaded,
        serial=serial if scanned is None else scanned,
    )
    return InProcessRun(context=context, host=host)
