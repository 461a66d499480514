"""What the module's diagnostic services do: data, routines and trouble codes.

```
22  read    serial, part, versions, coefficients in use and staged, set/reset, period, ...
2E  write   staged coefficients, set/reset, sample period
31  start   set/reset pulse (u16 mA), commit, rollback, self-test (answers one byte, below)
19  01 02 0A, 14   trouble codes with status 09h: test failed, confirmed
```
Result of the self-test: bit 0 strap current too small, bit 1 a reading at the end of the
scale, bit 2 no plausible acceleration, bit 3 coefficients lost; 0 is a pass.
"""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING, Final

from devices.firmware import LEAST_PULSE_MA
from devices.negative_response import NegativeResponse, Nrc
from protocols import uds
from protocols.errors import FrameError

if TYPE_CHECKING:
    from collections.abc import Callable

    from devices.firmware import Firmware

MOST_PULSE_MA: Final = 5000
"""What the strap driver can give."""
ALTERNATING: Final = 1
DTC_STATUS: Final = 0x09
"""Test failed and confirmed (ISO 14229-1, D.2); also the availability mask."""
ALL_GROUPS: Final = 0xFFFFFF
LONGEST_ANSWER: Final = 400

_ROUTINES: Final = (uds.ROUTINE_SET_RESET_PULSE, uds.ROUTINE_COMMIT, uds.ROUTINE_ROLLBACK)
_TROUBLE_CODES: Final = (uds.DTC_COEFFICIENTS_LOST, uds.DTC_STRAP, uds.DTC_SATURATED)
_SET_RESET = struct.Struct(">HB")


