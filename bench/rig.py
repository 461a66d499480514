"""The rig: three drives moved together, waited for, and watched.

Every wait passes by ticks of the bus, so that the module is heard and recorded meanwhile.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from bench.drive import Drive
from bench.errors import RigFault
from bench.pose import Attitude
from bench.travel import (
    AXES,
    RIG_PROFILE,
    SETTLE_S,
    AxisProfile,
    azimuth_path_deg,
    require_reachable,
    travel_time_s,
)
from protocols import cia402
from protocols.canopen import (
    AXIS_NODES,
    BENCH_NODE,
    NMT_ID,
    NMT_PRE_OPERATIONAL,
    NMT_START,
    nmt_frame,
)
from protocols.cia402 import COUNTS_PER_DEG, Mode
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from bench.bus import BenchBus

HEARTBEAT_MS: Final = 500
"""The drives stop when the bench has been silent for so long; they send their own as often."""
POSITION_WINDOW_DEG: Final = 0.05
"""Farther than this from its target a settled axis is in fault."""
STABLE_DEG: Final = 0.005
"""An axis has settled when its encoder stays within this for `STABLE_TICKS`."""
STABLE_TICKS: Final = 10
HOMING_TIMEOUT_S: Final = 60.0

_SETTLE_TIMEOUT_S: Final = 3.0
_DEVICE_TYPE: Final = 0x1000
_IDENTITY: Final = 0x1018
_PROFILE_402: Final = 402


class Rig:
    """Client of the three-axis rig.

    Parameters
    ----------
    bus : BenchBus
    eds : Path, optional
        Object dictionary of the drives; the shipped one by default.
    counts_per_deg : float
        Position counts of a degree.
    profiles : mapping of str to AxisProfile
        Limits and speeds by axis.

    Attributes
    ----------
    drives : tuple of Drive
        Azimuth, pitch, roll.
    """

    def __init__(
        self,
        bus: BenchBus,
        *,
        eds: Path | None = None,
        counts_per_deg: float = COUNTS_PER_DEG,
        profiles: Mapping[str, AxisProfile] = RIG_PROFILE,
    ) -> None:
        import canopen

        import protocols

        path = eds if eds is not None else Path(protocols.__file__).with_name("rig_axis.eds")
        objects = canopen.import_od(str(path))
        self.bus = bus
        self.counts_per_deg = counts_per_deg
        self.profiles = dict(profiles)
        self.identity: dict[str, dict[str, int]] = {}
        self.drives = tuple(
            Drive(bus, node_id, axis, objects, self.profiles[axis], counts_per_deg)
            for node_id, axis in zip(AXIS_NODES, AXES, strict=True)
        )
        self._azimuth, self._pitch, self._roll = self.drives
        self._watched = False
        self._referenced = True
        bus.add_hook(self._watch)

    @property
    def counts(self) -> tuple[int, int, int]:
        """Azimuth, pitch and roll in position counts, as last received."""
        return self._azimuth.counts, self._pitch.counts, self._roll.counts

    @property
    def received_ns(self) -> int:
        """When the oldest of these counts was received, on the bench's clock in ns."""
        return min(drive.received_ns for drive in self.drives)

    @property
    def attitude(self) -> Attitude:
        """Measured attitude; the azimuth is wound, whole turns included."""
        return Attitude(
            azimuth_deg=self._azimuth.angle_deg,
            pitch_deg=self._pitch.angle_deg,
            roll_deg=self._roll.angle_deg,
        )

    @property
    def moving(self) -> bool:
        """Whether a drive has not reached its target."""
        reached = cia402.SW_TARGET_REACHED
        return not all(drive.statusword & reached for drive in self.drives)

    def connect(self) -> None:
        """Identify and set up the drives, start them and switch them on; then watch them.

        Raises
        ------
        RigFault
            If a drive does not answer, is of another profile, refuses an object, or does
            not leave its fault.
        """
        self._watched = False
        self.bus.send(NMT_ID, nmt_frame(NMT_PRE_OPERATIONAL, 0))
        self._identify()
        self._write(cia402.PRODUCER_HEARTBEAT, 0, HEARTBEAT_MS)
        self._write(cia402.CONSUMER_HEARTBEAT, 1, BENCH_NODE << 16 | HEARTBEAT_MS)
        self._write(cia402.ABORT_CONNECTION_OPTION, 0, cia402.ABORT_QUICK_STOP)
        window = round(POSITION_WINDOW_DEG * self.counts_per_deg)
        self._write(cia402.POSITION_WINDOW, 0, window)
        for objects in zip(*(drive.setup_objects() for drive in self.drives), strict=True):
            for drive, (index, subindex, value) in zip(self.drives, objects, strict=True):
                drive.sdo.start_write(index, subindex, value)
            self._finish_transfers()
        self._write(cia402.MODE_OF_OPERATION, 0, Mode.PROFILE_POSITION)
        self.bus.send(NMT_ID, nmt_frame(NMT_START, 0))
        self._enable()
        self._watched = True

    def home(self, timeout_s: float = HOMING_TIMEOUT_S) -> None:
        """Find the zero of every axis by its encoder's index pulse, all at once.

        Raises
        ------
        RigFault
            If an axis does not find it in time.
        """
        self._watched = True
        self._referenced = False
        self._write(cia402.HOMING_METHOD, 0, cia402.HOMING_ON_INDEX_PULSE)
        self._write(cia402.MODE_OF_OPERATION, 0, Mode.HOMING)
        self._enable()
        self._advance(Drive.start_homing, 1.0, "leave its former mode")
        self._advance(Drive.advance_homing, timeout_s, "find its zero")
        self._write(cia402.MODE_OF_OPERATION, 0, Mode.PROFILE_POSITION)
        self._referenced = True
        self._settle()

    def move_to(
        self, attitude: Attitude, timeout_s: float | None = None, direction: int | None = None
    ) -> None:
        """Move all axes at once and return at the settled pose.

        Parameters
        ----------
        attitude : Attitude
            The azimuth may be given with any number of turns; the rig winds as it must.
        timeout_s : float, optional
            Seconds; by default twice the travel's time and 3 s more.
        direction : int, optional
            +1 to approach the azimuth clockwise, -1 counter-clockwise, 0 or None the
            shortest way.

        Raises
        ------
        ConfigError
            If pitch or roll is outside the soft limits.
        RigFault
            If a drive stalls, is in fault or silent, or an axis does not settle in time;
            the sentence names the axis.
        """
        require_reachable(attitude, self.profiles)
        self._watched = True
        present_deg = self._azimuth.target / self.counts_per_deg
        path = azimuth_path_deg(
            present_deg, attitude.azimuth_deg, direction, self.profiles["azimuth"]
        )
        for azimuth_deg in path:
            self._travel((azimuth_deg, attitude.pitch_deg, attitude.roll_deg), timeout_s)
        self._settle()

    def travel_time_s(self, start: Attitude, end: Attitude, direction: int | None = None) -> float:
        """Return the time from one attitude to another, settling included."""
        return travel_time_s(start, end, direction, self.profiles) + SETTLE_S

    def park(self, timeout_s: float | None = None) -> None:
        """Unwind to 0, 0, 0 and switch the drives off, from whatever was interrupted.

        Axes whose homing was interrupted have no zero to go to: they stop where they are.

        Raises
        ------
        RigFault
            If an axis does not get there; the drives are switched off all the same.
        """
        self._watched = False
        try:
            if self._referenced:
                self._recover()
                self._travel((0.0, 0.0, 0.0), timeout_s)
            else:
                self.quick_stop()
        finally:
            for drive in self.drives:
                drive.command(cia402.CW_SHUTDOWN)
            self.bus.tick()
            for drive in self.drives:
                drive.command(0)

    def _recover(self) -> None:
        """Bring the drives back from an interrupted set-up or set-point hand-shake."""
        self.bus.send(NMT_ID, nmt_frame(NMT_START, 0))
        for drive in self.drives:
            drive.release()
        self._enable()
        self._advance(Drive.released, 1.0, "end its set-point hand-shake")

    def quick_stop(self) -> None:
        """Stop every axis on its quick-stop ramp; sends only, and watches no longer."""
        self._watched = False
        for drive in self.drives:
            drive.command(cia402.CW_QUICK_STOP)

    def _travel(self, targets_deg: tuple[float, float, float], timeout_s: float | None) -> None:
        expected_s = 0.0
        for drive, angle_deg in zip(self.drives, targets_deg, strict=True):
            expected_s = max(expected_s, drive.profile.travel_time_s(angle_deg - drive.angle_deg))
            drive.start_move(angle_deg)
        if timeout_s is None:
            timeout_s = 2.0 * expected_s + _SETTLE_TIMEOUT_S
        self._advance(Drive.advance_move, timeout_s, "reach its target")

    def _settle(self) -> None:
        stable_counts = STABLE_DEG * self.counts_per_deg
        reference, stable = self.counts, 0
        start_tick = self.bus.tick_count
        while stable < STABLE_TICKS:
            self.bus.tick()
            shifts = [abs(now - then) for now, then in zip(self.counts, reference, strict=True)]
            stable += 1
            if max(shifts) > stable_counts:
                reference, stable = self.counts, 0
                if (self.bus.tick_count - start_tick) * TICK_S > _SETTLE_TIMEOUT_S:
                    axis = AXES[shifts.index(max(shifts))]
                    message = f"{axis} axis does not settle within {_SETTLE_TIMEOUT_S:g} s"
                    raise RigFault(message, axis)
        for drive in self.drives:
            error_deg = (drive.counts - drive.target) / self.counts_per_deg
            if abs(error_deg) > POSITION_WINDOW_DEG:
                message = (
                    f"{drive.axis} axis stands {error_deg:+.3f} deg from its target; "
                    f"{POSITION_WINDOW_DEG:g} deg are allowed"
                )
                raise RigFault(message, drive.axis)

    def _enable(self) -> None:
        for drive in self.drives:
            drive.last_tick = self.bus.tick_count
        self.bus.tick()
        self._advance(Drive.advance_enable, 2.0, "switch on")

    def _advance(self, step: Callable[[Drive], bool], timeout_s: float, what: str) -> None:
        """Tick until `step` is done for every drive; faults and time-outs name the axis."""
        pending = list(self.drives)
        start_s = self.bus.now_s
        enabling = step is Drive.advance_enable
        while True:
            pending = [drive for drive in pending if not step(drive)]
            if not pending:
                return
            late = self.bus.now_s - start_s >= timeout_s
            for drive in pending:
                sentence = None if enabling and not late else drive.fault_sentence()
                if sentence is None and late:
                    state = drive.state.name.lower().replace("_", " ")
                    sentence = (
                        f"{drive.axis} axis did not {what} within {timeout_s:.1f} s "
                        f"(drive {drive.node_id} is {state} at {drive.angle_deg:.2f} deg)"
                    )
                if sentence is not None:
                    self._watched = False
                    raise RigFault(sentence, drive.axis)
            self.bus.tick()

    def _identify(self) -> None:
        for drive, device_type in zip(self.drives, self._read(_DEVICE_TYPE, 0), strict=True):
            if device_type & 0xFFFF != _PROFILE_402:
                message = (
                    f"{drive.axis} drive (node {drive.node_id}) must be of profile 402; "
                    f"instead received {device_type & 0xFFFF}"
                )
                raise RigFault(message, drive.axis)
        for subindex, name in ((1, "vendor"), (2, "product"), (3, "revision"), (4, "serial")):
            for drive, value in zip(self.drives, self._read(_IDENTITY, subindex), strict=True):
                self.identity.setdefault(drive.axis, {})[name] = value

    def _read(self, index: int, subindex: int) -> list[int]:
        for drive in self.drives:
            drive.sdo.start_read(index, subindex)
        return self._finish_transfers()

    def _write(self, index: int, subindex: int, value: int) -> None:
        for drive in self.drives:
            drive.sdo.start_write(index, subindex, value)
        self._finish_transfers()

    def _finish_transfers(self) -> list[int]:
        pending = list(self.drives)
        while pending := [drive for drive in pending if not drive.sdo.advance()]:
            self.bus.tick()
        return [drive.sdo.value for drive in self.drives]

    def _watch(self) -> None:
        if not self._watched:
            return
        for drive in self.drives:
            if drive.statusword & cia402.SW_FAULT or drive.emergency or drive.silent:
                self._watched = False  # told once; teardown goes on
                raise RigFault(drive.fault_sentence() or "", drive.axis)
