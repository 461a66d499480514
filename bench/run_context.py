"""What a step has in its hands while it runs, and what the run has gathered so far."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

import numpy as np

from bench.acceptance.catalogue import MEASUREMENTS
from bench.acceptance.measurement import Measurement
from bench.acceptance.outcome import Outcome, worst
from bench.acceptance.verdict import judge_measurement, last_attempts
from bench.errors import ConfigError, ModuleRefused
from bench.field_watch import FieldWatch
from bench.pose_visits import PoseVisits
from bench.progress import Progress, RunState, SilentProgress
from bench.samples import COMPLETE, READING, reading_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from bench.bus import BenchBus
    from bench.calibration.fit import Fit
    from bench.calibration.mountings import Mounting
    from bench.limit_set import LimitSet
    from bench.module import Module, ModuleIdentity
    from bench.pose import Pose
    from bench.procedure import Procedure
    from bench.recorder import Recorder
    from bench.reference import Reference
    from bench.rig import Rig
    from bench.sample_log import SampleLog
    from bench.station import Station
    from bench.steps.sentinel import Sentinel
    from bench.steps.step import PlannedPose
    from protocols.uds import Coefficients

Result = TypeVar("Result")

COMPUTING_S: Final = 60.0
"""Longest time that a fit may take."""
MISSED: Final = (Outcome.FAIL, Outcome.ERROR)


class Mark(NamedTuple):
    """Lengths of a run's lists when a step began."""

    measurements: int
    calibration: int
    verification: int


