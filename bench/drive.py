"""One CiA 402 drive as the bench commands it: nothing here waits.

Each operation is started and then advanced once a tick until it says it is done, so that
all axes move at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from bench.errors import RigFault
from bench.sdo import SdoClient
from protocols import cia402
from protocols.canopen import emergency_id, pack_rpdo1, rpdo1_id, tpdo1_id, unpack_tpdo1
from protocols.cia402 import DriveState, drive_state
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from canopen import ObjectDictionary

    from bench.bus import BenchBus
    from bench.travel import AxisProfile
    from protocols.frame import Frame

SILENCE_S: Final = 0.5

_SILENCE_TICKS: Final = round(SILENCE_S / TICK_S)
_CW_POSITION: Final = cia402.CW_ENABLE | cia402.CW_NEW_SET_POINT | cia402.CW_CHANGE_IMMEDIATELY
_CW_HOMING: Final = cia402.CW_ENABLE | cia402.CW_HOMING_START
_TO_ENABLE: Final = {
    DriveState.SWITCH_ON_DISABLED: cia402.CW_SHUTDOWN,
    DriveState.READY_TO_SWITCH_ON: cia402.CW_SWITCH_ON,
    DriveState.SWITCHED_ON: cia402.CW_ENABLE,
    DriveState.QUICK_STOP_ACTIVE: 0,
}
_REASONS: Final = {
    cia402.EMCY_FOLLOWING_ERROR: "following error: the axis is blocked, overloaded or unplugged",
    cia402.EMCY_HEARTBEAT: "it missed the bench's heartbeat and stopped",
    cia402.EMCY_SOFTWARE_LIMIT: "the target is outside the drive's software limits",
}


class Drive:
    """One axis of the rig.

    Parameters
    ----------
    bus : BenchBus
    node_id : int
    axis : str
        "azimuth", "pitch" or "roll".
    objects : canopen.ObjectDictionary
    profile : AxisProfile
    counts_per_deg : float

    Attributes
    ----------
    received_ns : int
        When status and counts were received.
    statusword, counts : int
        As last received.
    target : int
        The present set-point in counts.
    """

    def __init__(
        self,
        bus: BenchBus,
        node_id: int,
        axis: str,
        objects: ObjectDictionary,
        profile: AxisProfile,
        counts_per_deg: float,
    ) -> None:
        self.node_id = node_id
        self.axis = axis
        self.profile = profile
        self.sdo = SdoClient(bus, node_id, axis, objects)
        self.statusword = 0
        self.counts = 0
        self.received_ns = 0
        self.target = 0
        self.last_tick = bus.tick_count
        self.emergency = 0
        self._bus = bus
        self._counts_per_deg = counts_per_deg
        self._acknowledged = False
        self._controlword = 0
        bus.subscribe(tpdo1_id(node_id), self._on_tpdo)
        bus.subscribe(emergency_id(node_id), self._on_emergency)

    @property
    def state(self) -> DriveState:
        """State of the power state machine."""
        return drive_state(self.statusword)

    @property
    def angle_deg(self) -> float:
        """Position in degrees, the azimuth wound."""
        return self.counts / self._counts_per_deg

    @property
    def silent(self) -> bool:
        """Whether no status has come for `SILENCE_S`."""
        return self._bus.tick_count - self.last_tick > _SILENCE_TICKS

    def setup_objects(self) -> list[tuple[int, int, int]]:
        """Return (index, subindex, value) of everything that `connect` writes."""
        per_deg, profile = self._counts_per_deg, self.profile
        return [
            (cia402.SOFTWARE_LIMIT, 1, round(profile.low_deg * per_deg)),
            (cia402.SOFTWARE_LIMIT, 2, round(profile.high_deg * per_deg)),
            (cia402.PROFILE_VELOCITY, 0, round(profile.speed_dps * per_deg)),
            (cia402.PROFILE_ACCELERATION, 0, round(profile.acceleration_dps2 * per_deg)),
        ]

    def advance_enable(self) -> bool:
        """Bring the drive one step nearer to operation enabled; True once it is there."""
        state = self.state
        if state is DriveState.OPERATION_ENABLED:
            return True
        if state is DriveState.FAULT:
            self.emergency = 0
            reset_sent = self._controlword == cia402.CW_FAULT_RESET
            self.command(0 if reset_sent else cia402.CW_FAULT_RESET)
        elif state in _TO_ENABLE:
            self.target = self.counts
            self.command(_TO_ENABLE[state])
        return False

    def start_move(self, angle_deg: float) -> None:
        """Give a new set-point in degrees, the azimuth wound (CiA 402-2, 8: bit 4)."""
        self.target = round(angle_deg * self._counts_per_deg)
        self._acknowledged = False
        self.command(_CW_POSITION)

    def advance_move(self) -> bool:
        """Go on with the set-point hand-shake; True once the drive has reached its target."""
        acknowledge = self.statusword & cia402.SW_SET_POINT_ACKNOWLEDGE
        if not self._acknowledged:
            if acknowledge:
                self._acknowledged = True
                self.command(cia402.CW_ENABLE)
            return False
        return not acknowledge and bool(self.statusword & cia402.SW_TARGET_REACHED)

    def release(self) -> None:
        """End a set-point hand-shake that was interrupted, so that the next one is seen."""
        if self.state is DriveState.OPERATION_ENABLED:
            self.command(cia402.CW_ENABLE)

    def released(self) -> bool:
        """Return whether the drive waits for a new set-point."""
        return not self.statusword & cia402.SW_SET_POINT_ACKNOWLEDGE

    def start_homing(self) -> bool:
        """Start homing once the bits of the former mode are gone; True when started."""
        if self.statusword & cia402.SW_HOMING_ATTAINED:
            return False
        self.command(_CW_HOMING)
        return True

    def advance_homing(self) -> bool:
        """Return whether the drive has found its zero.

        Raises
        ------
        RigFault
            If the drive reports a homing error.
        """
        word = self.statusword
        if word & cia402.SW_HOMING_ERROR:
            message = f"{self.axis} axis did not find its index pulse: check its encoder"
            raise RigFault(message, self.axis)
        done = cia402.SW_HOMING_ATTAINED | cia402.SW_TARGET_REACHED
        if word & done != done:
            return False
        self.target = self.counts
        self.command(cia402.CW_ENABLE)
        return True

    def command(self, controlword: int) -> None:
        """Send a control word with the present target."""
        self._controlword = controlword
        self._bus.send(rpdo1_id(self.node_id), pack_rpdo1(controlword, self.target))

    def fault_sentence(self) -> str | None:
        """Return what is wrong with the drive, or None."""
        if self.statusword & cia402.SW_FAULT:
            reason = _REASONS.get(self.emergency, "look at its display")
            return (
                f"{self.axis} axis is in fault {self.emergency:04X}h at {self.angle_deg:.2f} deg: "
                f"{reason}"
            )
        if self.emergency:
            reason = _REASONS.get(self.emergency, "look at its display")
            return f"{self.axis} drive reports {self.emergency:04X}h: {reason}"
        if self.silent:
            return (
                f"{self.axis} drive (node {self.node_id}) has sent nothing for {SILENCE_S:g} s: "
                "check its supply and the wiring"
            )
        return None

    def _on_tpdo(self, frame: Frame) -> None:
        self.statusword, self.counts = unpack_tpdo1(frame[2])
        self.received_ns = frame[0]
        self.last_tick = self._bus.tick_count

    def _on_emergency(self, frame: Frame) -> None:
        self.emergency = int.from_bytes(frame.data[:2], "little")
