"""The module's diagnostic server (ISO 14229-1): sessions, security, timing and dispatch.

What the services do with the module stands in `devices.diagnostic_services`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from devices.diagnostic_services import DiagnosticServices
from devices.negative_response import NegativeResponse, Nrc
from protocols import uds

if TYPE_CHECKING:
    from collections.abc import Callable

    from devices.firmware import Firmware

_NS_PER_S: Final = 1_000_000_000
_SUPPRESS: Final = 0x80
_SEED_LENGTH: Final = 4
SELF_TEST_S: Final = 0.2
"""The self-test takes longer than P2, so it is announced by NRC 78h."""

SESSION_CONTROL: Final = 0x10
ECU_RESET: Final = 0x11
CLEAR_DTC: Final = 0x14
READ_DTC: Final = 0x19
READ_DATA: Final = 0x22
SECURITY_ACCESS: Final = 0x27
WRITE_DATA: Final = 0x2E
ROUTINE_CONTROL: Final = 0x31
TESTER_PRESENT: Final = 0x3E

_WITH_SUBFUNCTION: Final = frozenset(
    {SESSION_CONTROL, ECU_RESET, READ_DTC, SECURITY_ACCESS, ROUTINE_CONTROL, TESTER_PRESENT}
)
_EXTENDED_ONLY: Final = frozenset({SECURITY_ACCESS, WRITE_DATA, ROUTINE_CONTROL})
_LEAST_LENGTH: Final = {
    SESSION_CONTROL: 2,
    ECU_RESET: 2,
    CLEAR_DTC: 4,
    READ_DTC: 2,
    READ_DATA: 3,
    SECURITY_ACCESS: 2,
    WRITE_DATA: 4,
    ROUTINE_CONTROL: 4,
    TESTER_PRESENT: 2,
}
_EXACT: Final = {SESSION_CONTROL: 2, ECU_RESET: 2, CLEAR_DTC: 4, TESTER_PRESENT: 2}


class Diagnostics:
    """Answers requests, one at a time.

    Parameters
    ----------
    firmware : Firmware
        What is read, written and tested.
    respond : callable
        Takes (time in ns, payload) of every answer.
    reset : callable
        Called once the answer to an ECU reset has left; takes the time in ns.
    """

    def __init__(
        self,
        firmware: Firmware,
        respond: Callable[[int, bytes], None],
        reset: Callable[[int], None],
    ) -> None:
        self._firmware = firmware
        self._services = DiagnosticServices(firmware)
        self._respond = respond
        self._reset = reset
        self._wrong_keys = 0
        self._locked_until_ns = 0
        self._handlers = {
            SESSION_CONTROL: self._control_session,
            ECU_RESET: self._reset_module,
            CLEAR_DTC: self._services.clear_trouble_codes,
            READ_DTC: self._services.read_trouble_codes,
            READ_DATA: self._services.read_data,
            SECURITY_ACCESS: self._access,
            WRITE_DATA: self._services.write_data,
            ROUTINE_CONTROL: self._control_routine,
            TESTER_PRESENT: self._tester_present,
        }
        self.restart()

    def restart(self) -> None:
        """Start in the default session, locked; a lock-out in force stays in force."""
        self.session = uds.SESSION_DEFAULT
        self.unlocked = False
        self._seed: bytes | None = None
        self._heard_ns = 0
        self._now_ns = 0
        self._busy_until_ns: int | None = None
        self._reset_requested = False
        self._services.restart()

    @property
    def waiting(self) -> bool:
        """Whether `poll` has something to watch."""
        return self.session != uds.SESSION_DEFAULT or self._busy_until_ns is not None

    def handle(self, t_ns: int, request: bytes) -> None:
        """Answer one request."""
        self.poll(t_ns)
        self._now_ns = self._heard_ns = t_ns
        service = request[0]
        try:
            answer = self._dispatch(service, request)
        except NegativeResponse as refusal:
            self._respond(t_ns, bytes((0x7F, service, refusal.code)))
            return
        if answer is not None:
            self._respond(t_ns, bytes((service + 0x40,)) + answer)
        if self._reset_requested:
            self._reset_requested = False
            self._reset(t_ns)

    def poll(self, t_ns: int) -> None:
        """Finish what takes time, and leave a session that nobody keeps alive (S3)."""
        if self._busy_until_ns is not None:
            if t_ns < self._busy_until_ns:
                return
            self._busy_until_ns = None
            self._heard_ns = t_ns
            result = self._services.finish_self_test()
            self._respond(t_ns, bytes((ROUTINE_CONTROL + 0x40, 0x01)) + result)
        if (
            self.session != uds.SESSION_DEFAULT
            and t_ns - self._heard_ns > uds.S3_SERVER_S * _NS_PER_S
        ):
            self._enter(uds.SESSION_DEFAULT)

    def _dispatch(self, service: int, request: bytes) -> bytes | None:
        handler = self._handlers.get(service)
        if handler is None:
            raise NegativeResponse(Nrc.SERVICE_NOT_SUPPORTED)
        if self._busy_until_ns is not None and service != TESTER_PRESENT:
            raise NegativeResponse(Nrc.BUSY_REPEAT_REQUEST)
        if service in _EXTENDED_ONLY and self.session != uds.SESSION_EXTENDED:
            raise NegativeResponse(Nrc.SERVICE_NOT_SUPPORTED_IN_SESSION)
        if len(request) < _LEAST_LENGTH[service] or len(request) > _EXACT.get(service, 4095):
            raise NegativeResponse(Nrc.INCORRECT_LENGTH)
        if service == WRITE_DATA and not self.unlocked:
            self._services.require_writable(request)
            raise NegativeResponse(Nrc.SECURITY_ACCESS_DENIED)
        if service not in _WITH_SUBFUNCTION:
            return handler(request)
        suppress = bool(request[1] & _SUPPRESS)
        answer = handler(bytes((service, request[1] & ~_SUPPRESS)) + request[2:])
        return None if suppress or answer == b"" else answer

    def _enter(self, session: int) -> None:
        self.session = session
        self.unlocked = False
        self._seed = None

    def _control_session(self, request: bytes) -> bytes:
        if request[1] not in (uds.SESSION_DEFAULT, uds.SESSION_EXTENDED):
            raise NegativeResponse(Nrc.SUBFUNCTION_NOT_SUPPORTED)
        self._enter(request[1])
        p2_ms = round(uds.P2_SERVER_S * 1000.0)
        p2_star_10ms = round(uds.P2_STAR_SERVER_S * 100.0)
        return bytes((request[1],)) + p2_ms.to_bytes(2, "big") + p2_star_10ms.to_bytes(2, "big")

    def _tester_present(self, request: bytes) -> bytes:
        if request[1] != 0:
            raise NegativeResponse(Nrc.SUBFUNCTION_NOT_SUPPORTED)
        return b"\0"

    def _reset_module(self, request: bytes) -> bytes:
        if request[1] not in (0x01, 0x03):
            raise NegativeResponse(Nrc.SUBFUNCTION_NOT_SUPPORTED)
        self._reset_requested = True
        return request[1:2]

    def _access(self, request: bytes) -> bytes:
        step = request[1]
        if step not in (uds.SECURITY_SEED, uds.SECURITY_KEY):
            raise NegativeResponse(Nrc.SUBFUNCTION_NOT_SUPPORTED)
        expected = 2 if step == uds.SECURITY_SEED else 2 + _SEED_LENGTH
        if len(request) != expected:
            raise NegativeResponse(Nrc.INCORRECT_LENGTH)
        if self._now_ns < self._locked_until_ns:
            raise NegativeResponse(Nrc.REQUIRED_TIME_DELAY_NOT_EXPIRED)
        if step == uds.SECURITY_SEED:
            if self.unlocked:
                return bytes((step,)) + bytes(_SEED_LENGTH)
            self._seed = self._firmware.rng.bytes(_SEED_LENGTH - 1) + b"\x01"
            return bytes((step,)) + self._seed
        self._check_key(request[2:])
        return bytes((step,))

    def _check_key(self, key: bytes) -> None:
        seed, self._seed = self._seed, None
        if seed is None:
            raise NegativeResponse(Nrc.REQUEST_SEQUENCE_ERROR)
        if key == uds.security_key(seed):
            self.unlocked = True
            self._wrong_keys = 0
            return
        self._wrong_keys += 1
        if self._wrong_keys >= uds.SECURITY_ATTEMPTS:
            self._wrong_keys = 0
            self._locked_until_ns = self._now_ns + int(uds.SECURITY_LOCK_OUT_S * _NS_PER_S)
            raise NegativeResponse(Nrc.EXCEEDED_NUMBER_OF_ATTEMPTS)
        raise NegativeResponse(Nrc.INVALID_KEY)

    def _control_routine(self, request: bytes) -> bytes:
        if request[1] == 0x03:
            return self._services.self_test_result(request)
        if request[1] != 0x01:
            raise NegativeResponse(Nrc.SUBFUNCTION_NOT_SUPPORTED)
        routine = int.from_bytes(request[2:4], "big")
        if routine == uds.ROUTINE_SELF_TEST:
            self._services.require_length(request, 4)
            self._busy_until_ns = self._now_ns + int(SELF_TEST_S * _NS_PER_S)
            raise NegativeResponse(Nrc.RESPONSE_PENDING)
        self._services.require_routine(routine)
        if not self.unlocked:
            raise NegativeResponse(Nrc.SECURITY_ACCESS_DENIED)
        return self._services.start_routine(routine, request)