@dataclass(kw_only=True)
class RunContext:
    """One run: its instruments, its rules, and what it has gathered.

    Attributes
    ----------
    rig : Rig or None
        None where the procedure needs none.
    serial : str
        The scanned serial of the unit.
    ask : callable or None
        Asks the operator a sentence and returns the answer; None where nobody is there.
    readings : ndarray of READING
        One row for each dwell so far.
    calibration_positions, verification_positions : list of int
        Positions that the fits use, and those that the acceptance uses; never shared.
    verification_samples : list of ndarray of SAMPLE
        Complete samples of the verification, one array a dwell.
    mountings : list of (Mounting, int)
        How the unit was put in during a reversal, and the first position of each mounting.
    recording : ndarray of SAMPLE or None
        Samples that were collected without a rig.
    fits : dict
        Results by name of the method.
    judged_fit : Fit or None
        The accepted fit whose coefficients are written.
    before, written : Coefficients or None
        The module's coefficients before the first write, and those that were written last.
    fault_name : str or None
        What ended the run in the place of a measurement: a name of `executor.FAULT_NAMES`, or
        ``bench_fault``.
    not_available : set of str
        Measurements that this unit or recording cannot give; the verdict does without them.
    verified, completed : bool
        Whether the written coefficients were judged, and whether all steps have run: without
        both, and with any limit missed, the end of the run restores the former ones.
    finish : list of (name, callable)
        Close the files of the run, in order, after the safe state and before the record.
    on_exit : callable
        Promises an action for the end of the run, last promised first done.
    run_step : callable
        Runs a step inside another one.
    reference : Reference or None
        The station's reference magnetometer, where the station file names one.
    field_watch : FieldWatch
        Whether the field is still that of the run's start, and what was repeated.
    """

    bus: BenchBus
    module: Module
    sample_log: SampleLog
    station: Station
    limits: LimitSet
    recorder: Recorder
    procedure: Procedure
    serial: str
    rig: Rig | None = None
    progress: Progress = field(default_factory=SilentProgress)
    ask: Callable[[str], str] | None = None
    expected_s: float = 0.0
    step_name: str = ""
    attempt: int = 1
    identity: ModuleIdentity | None = None
    poses: list[Pose] = field(default_factory=list)
    measurements: list[Measurement] = field(default_factory=list)
    calibration_positions: list[int] = field(default_factory=list)
    verification_positions: list[int] = field(default_factory=list)
    verification_samples: list[NDArray[np.void]] = field(default_factory=list)
    recording: NDArray[np.void] | None = None
    fits: dict[str, Fit] = field(default_factory=dict)
    judged_fit: Fit | None = None
    before: Coefficients | None = None
    written: Coefficients | None = None
    verified: bool = False
    completed: bool = False
    fault_name: str | None = None
    not_available: set[str] = field(default_factory=set)
    finish: list[tuple[str, Callable[[], object]]] = field(default_factory=list)
    mountings: list[tuple[Mounting, int]] = field(default_factory=list)
    readings: NDArray[np.void] = field(default_factory=lambda: np.zeros(0, dtype=READING))
    on_exit: Callable[[str, Callable[[], object]], None] = field(init=False)
    run_step: Callable[..., None] = field(init=False)
    started_s: float = 0.0
    reference: Reference | None = None
    field_watch: FieldWatch = field(init=False)

    def __post_init__(self) -> None:
        sensor = self.station.reference if self.reference is not None else None
        change_mg = None if sensor is None else sensor.change_mg
        self.field_watch = FieldWatch(change_mg, self.procedure.pose_count)

    def event(self, kind: str, **fields: object) -> None:
        """Write an event; the recorder adds the time."""
        self.recorder.event(kind, **fields)

    def require_rig(self) -> Rig:
        """Return the rig.

        Raises
        ------
        ConfigError
            If the run has none.
        """
        if self.rig is None:
            message = (
                f"step {self.step_name} needs a rig; this run has none: "
                "name its interface and channel"
            )
            raise ConfigError(message)
        return self.rig

    @property
    def synthesised(self) -> bool:
        """Whether set and reset readings were made from one recorded value."""
        return self.identity is not None and bool(self.identity.synthesised)

    @property
    def state(self) -> RunState:
        """Where the run is."""
        return RunState(
            step=self.step_name,
            position=len(self.poses),
            positions=max(
                self.procedure.pose_count + self.field_watch.extra_poses, len(self.poses)
            ),
            elapsed_s=self.bus.now_s - self.started_s,
            expected_s=self.expected_s,
        )

    def judge(self, measurements: Iterable[Measurement]) -> list[Measurement]:
        """Judge measurements by their limits, in order, and write them down."""
        judged = []
        for measurement in measurements:
            tried = replace(measurement, attempt=self.attempt)
            one = judge_measurement(tried, self.limits.by_name)
            self.measurements.append(one)
            self.recorder.measurement(one)
            self.progress.measured(one)
            judged.append(one)
        return judged

    def measure(self, name: str, value: float, *, note: str = "") -> Measurement:
        """Judge one value by the limits of its name and write it down."""
        measurement = Measurement(
            name=name,
            value=value,
            step=self.step_name,
            unit=MEASUREMENTS[name].unit,
            note=note,
            from_samples=MEASUREMENTS[name].from_samples,
        )
        return self.judge([measurement])[0]

    def visit(
        self,
        planned: Sequence[PlannedPose],
        *,
        calibrates: bool = False,
        verifies: bool = False,
        sentinel: Sentinel | None = None,
    ) -> NDArray[np.void]:
        """Go to poses one after the other and return one READING each.

        A pose that a change of the field spoiled is repeated (`bench.pose_visits`).

        Raises
        ------
        RigFault
            If a pose is not reached.
        ModuleSilent
            If fewer than two complete samples arrive at a pose.
        FieldChanged, ReferenceSilent
            If the field does not come back, or the reference magnetometer is silent.
        """
        kept = PoseVisits(self, sentinel).go(planned)
        if verifies:
            self.verification_samples += kept
        rows = [reading_of(samples) for samples in kept]
        readings = np.array(rows, dtype=READING)
        positions = [int(position) for position in readings["position"]]
        if calibrates:
            self.calibration_positions += positions
        if verifies:
            self.verification_positions += positions
        self.readings = np.concatenate([self.readings, readings])
        return readings

    def collect(self, pose: Pose, duration_s: float) -> NDArray[np.void]:
        """Listen for `duration_s` at a pose and return the complete samples."""
        self.poses.append(pose)
        self.recorder.pose(pose)
        self.sample_log.begin_dwell(pose.position)
        self.bus.run_for(duration_s)
        samples = self.sample_log.end_dwell()
        complete: NDArray[np.void] = samples[samples["complete"] == COMPLETE]
        return complete

    def compute(self, work: Callable[[], Result]) -> Result:
        """Return what `work` returns; it must be arithmetic that touches nothing of the run.

        On a real bus time goes on meanwhile: the heartbeat is sent and frames are read, as
        the drives would stop otherwise. In lock-step time stands still.
        """
        if self.bus.mode == "lockstep":
            return work()
        with ThreadPoolExecutor(max_workers=1) as worker:
            result = worker.submit(work)
            self.bus.run_until(result.done, COMPUTING_S, "the arithmetic did not end")
        return result.result()

    def readings_at(self, positions: Sequence[int]) -> NDArray[np.void]:
        """Return the readings of some positions, in order."""
        rows: NDArray[np.void] = self.readings[np.isin(self.readings["position"], list(positions))]
        return rows

    def set_identity(self, identity: ModuleIdentity) -> None:
        """Keep who the module is, and write it down."""
        self.identity = identity
        self.recorder.set(
            "module",
            {
                "serial": identity.serial,
                "part": identity.part,
                "hardware": identity.hardware,
                "firmware": identity.firmware,
                "mag_mg_per_count": identity.mag_mg_per_count,
                "accel_g_per_count": identity.accel_g_per_count,
                "synthesised": identity.synthesised,
            },
        )

    def record_station(self) -> None:
        """Write down what the bench holds for true."""
        station = self.station
        self.recorder.set(
            "station",
            {
                "name": station.name,
                "horizontal_mg": station.horizontal_mg,
                "dip_deg": station.dip_deg,
                "declination_deg": station.declination_deg,
                "field_azimuth_deg": station.field_azimuth_deg,
                "u_horizontal_mg": station.u_horizontal_mg,
                "u_dip_deg": station.u_dip_deg,
                "u_field_azimuth_deg": station.u_field_azimuth_deg,
                "u_rig_deg": station.u_rig_deg,
                "seat": station.seat,
            },
        )

    def record_bus(self) -> None:
        """Write down what was on the bus; ticks and frames of the whole run."""
        bus = self.bus
        self.recorder.set(
            "bus",
            {
                "mode": bus.mode,
                "frames": bus.frames,
                "lost": self.module.lost,
                "dropped": bus.dropped,
                "faults": bus.faults,
                "load_percent": bus.load_percent,
                "load_worst_percent": bus.load_worst_percent,
                "e2e": self.module.e2e | (self.reference.e2e if self.reference else {}),
            },
        )
        self.recorder.set("run", {"ticks": bus.tick_count})

    def record_field_watch(self) -> None:
        """Write down what the field did during the run."""
        self.recorder.set("field_watch", self.field_watch.entry())

    def restore_coefficients(self) -> None:
        """Give the module back the coefficients that it had, unless the new ones passed.

        Raises
        ------
        BenchError
            If the module does not take them.
        """
        if self.written is None or self.before is None:
            return
        whole = self.outcome_since(Mark(0, 0, 0))
        if self.verified and self.completed and whole not in MISSED:
            return
        if not self.module.diagnostics.write_coefficients(self.before).read_back_equal:
            message = "the module does not hold its former coefficients again: put it aside"
            raise ModuleRefused(message, 0)
        self.recorder.set("coefficients", {"restored": True})
        self.event("coefficients_restored")

    def mark(self) -> Mark:
        """Return where the run's lists end now."""
        return Mark(
            len(self.measurements),
            len(self.calibration_positions),
            len(self.verification_positions),
        )

    def first_missed_since(self, mark: Mark) -> Measurement | None:
        """Return the first measurement since a mark whose last attempt missed its limits."""
        since = last_attempts(self.measurements[mark.measurements :])
        return next((one for one in since if one.outcome in MISSED), None)

    def outcome_since(self, mark: Mark) -> Outcome:
        """Return the worst outcome since a mark; PASS if nothing was judged."""
        since = last_attempts(self.measurements[mark.measurements :])
        return worst([Outcome.PASS, *(one.outcome for one in since if one.outcome is not None)])

    def forget_positions(self, mark: Mark) -> None:
        """Use the readings of a missed attempt neither for fits nor for the acceptance."""
        del self.calibration_positions[mark.calibration :]
        kept = mark.verification
        del self.verification_positions[kept:], self.verification_samples[kept:]
