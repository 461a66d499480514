"""The compass module as the bench hears it: cyclic frames, checked and put together.

One measuring cycle is a set reading, a reset reading, an acceleration and a heading of the
same group. Each is checked end to end; what does not pass is left out of the cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

from bench.address_claims import AddressClaims
from bench.errors import ModuleSilent
from bench.samples import COMPLETE
from protocols.compass import (
    ACCEL_G_PER_COUNT,
    FLAG_SYNTHESISED,
    MAG_MG_PER_COUNT,
    Status,
    acceleration_id,
    data_id,
    heading_id,
    mag_reset_id,
    mag_set_id,
    status_id,
    unpack_status,
)
from protocols.e2e import E2eReceiver, E2eState
from protocols.j1939 import MODULE_ADDRESS
from protocols.sync import TICK_NS, TICK_S

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.bus import BenchBus
    from bench.diagnostics import Diagnostics
    from protocols.frame import Frame

SILENCE_S: Final = 0.5
"""Without a frame for so long, the module is silent."""
LOST_LISTED: Final = 1000
"""So many losses are listed one by one; the counters go on."""
FRAME_NAMES: Final = ("mag_set", "mag_reset", "acceleration", "heading")

GAP_CYCLES: Final = {"lockstep": 6, "free": 20}
"""Where two cycles are more than so many periods apart, those between them count as lost: a
sender that falls silent and goes on with its counters is not seen by them."""

_SILENCE_TICKS: Final = round(SILENCE_S / TICK_S)
_NO_FRAME: Final = bytes(8)
_NO_STATUS: Final = Status(float("nan"), float("nan"), 0, 0, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModuleIdentity:
    """What the module says it is, read by UDS.

    Attributes
    ----------
    mag_mg_per_count, accel_g_per_count : float
        Scales of the cyclic readings.
    flags : int
        FLAG_ bits of its status.
    """

    serial: str
    part: str
    hardware: str
    firmware: str
    mag_mg_per_count: float
    accel_g_per_count: float
    flags: int

    @property
    def synthesised(self) -> bool:
        """Whether set and reset readings were made from one recorded value."""
        return bool(self.flags & FLAG_SYNTHESISED)


class Loss(NamedTuple):
    """One gap or rejected frame: when, which frame, what the receiver found, how many frames."""

    t_s: float
    frame: str
    state: E2eState
    missing: int


class Cycle(NamedTuple):
    """The protected frames of one measuring cycle, as received; zeros where one is missing."""

    t_ns: int
    group: int
    complete: int
    mag_set: bytes
    mag_reset: bytes
    acceleration: bytes
    heading: bytes


class Module:
    """Client of one compass module.

    Parameters
    ----------
    bus : BenchBus
    address : int
        Source address of the module.

    Attributes
    ----------
    status : Status
        The last status frame; not-a-number before the first.
    receivers : dict of str to E2eReceiver
        By frame name: counters of lost, repeated and wrong frames.
    losses : list of Loss
        The first `LOST_LISTED` losses.
    cycles, incomplete, missed : int
        Measuring cycles seen, those of them with a frame missing, and those that never came.
    period_ns : int
        Time between two cycles that the module was told to keep.
    mag_mg_per_count, accel_g_per_count : float
        Scales; nominal until `identity` was read.
    """

    def __init__(self, bus: BenchBus, address: int = MODULE_ADDRESS) -> None:
        self.bus = bus
        self.address = address
        self.status = _NO_STATUS
        self.receivers: dict[str, E2eReceiver] = {}
        self.losses: list[Loss] = []
        self.cycles = 0
        self.incomplete = 0
        self.missed = 0
        self.period_ns = TICK_NS
        self.mag_mg_per_count = MAG_MG_PER_COUNT
        self.accel_g_per_count = ACCEL_G_PER_COUNT
        self._claims = AddressClaims(
            bus, address, nodes="modules", remedy="leave one of them on the bus"
        )
        self._listeners: list[Callable[[Cycle], None]] = []
        self._diagnostics: Diagnostics | None = None
        self._states = dict.fromkeys(FRAME_NAMES, E2eState.NOT_AVAILABLE)
        self._slots = [_NO_FRAME] * len(FRAME_NAMES)
        self._complete = 0
        self._group = -1
        self._t_ns = 0
        self._last_cycle_ns: int | None = None
        self._gap_cycles = GAP_CYCLES[bus.mode]
        self._last_tick = bus.tick_count
        self._watched = False
        self._status_frames = 0
        self._duplicate_told = False
        self._lost_before: dict[str, int] = {}
        self._subscribe()

    @property
    def diagnostics(self) -> Diagnostics:
        """UDS services of this module; made on first use."""
        if self._diagnostics is None:
            from bench.diagnostics import Diagnostics

            self._diagnostics = Diagnostics(self.bus, self)
        return self._diagnostics

    @property
    def lost(self) -> int:
        """Frames lost or rejected, and cycles that never came, since the start."""
        return self.missed + sum(
            receiver.lost + receiver.errors + receiver.repeated
            for receiver in self.receivers.values()
        )

    @property
    def silent(self) -> bool:
        """Whether no frame has come for `SILENCE_S`."""
        return self.bus.tick_count - self._last_tick > _SILENCE_TICKS

    @property
    def e2e(self) -> dict[str, dict[str, int | str]]:
        """State and counters by frame name: state, lost, errors, repeated, wrong_sequence."""
        return {
            name: {
                "state": (E2eState.NOT_AVAILABLE if self.silent else self._states[name]).value,
                "lost": receiver.lost,
                "errors": receiver.errors,
                "repeated": receiver.repeated,
                "wrong_sequence": receiver.wrong_sequence,
            }
            for name, receiver in self.receivers.items()
        }

    def add_listener(self, listener: Callable[[Cycle], None]) -> None:
        """Call `listener` once for each measuring cycle, complete or not, at the tick's end."""
        self._listeners.append(listener)

    def wait_ready(self, timeout_s: float = 2.0) -> None:
        """Wait for a complete cycle and a status from now on; then watch for silence.

        Raises
        ------
        ModuleSilent
            If they do not come in time.
        BusFault
            If two modules claim the address.
        """
        self._watched = False
        self._claims.request()
        cycles, status_frames = self.cycles - self.incomplete, self._status_frames
        self.bus.run_until(
            lambda: self.cycles - self.incomplete > cycles and self._status_frames > status_frames,
            timeout_s,
            f"module {self.address:#04x} has not sent readings and status",
        )
        self._watched = True

    def expect_silence(self) -> None:
        """Stop watching and forget the counters: the bench is about to reset the module."""
        self._watched = False
        self._last_cycle_ns = None
        for receiver in self.receivers.values():
            receiver.restart()

    def follow_period(self, ticks: int) -> None:
        """Expect a cycle every `ticks` ticks of 10 ms from now on."""
        self.period_ns = ticks * TICK_NS
        self._last_cycle_ns = None

    def identity(self) -> ModuleIdentity:
        """Read serial, versions and scales by UDS; the scales hold for all later cycles.

        Raises
        ------
        ModuleSilent
            If the module does not answer.
        ModuleRefused
            If it refuses an identifier.
        """
        identity = self.diagnostics.read_identity()
        self.mag_mg_per_count = identity.mag_mg_per_count
        self.accel_g_per_count = identity.accel_g_per_count
        return identity

    def _subscribe(self) -> None:
        subscribe, address = self.bus.subscribe, self.address
        identifiers = (mag_set_id, mag_reset_id, acceleration_id, heading_id)
        for slot, (name, identifier) in enumerate(zip(FRAME_NAMES, identifiers, strict=True)):
            can_id = identifier(address)
            receiver = self.receivers[name] = E2eReceiver(data_id(can_id))
            subscribe(can_id, self._cyclic_handler(slot, name, receiver))
        subscribe(status_id(address), self._on_status)
        self.bus.add_hook(self._end_tick)

    def _cyclic_handler(
        self, slot: int, name: str, receiver: E2eReceiver
    ) -> Callable[[Frame], None]:
        check, states, slots, bit = receiver.check, self._states, self._slots, 1 << slot
        ok = E2eState.OK

        def on_frame(frame: Frame) -> None:
            t_ns, _, data = frame
            state = check(data)
            if state is not states[name]:
                states[name] = state
            if state is not ok:
                self._note(name, state, t_ns)
                if not state.usable:
                    return
            group = data[1] >> 4
            if group != self._group or self._complete & bit:
                self._begin_cycle(t_ns, group)
            slots[slot] = data
            self._complete |= bit

        return on_frame

    def _begin_cycle(self, t_ns: int, group: int) -> None:
        if self._complete:
            self._end_cycle()
        self._t_ns = t_ns
        self._group = group

    def _end_cycle(self) -> None:
        cycle = Cycle(self._t_ns, self._group, self._complete, *self._slots)
        self.cycles += 1
        if self._watched and self._last_cycle_ns is not None:
            periods = round((self._t_ns - self._last_cycle_ns) / self.period_ns)
            if periods > self._gap_cycles:
                self._miss(periods - 1)
        self._last_cycle_ns = self._t_ns
        if self._complete != COMPLETE:
            self.incomplete += 1
        self._slots[:] = (_NO_FRAME,) * len(FRAME_NAMES)
        self._complete = 0
        self._group = -1
        self._last_tick = self.bus.tick_count
        for listener in self._listeners:
            listener(cycle)

    def _end_tick(self) -> None:
        complete = self._complete
        if complete == COMPLETE or (complete and self.bus.mode == "lockstep"):
            self._end_cycle()
        elif self._watched and self.silent:
            self._watched = False  # told once; teardown goes on
            message = (
                f"module {self.address:#04x} has sent nothing for {SILENCE_S:g} s: "
                "check its supply and its plug"
            )
            raise ModuleSilent(message)
        if self._claims.contested and not self._duplicate_told:
            self._duplicate_told = True
            raise self._claims.fault()

    def _miss(self, count: int) -> None:
        self.missed += count
        if len(self.losses) < LOST_LISTED:
            t_s = (self._t_ns - self.bus.start_ns) * 1e-9
            self.losses.append(Loss(t_s, "cycle", E2eState.NOT_AVAILABLE, count))

    def _note(self, name: str, state: E2eState, t_ns: int) -> None:
        receiver = self.receivers[name]
        total = receiver.lost
        count = total - self._lost_before.get(name, 0) if state.usable else 1
        self._lost_before[name] = total
        if len(self.losses) < LOST_LISTED:
            t_s = (t_ns - self.bus.start_ns) * 1e-9
            self.losses.append(Loss(t_s, name, state, count))

    def _on_status(self, frame: Frame) -> None:
        self.status = unpack_status(frame.data)
        self._status_frames += 1
        self._last_tick = self.bus.tick_count
