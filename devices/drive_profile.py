"""The power state machine and the modes of a CiA 402 drive over one axis of mechanics.

CiA 402-2 (IEC 61800-7-201), clause 6 (state machine, quick stop), 8 (profile position,
set-point hand-shake), 9 (homing), 10 (profile velocity). The drive closes its loop on its
encoder and knows nothing of the true angle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

from devices.object_dictionary import ABORT_STATE, ABORT_VALUE, SdoRefused
from protocols import cia402
from protocols.cia402 import COUNTS_PER_DEG, DriveState, Mode

if TYPE_CHECKING:
    from collections.abc import Callable


class Axis(Protocol):
    """What a drive moves and reads; `devices.mechanics.AxisMechanics` is one.

    Velocities are in deg/s, accelerations in deg/s2.
    """

    @property
    def encoder_deg(self) -> float:
        """Angle that the encoder shows; zero at its index pulse."""
        ...

    @property
    def following_error_deg(self) -> float:
        """Demanded minus measured angle."""
        ...

    @property
    def moving(self) -> bool:
        """Whether the axis moves or still rings."""
        ...

    def command(self, target_deg: float, velocity_dps: float, acceleration_dps2: float, /) -> None:
        """Go to an angle of the encoder."""
        ...

    def command_velocity(self, velocity_dps: float, acceleration_dps2: float, /) -> None:
        """Turn until told otherwise."""
        ...

    def quick_stop(self) -> None:
        """Brake and stay where that ends."""
        ...


TRAVEL_LIMIT: Final = 540_000
"""Software limits after power-on, in counts either way: what the cable allows."""
POSITION_WINDOW_MS: Final = 50
FOLLOWING_ERROR_MS: Final = 50
HOMING_SPEED: Final = 20_000
"""Counts a second."""
ERROR_GENERIC: Final = 0x01
ERROR_COMMUNICATION: Final = 0x10
ERROR_PROFILE: Final = 0x20

_CW_VOLTAGE: Final = 0x02
_CW_RELATIVE: Final = 0x40
_SW_ALWAYS: Final = 0x0210
"""Voltage enabled and remote."""
_MODE_BITS: Final = 0x3400
_READY: Final = (DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON)


class DriveProfile:
    """State, modes and motion of one drive; positions in counts of `COUNTS_PER_DEG`.

    Parameters
    ----------
    axis : Axis
        The mechanics behind the drive.
    report : callable
        Takes (EMCY error code, bits of the error register).
    """

    def __init__(self, axis: Axis, report: Callable[[int, int], None]) -> None:
        self._axis = axis
        self._report = report
        self._home_deg = axis.encoder_deg
        self.homed = False
        self.restore_defaults()

    def restore_defaults(self) -> None:
        """Take the values that all writable objects have after power-on."""
        self.position = self._last_position = self._counts()
        self.state = DriveState.SWITCH_ON_DISABLED
        self.mode: int = Mode.PROFILE_POSITION.value
        self.controlword = 0
        self.error_code = 0
        self.target = self.position
        self.target_velocity = 0
        self.profile_velocity = 45_000
        self.profile_acceleration = 90_000
        self.position_window = 50
        self.following_error_window = 2_000
        self.limit_low = -TRAVEL_LIMIT
        self.limit_high = TRAVEL_LIMIT
        self.homing_method = cia402.HOMING_ON_INDEX_PULSE
        self.velocity = 0.0
        self._bits = 0
        self._goal = self.target
        self._waiting: int | None = None
        self._homing = False
        self._under_way = False
        self._settled_s = 0.0
        self._beyond_s = 0.0

    @property
    def statusword(self) -> int:
        """Object 6041h."""
        return self.state.value[1] | self._bits | _SW_ALWAYS

    def fail(self, code: int, register: int) -> None:
        """Stop the axis and enter FAULT with an EMCY code (transitions 13 and 14)."""
        self._axis.quick_stop()
        self._under_way = self._homing = False
        self._waiting = None
        self.state = DriveState.FAULT
        self.error_code = code
        self._report(code, register)

    def quick_stop(self) -> None:
        """Stop on the quick stop ramp; the drive is disabled once it stands still."""
        if self.state is DriveState.OPERATION_ENABLED:
            self._axis.quick_stop()
            self._under_way = self._homing = False
            self._waiting = None
            self.state = DriveState.QUICK_STOP_ACTIVE

    def disable(self) -> None:
        """Take the voltage away (transitions 7, 9, 10, 12, 15)."""
        if self.state is not DriveState.FAULT:
            self._leave(DriveState.SWITCH_ON_DISABLED)

    def control(self, word: int) -> None:
        """Obey a control word (6040h)."""
        previous, self.controlword = self.controlword, word
        rising = word & ~previous
        if self.state is DriveState.FAULT:
            if rising & cia402.CW_FAULT_RESET:
                self._reset_fault()
            return
        self._change_state(word)
        if self.state is DriveState.OPERATION_ENABLED:
            if self.mode == Mode.PROFILE_POSITION.value:
                self._control_position(word, rising)
            elif self.mode == Mode.PROFILE_VELOCITY.value:
                self._control_velocity(word, rising | previous & ~word)
            else:
                self._control_homing(word, rising)

    def set_mode(self, mode: int) -> None:
        """Write 6060h: bits 10, 12 and 13 of the status word start afresh."""
        if mode not in (1, 3, 6):
            raise SdoRefused(ABORT_VALUE)
        if self._under_way or self._homing:
            raise SdoRefused(ABORT_STATE)
        if mode != self.mode:
            self.mode = mode
            self._bits &= ~_MODE_BITS
            self._waiting = None

    def set_target_velocity(self, counts_per_s: int) -> None:
        """Write 60FFh; obeyed at once in profile velocity mode."""
        self.target_velocity = counts_per_s
        if self.state is DriveState.OPERATION_ENABLED and self.mode == Mode.PROFILE_VELOCITY.value:
            self._run_at_velocity()

    def step(self, dt_s: float) -> None:
        """Let `dt_s` seconds pass, after the mechanics have."""
        self.position = position = round((self._axis.encoder_deg - self._home_deg) * COUNTS_PER_DEG)
        self.velocity = (position - self._last_position) / dt_s
        self._last_position = position
        if self.state is DriveState.OPERATION_ENABLED:
            if self._under_way or self._homing:
                self._supervise(dt_s)
            if self._under_way:
                self._advance(position, dt_s)
            elif self._homing:
                self._advance_homing(dt_s)
        elif self.state is DriveState.QUICK_STOP_ACTIVE and not self._axis.moving:
            self.state = DriveState.SWITCH_ON_DISABLED

    def _counts(self) -> int:
        return round((self._axis.encoder_deg - self._home_deg) * COUNTS_PER_DEG)

    def _leave(self, state: DriveState) -> None:
        if self.state is DriveState.OPERATION_ENABLED:
            self._axis.quick_stop()
            self._under_way = self._homing = False
            self._waiting = None
        self.state = state

    def _reset_fault(self) -> None:
        self.state = DriveState.SWITCH_ON_DISABLED
        self.error_code = 0
        self._beyond_s = 0.0
        self._bits &= ~(cia402.SW_FOLLOWING_ERROR | cia402.SW_INTERNAL_LIMIT)
        self._report(0, 0)

    def _change_state(self, word: int) -> None:
        state = self.state
        command = word & 0x0F
        if not word & _CW_VOLTAGE:
            self._leave(DriveState.SWITCH_ON_DISABLED)
        elif not word & 0x04:
            if state is DriveState.OPERATION_ENABLED:
                self.quick_stop()
            elif state in _READY:
                self.state = DriveState.SWITCH_ON_DISABLED
        elif state is DriveState.QUICK_STOP_ACTIVE:
            return
        elif not command & 0x01:
            self._leave(DriveState.READY_TO_SWITCH_ON)
        elif state in _READY or state is DriveState.OPERATION_ENABLED:
            if not command & 0x08:
                self._leave(DriveState.SWITCHED_ON)
            elif state is not DriveState.OPERATION_ENABLED:
                self.state = DriveState.OPERATION_ENABLED
                self.target = self.position
                self._bits &= ~(_MODE_BITS | cia402.SW_INTERNAL_LIMIT)

    def _control_position(self, word: int, rising: int) -> None:
        if rising & cia402.CW_HALT:
            self._axis.quick_stop()
            self._under_way = False
        if rising & cia402.CW_NEW_SET_POINT and not self._bits & cia402.SW_SET_POINT_ACKNOWLEDGE:
            target = self.target
            if word & _CW_RELATIVE:
                target += self._last_position
            self._bits |= cia402.SW_SET_POINT_ACKNOWLEDGE
            if self._under_way and not word & cia402.CW_CHANGE_IMMEDIATELY:
                self._waiting = target
            else:
                self._start(target)
        elif not word & cia402.CW_NEW_SET_POINT and self._waiting is None:
            self._bits &= ~cia402.SW_SET_POINT_ACKNOWLEDGE

    def _start(self, target: int) -> None:
        limited = min(max(target, self.limit_low), self.limit_high)
        if limited != target:
            self._bits |= cia402.SW_INTERNAL_LIMIT
            self._report(cia402.EMCY_SOFTWARE_LIMIT, ERROR_GENERIC | ERROR_PROFILE)
        else:
            self._bits &= ~cia402.SW_INTERNAL_LIMIT
        self._bits &= ~cia402.SW_TARGET_REACHED
        self._goal = limited
        self._settled_s = 0.0
        self._beyond_s = 0.0
        self._under_way = True
        self._move(limited / COUNTS_PER_DEG + self._home_deg, self.profile_velocity)

    def _move(self, encoder_deg: float, counts_per_s: int) -> None:
        self._axis.command(
            encoder_deg, counts_per_s / COUNTS_PER_DEG, self.profile_acceleration / COUNTS_PER_DEG
        )

    def _supervise(self, dt_s: float) -> None:
        error_deg = self._axis.following_error_deg
        if abs(error_deg) * COUNTS_PER_DEG <= self.following_error_window:
            self._beyond_s = 0.0
            return
        self._beyond_s += dt_s
        if self._beyond_s * 1000.0 >= FOLLOWING_ERROR_MS:
            self._bits |= cia402.SW_FOLLOWING_ERROR
            self.fail(cia402.EMCY_FOLLOWING_ERROR, ERROR_GENERIC | ERROR_PROFILE)

    def _advance(self, position: int, dt_s: float) -> None:
        if self.mode == Mode.PROFILE_VELOCITY.value:
            reached = abs(self.velocity - self.target_velocity) <= self.position_window
        elif abs(position - self._goal) > self.position_window or self._axis.moving:
            self._settled_s = 0.0
            return
        else:
            self._settled_s += dt_s
            reached = self._settled_s * 1000.0 >= POSITION_WINDOW_MS
        if not reached:
            self._bits &= ~cia402.SW_TARGET_REACHED
            return
        self._bits |= cia402.SW_TARGET_REACHED
        if self.mode == Mode.PROFILE_VELOCITY.value:
            return
        self._under_way = False
        if self._waiting is not None:
            following, self._waiting = self._waiting, None
            self._start(following)
            if not self.controlword & cia402.CW_NEW_SET_POINT:
                self._bits &= ~cia402.SW_SET_POINT_ACKNOWLEDGE

    def _control_velocity(self, word: int, changed: int) -> None:
        if word & cia402.CW_HALT:
            self._axis.quick_stop()
            self._under_way = False
        elif not self._under_way or changed & cia402.CW_HALT:
            self._run_at_velocity()

    def _run_at_velocity(self) -> None:
        self._bits &= ~cia402.SW_TARGET_REACHED
        self._under_way = True
        self._beyond_s = 0.0
        self._axis.command_velocity(
            self.target_velocity / COUNTS_PER_DEG, self.profile_acceleration / COUNTS_PER_DEG
        )

    def _control_homing(self, word: int, rising: int) -> None:
        if self._homing and (word & cia402.CW_HALT or not word & cia402.CW_HOMING_START):
            self._axis.quick_stop()
            self._homing = False
        if rising & cia402.CW_HOMING_START:
            self._bits &= ~_MODE_BITS
            self._homing = True
            self._settled_s = self._beyond_s = 0.0
            if self.homing_method == cia402.HOMING_ON_INDEX_PULSE:
                # The encoder's own zero is its index pulse; the axis stops and settles on it.
                self._move(0.0, HOMING_SPEED)

    def _advance_homing(self, dt_s: float) -> None:
        if self._axis.moving:
            self._settled_s = 0.0
            return
        self._settled_s += dt_s
        if self._settled_s * 1000.0 < POSITION_WINDOW_MS:
            return
        on_index = self.homing_method == cia402.HOMING_ON_INDEX_PULSE
        encoder_deg = self._axis.encoder_deg
        self._homing = False
        if on_index and abs(encoder_deg) * COUNTS_PER_DEG > self.position_window:
            self._bits |= cia402.SW_HOMING_ERROR
            return
        self._home_deg = 0.0 if on_index else encoder_deg
        self.position = self._last_position = self.target = self._counts()
        self.homed = True
        self._bits |= cia402.SW_HOMING_ATTAINED | cia402.SW_TARGET_REACHED
