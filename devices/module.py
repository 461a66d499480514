"""The compass module on the bus: cyclic frames, address claim and diagnostics.

After power-on or a reset the module is silent for `BOOT_S`, claims its address (SAE
J1939-81) and then sends its measuring cycles. It obeys no SYNC: in the simulator the
group of a cycle is that of the SYNC which the host was called for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from devices.diagnostics import Diagnostics
from devices.isotp import IsoTpServer
from protocols import compass, j1939, uds
from protocols.e2e import E2eSender

if TYPE_CHECKING:
    from collections.abc import Callable

    from devices.firmware import Firmware

BOOT_S: Final = 0.3
_NS_PER_S: Final = 1_000_000_000
_NEVER_NS: Final = 1 << 62


class CompassModule:
    """One module.

    Parameters
    ----------
    firmware : Firmware
        What it measures, computes and stores.
    address : int
        J1939 source address.
    """

    def __init__(self, firmware: Firmware, *, address: int = j1939.MODULE_ADDRESS) -> None:
        self.firmware = firmware
        self.address = address
        self._name = j1939.pack_name(firmware.serial)
        self._outbox: list[tuple[int, bytes]] = []
        self._set_id = compass.mag_set_id(address)
        self._reset_id = compass.mag_reset_id(address)
        self._accel_id = compass.acceleration_id(address)
        self._heading_id = compass.heading_id(address)
        self._claim_id = j1939.address_claimed_id(address)
        self._request_id = uds.physical_request_id(address)
        response_id = uds.physical_response_id(address)
        self._transport = IsoTpServer(lambda data: self._outbox.append((response_id, data)))
        self._diagnostics = Diagnostics(firmware, self._transport.transmit, self._reset)
        self._silent_from_ns = _NEVER_NS
        self._silent_until_ns = _NEVER_NS
        self._reset(0)
        self._running = False

    @property
    def accepts(self) -> frozenset[int]:
        """Identifiers that the node listens to."""
        requests = {
            j1939.request_id(destination, source)
            for destination in (self.address, j1939.GLOBAL_ADDRESS)
            for source in range(256)
        }
        return frozenset(requests | {self._request_id, self._claim_id})

    def silence(self, from_ns: int, until_ns: int) -> None:
        """Neither send nor answer within a span of time (fault `module_silent`)."""
        self._silent_from_ns, self._silent_until_ns = from_ns, until_ns

    def receive(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Take one frame from the bus; answers leave with the next `tick`."""
        if not self._running or self._silent_from_ns <= t_ns < self._silent_until_ns:
            return
        if can_id == self._request_id:
            request = self._transport.receive(t_ns, data)
            if request is not None:
                self._diagnostics.handle(t_ns, request)
        elif can_id == self._claim_id:
            self._contend(data)
        elif data[:3] == j1939.pack_request(j1939.PGN_ADDRESS_CLAIMED):
            self._claim()

    def tick(self, t_ns: int, group: int, emit: Callable[[int, bytes], None]) -> None:
        """Send what is due in this period of 10 ms: answers, then a measuring cycle."""
        if t_ns < self._awake_ns or self._displaced:
            self._flush(emit)
            return
        if not self._running:
            self._start()
        if not self._transport.idle:
            self._transport.poll(t_ns)
        if self._diagnostics.waiting:
            self._diagnostics.poll(t_ns)
        if self._silent_from_ns <= t_ns < self._silent_until_ns:
            self._outbox.clear()
            return
        if self._outbox:
            self._flush(emit)
        if self._tick % self.firmware.sample_period_ticks == 0:
            self._send_cycle(t_ns, group, emit)
        if self._tick % compass.STATUS_PERIOD_TICKS == 0:
            self._send_status(emit)
        self._tick += 1

    def sync(self, emit: Callable[[int, bytes], None]) -> None:
        """Do nothing: the module keeps its own time."""

    def _send_cycle(self, t_ns: int, group: int, emit: Callable[[int, bytes], None]) -> None:
        cycle = self.firmware.cycle(t_ns / _NS_PER_S)
        if cycle is None:
            return
        set_counts, reset_counts, accel_counts, heading, pitch, roll, quality = cycle
        emit(self._set_id, compass.pack_counts(self._set_sender, group, *set_counts))
        emit(self._reset_id, compass.pack_counts(self._reset_sender, group, *reset_counts))
        emit(self._accel_id, compass.pack_counts(self._accel_sender, group, *accel_counts))
        sender = self._heading_sender
        emit(
            self._heading_id,
            compass.pack_heading(sender, group, heading, pitch, roll, quality),
        )

    def _send_status(self, emit: Callable[[int, bytes], None]) -> None:
        firmware = self.firmware
        status = compass.Status(
            firmware.sensors.temperature_c,
            firmware.sensors.supply_v,
            firmware.flags,
            firmware.store.boots,
            len(firmware.trouble_codes),
        )
        emit(compass.status_id(self.address), compass.pack_status(status))
        cycle = firmware.last_cycle
        if cycle is not None:
            data = compass.pack_vehicle_direction(cycle.heading_deg, cycle.pitch_deg)
            emit(compass.vehicle_direction_id(self.address), data)

    def _flush(self, emit: Callable[[int, bytes], None]) -> None:
        for can_id, data in self._outbox:
            emit(can_id, data)
        self._outbox.clear()

    def _reset(self, t_ns: int) -> None:
        """Restart the microcontroller; what it has answered still leaves."""
        self._awake_ns = t_ns + int(BOOT_S * _NS_PER_S)
        self._running = False
        self._displaced = False
        self._transport.reset()
        self._diagnostics.restart()

    def _start(self) -> None:
        address = self.address
        self._running = True
        self._tick = 0
        self._set_sender = E2eSender(compass.data_id(compass.mag_set_id(address)))
        self._reset_sender = E2eSender(compass.data_id(compass.mag_reset_id(address)))
        self._accel_sender = E2eSender(compass.data_id(compass.acceleration_id(address)))
        self._heading_sender = E2eSender(compass.data_id(compass.heading_id(address)))
        self.firmware.boot()
        self._claim()

    def _claim(self) -> None:
        self._outbox.append((self._claim_id, self._name))

    def _contend(self, name: bytes) -> None:
        """Keep the address against a higher NAME, give it up to a lower one (J1939-81, 4.4.3)."""
        if name == self._name:
            return
        if int.from_bytes(self._name, "little") < int.from_bytes(name, "little"):
            self._claim()
            return
        self._displaced = True
        self._running = False
        self._outbox.append((j1939.address_claimed_id(j1939.NULL_ADDRESS), self._name))