class DiagnosticServices:
    """Services of one module that need neither session nor time."""

    def __init__(self, firmware: Firmware) -> None:
        self._firmware = firmware
        self._readers: dict[int, Callable[[], bytes]] = {
            uds.DID_PART_NUMBER: firmware.part.encode,
            uds.DID_SERIAL: lambda: firmware.serial.encode("ascii"),
            uds.DID_HARDWARE_VERSION: firmware.HARDWARE_VERSION.encode,
            uds.DID_FIRMWARE_VERSION: firmware.FIRMWARE_VERSION.encode,
            uds.DID_COEFFICIENTS: lambda: uds.pack_coefficients(firmware.coefficients),
            uds.DID_COEFFICIENTS_STAGED: self._read_staged,
            uds.DID_SET_RESET: self._read_set_reset,
            uds.DID_SAMPLE_PERIOD: lambda: bytes((firmware.sample_period_ticks,)),
            uds.DID_SCALES: self._read_scales,
            uds.DID_TEMPERATURE: self._read_temperature,
        }
        self._writers: dict[int, Callable[[bytes], None]] = {
            uds.DID_COEFFICIENTS_STAGED: self._write_staged,
            uds.DID_SET_RESET: self._write_set_reset,
            uds.DID_SAMPLE_PERIOD: self._write_sample_period,
        }
        self.restart()

    def restart(self) -> None:
        """Forget the last self-test."""
        self._self_test: int | None = None

    @staticmethod
    def require_length(request: bytes, length: int) -> None:
        """Refuse a request of another length."""
        if len(request) != length:
            raise NegativeResponse(Nrc.INCORRECT_LENGTH)

    @staticmethod
    def require_routine(routine: int) -> None:
        """Refuse a routine that the module does not have."""
        if routine not in _ROUTINES:
            raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE)

    def require_writable(self, request: bytes) -> None:
        """Refuse to write an identifier that nobody may write."""
        if int.from_bytes(request[1:3], "big") not in self._writers:
            raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE)

    def read_data(self, request: bytes) -> bytes:
        """Read data by identifiers (22h); unknown ones are left out unless all are."""
        if len(request) % 2 == 0:
            raise NegativeResponse(Nrc.INCORRECT_LENGTH)
        answer = b""
        for start in range(1, len(request), 2):
            identifier = request[start : start + 2]
            reader = self._readers.get(int.from_bytes(identifier, "big"))
            if reader is not None:
                answer += identifier + reader()
        if not answer:
            raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE)
        if len(answer) > LONGEST_ANSWER:
            raise NegativeResponse(Nrc.RESPONSE_TOO_LONG)
        return answer

    def write_data(self, request: bytes) -> bytes:
        """Write data by identifier (2Eh)."""
        self.require_writable(request)
        self._writers[int.from_bytes(request[1:3], "big")](request[3:])
        return request[1:3]

    def start_routine(self, routine: int, request: bytes) -> bytes:
        """Start a routine (31h 01h) and return its identity and result."""
        if routine == uds.ROUTINE_SET_RESET_PULSE:
            self.require_length(request, 6)
            current_ma = int.from_bytes(request[4:6], "big")
            if current_ma > MOST_PULSE_MA:
                raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE)
            self._firmware.sensors.pulse(float(current_ma))
        else:
            self.require_length(request, 4)
            self._change_banks(routine)
        return request[1:4]

    def finish_self_test(self) -> bytes:
        """Return routine and result once the self-test has had its time."""
        firmware = self._firmware
        cycle, g_per_count = firmware.last_cycle, firmware.converters.accel_g_per_count
        result = 0
        if firmware.sensors.pulse_current_ma < LEAST_PULSE_MA:
            result |= 0x01
        if firmware.saturated:
            result |= 0x02
        if cycle is None or not _plausible(cycle.accel_counts, g_per_count):
            result |= 0x04
        if uds.DTC_COEFFICIENTS_LOST in firmware.trouble_codes:
            result |= 0x08
        self._self_test = result
        return uds.ROUTINE_SELF_TEST.to_bytes(2, "big") + bytes((result,))

    def self_test_result(self, request: bytes) -> bytes:
        """Return the result of the last self-test (31h 03h)."""
        self.require_length(request, 4)
        if int.from_bytes(request[2:4], "big") != uds.ROUTINE_SELF_TEST:
            raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE)
        if self._self_test is None:
            raise NegativeResponse(Nrc.REQUEST_SEQUENCE_ERROR)
        return request[1:4] + bytes((self._self_test,))

    def read_trouble_codes(self, request: bytes) -> bytes:
        """Report number (01h) or list (02h) by status mask, or what is supported (0Ah)."""
        kind = request[1]
        present = sorted(self._firmware.trouble_codes)
        if kind == 0x0A:
            self.require_length(request, 2)
            statuses = [(code, DTC_STATUS * (code in present)) for code in _TROUBLE_CODES]
            return bytes((kind, DTC_STATUS)) + _pack_codes(statuses)
        if kind not in (0x01, 0x02):
            raise NegativeResponse(Nrc.SUBFUNCTION_NOT_SUPPORTED)
        self.require_length(request, 3)
        matching = [(code, DTC_STATUS) for code in present if request[2] & DTC_STATUS]
        if kind == 0x01:
            return bytes((kind, DTC_STATUS, 0x01)) + len(matching).to_bytes(2, "big")
        return bytes((kind, DTC_STATUS)) + _pack_codes(matching)

    def clear_trouble_codes(self, request: bytes) -> bytes | None:
        """Clear one trouble code or all (14h)."""
        group = int.from_bytes(request[1:4], "big")
        if group == ALL_GROUPS:
            self._firmware.trouble_codes.clear()
        elif group in _TROUBLE_CODES:
            self._firmware.trouble_codes.discard(group)
        else:
            raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE)
        return b""

    def _change_banks(self, routine: int) -> None:
        try:
            if routine == uds.ROUTINE_ROLLBACK:
                self._firmware.rollback()
            elif not self._firmware.commit():
                raise NegativeResponse(Nrc.REQUEST_SEQUENCE_ERROR)
        except OSError as error:
            raise NegativeResponse(Nrc.GENERAL_PROGRAMMING_FAILURE) from error

    def _read_staged(self) -> bytes:
        staged = self._firmware.staged()
        if staged is None:
            raise NegativeResponse(Nrc.CONDITIONS_NOT_CORRECT)
        return staged

    def _write_staged(self, bank: bytes) -> None:
        if len(bank) not in (uds.PLAIN_BANK_LENGTH, uds.BANK_LENGTH):
            raise NegativeResponse(Nrc.INCORRECT_LENGTH)
        try:
            self._firmware.stage(bank)
        except FrameError as error:
            raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE) from error
        except RuntimeError as error:
            raise NegativeResponse(Nrc.CONDITIONS_NOT_CORRECT) from error
        except OSError as error:
            raise NegativeResponse(Nrc.GENERAL_PROGRAMMING_FAILURE) from error

    def _read_set_reset(self) -> bytes:
        return _SET_RESET.pack(round(self._firmware.sensors.pulse_current_ma), ALTERNATING)

    def _write_set_reset(self, data: bytes) -> None:
        self.require_length(data, _SET_RESET.size)
        current_ma, operation = _SET_RESET.unpack(data)
        if current_ma > MOST_PULSE_MA or operation != ALTERNATING:
            raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE)
        self._firmware.set_pulse_current(float(current_ma))

    def _write_sample_period(self, data: bytes) -> None:
        self.require_length(data, 1)
        if data[0] == 0:
            raise NegativeResponse(Nrc.REQUEST_OUT_OF_RANGE)
        self._firmware.sample_period_ticks = data[0]

    def _read_scales(self) -> bytes:
        converters = self._firmware.converters
        return uds.pack_scales(converters.mag_mg_per_count, converters.accel_g_per_count)

    def _read_temperature(self) -> bytes:
        return struct.pack(">h", round(self._firmware.sensors.temperature_c * 100.0))


def _plausible(accel_counts: tuple[int, int, int], g_per_count: float) -> bool:
    return 0.8 <= math.hypot(*accel_counts) * g_per_count <= 1.2


def _pack_codes(codes: list[tuple[int, int]]) -> bytes:
    return b"".join(code.to_bytes(3, "big") + bytes((status,)) for code, status in codes)
