"""One axis of the rig as a CANopen node: NMT, heartbeats, SDO, PDOs and EMCY (CiA 301).

```
TPDO1 180h+node   statusword u16 | position actual i32      on every SYNC (type 1)
RPDO1 200h+node   controlword u16 | target position i32     obeyed at once (type 255)
EMCY  080h+node   error code u16 | register u8 | 5 bytes of zero
```
A lost heartbeat of a node named in 1016h does what 6007h says and sends EMCY 8130h; the
node stays operational (CiA 301, 1029h, value 1), so that the status word remains visible.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from devices.drive_objects import drive_objects
from devices.drive_profile import ERROR_COMMUNICATION, ERROR_GENERIC, DriveProfile
from protocols import canopen, cia402
from protocols.canopen import (
    STATE_BOOT,
    STATE_OPERATIONAL,
    STATE_PRE_OPERATIONAL,
    STATE_STOPPED,
)
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from collections.abc import Callable

    from devices.drive_profile import Axis

_EMERGENCY = struct.Struct("<HB5x")
_TPDO = struct.Struct("<Hi")


class Drive:
    """One CiA 402 drive on the bus.

    Parameters
    ----------
    node_id : int
        CANopen node number, 1 to 127.
    axis : Axis
        The mechanics that the drive moves.
    serial : int
        Serial number in the identity object 1018h.4.
    """

    def __init__(self, node_id: int, axis: Axis, *, serial: int = 0) -> None:
        self.node_id = node_id
        self.serial = serial
        self._axis = axis
        self._outbox: list[tuple[int, bytes]] = []
        self._heard_ns: int | None = None
        self._next_heartbeat_ns = 0
        self._tpdo_id = canopen.tpdo1_id(node_id)
        self._rpdo_id = canopen.rpdo1_id(node_id)
        self._sdo_id = canopen.sdo_request_id(node_id)
        self._heartbeat_id = canopen.heartbeat_id(node_id)
        self.profile = DriveProfile(axis, self._emergency)
        self.objects = drive_objects(self)
        self._power_on()

    @property
    def accepts(self) -> frozenset[int]:
        """Identifiers that the node listens to; heartbeats of every node among them."""
        heartbeats = {canopen.heartbeat_id(node) for node in range(1, 128)}
        own = {canopen.NMT_ID, self._rpdo_id, self._sdo_id}
        return frozenset(own | heartbeats - {self._heartbeat_id})

    def receive(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Take one frame from the bus; answers leave with the next `tick`."""
        if can_id == self._rpdo_id:
            if self.nmt_state == STATE_OPERATIONAL and len(data) >= _TPDO.size:
                controlword, self.profile.target = canopen.unpack_rpdo1(data[: _TPDO.size])
                self.profile.control(controlword)
        elif can_id == self._sdo_id:
            if self.nmt_state != STATE_STOPPED:
                answer = self.objects.answer(data)
                self._outbox.append((canopen.sdo_response_id(self.node_id), answer))
        elif can_id == canopen.NMT_ID:
            if len(data) >= 2 and data[1] in (0, self.node_id):
                self._obey_nmt(data[0])
        elif can_id - 0x700 == self.consumer_node and data[:1] != b"\0":
            self._heard_ns = t_ns

    def tick(self, t_ns: int, group: int, emit: Callable[[int, bytes], None]) -> None:
        """Send what is due in this period of 10 ms: answers, EMCY, heartbeat."""
        del group
        self.profile.step(TICK_S)
        if self._heard_ns is not None:
            self._watch_consumer(t_ns)
        if self._outbox:
            for can_id, data in self._outbox:
                emit(can_id, data)
            self._outbox.clear()
        if self.heartbeat_ms and t_ns >= self._next_heartbeat_ns:
            emit(self._heartbeat_id, bytes((self.nmt_state,)))
            self._next_heartbeat_ns = t_ns + self.heartbeat_ms * 1_000_000

    def sync(self, emit: Callable[[int, bytes], None]) -> None:
        """Send TPDO1, as transmission type 1 has it."""
        if self.nmt_state == STATE_OPERATIONAL:
            profile = self.profile
            emit(self._tpdo_id, _TPDO.pack(profile.statusword, profile.position))

    def set_consumer(self, value: int) -> None:
        """Write 1016h.1: node in bits 16..23, time in ms in bits 0..15 (CiA 301, 7.5.2.19)."""
        self.consumer = value
        self.consumer_node = value >> 16 & 0x7F if value & 0xFFFF else 0
        self._heard_ns = None

    def set_heartbeat(self, period_ms: int) -> None:
        """Write 1017h; 0 stops the node's own heartbeat."""
        self.heartbeat_ms = period_ms
        self._next_heartbeat_ns = 0

    def _power_on(self) -> None:
        self.nmt_state = STATE_PRE_OPERATIONAL
        self.error_register = 0
        self.errors: list[int] = []
        self.abort_option = cia402.ABORT_QUICK_STOP
        self.set_consumer(0)
        self.set_heartbeat(0)
        self._outbox.clear()
        self._outbox.append((self._heartbeat_id, bytes((STATE_BOOT,))))

    def _obey_nmt(self, command: int) -> None:
        if command == canopen.NMT_START:
            self.nmt_state = STATE_OPERATIONAL
        elif command == canopen.NMT_PRE_OPERATIONAL:
            self.nmt_state = STATE_PRE_OPERATIONAL
        elif command == canopen.NMT_STOP:
            self.nmt_state = STATE_STOPPED
            self._abort_connection()
        elif command in (canopen.NMT_RESET_NODE, canopen.NMT_RESET_COMMUNICATION):
            self.profile.disable()
            if command == canopen.NMT_RESET_NODE:
                self.profile.restore_defaults()
            self._power_on()

    def _watch_consumer(self, t_ns: int) -> None:
        heard_ns = self._heard_ns
        if heard_ns is not None and t_ns - heard_ns > (self.consumer & 0xFFFF) * 1_000_000:
            self._heard_ns = None
            self._emergency(cia402.EMCY_HEARTBEAT, ERROR_GENERIC | ERROR_COMMUNICATION)
            self._abort_connection()

    def _abort_connection(self) -> None:
        option = self.abort_option
        if option == 1:
            self.profile.fail(cia402.EMCY_HEARTBEAT, ERROR_GENERIC | ERROR_COMMUNICATION)
        elif option == 2:
            self.profile.disable()
        elif option == cia402.ABORT_QUICK_STOP:
            self.profile.quick_stop()

    def _emergency(self, code: int, register: int) -> None:
        self.error_register = self.error_register | register if code else 0
        if code:
            self.errors.insert(0, code)
            del self.errors[4:]
        data = _EMERGENCY.pack(code, self.error_register)
        self._outbox.append((canopen.emergency_id(self.node_id), data))
