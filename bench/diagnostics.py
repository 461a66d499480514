"""The module's diagnostic services as the bench uses them: UDS (ISO 14229-1) by udsoncan.

udsoncan's client builds the requests and judges the answers; time is the bus's, because its
connection here waits by ticks.
"""

from __future__ import annotations

import logging
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

from udsoncan import DidCodec
from udsoncan.client import Client
from udsoncan.connections import BaseConnection
from udsoncan.exceptions import (
    InvalidResponseException,
    NegativeResponseException,
    TimeoutException,
    UnexpectedResponseException,
)

from bench.coefficient_transaction import CoefficientTransaction
from bench.errors import ModuleRefused, ModuleSilent
from bench.isotp_channel import IsoTpChannel
from bench.module import ModuleIdentity
from protocols import uds
from protocols.errors import FrameError
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from udsoncan.typing import ClientConfig

    from bench.bus import BenchBus
    from bench.coefficient_transaction import CoefficientWrite
    from bench.module import Module
    from protocols.uds import Coefficients

P2_CLIENT_S: Final = 0.2
"""To the start of an answer: the module's P2 and the way of two frames over a busy bus."""
P2_STAR_CLIENT_S: Final = 5.2
KEEP_ALIVE_S: Final = 2.0
"""An extended session without requests is kept alive this often (S3 is 5 s)."""
READY_TIMEOUT_S: Final = 3.0

T = TypeVar("T")

_KEEP_ALIVE_TICKS: Final = round(KEEP_ALIVE_S / TICK_S)
_TESTER_PRESENT: Final = bytes((0x3E, 0x80))
_HARD_RESET: Final = 0x01
_ALL_DTCS: Final = 0xFF
_ALL_GROUPS: Final = 0xFFFFFF


class _Bytes(DidCodec):
    """Data identifiers as they are: each caller knows its payload."""

    def encode(self, *did_value: Any) -> bytes:
        return bytes(did_value[0])

    def decode(self, did_payload: bytes) -> bytes:
        return did_payload

    def __len__(self) -> int:
        raise DidCodec.ReadAllRemainingData


class _TickingConnection(BaseConnection):
    """udsoncan's connection over an `IsoTpChannel`."""

    def __init__(self, channel: IsoTpChannel) -> None:
        super().__init__("compass module")
        self._channel = channel

    def open(self) -> _TickingConnection:
        return self

    def close(self) -> None:
        self._channel.close()

    def is_open(self) -> bool:
        return True

    def empty_rxqueue(self) -> None:
        self._channel.clear()

    def specific_send(self, payload: bytes, timeout: float | None = None) -> None:
        del timeout
        self._channel.send(payload)

    def specific_wait_frame(self, timeout: float | None = None) -> bytes:
        message = self._channel.receive(P2_CLIENT_S if timeout is None else timeout)
        if message is None:
            raise TimeoutException
        return message


class Diagnostics:
    """Services of one module.

    Every method raises `ModuleSilent` if the module does not answer in time, and
    `ModuleRefused` with the response code if it refuses.

    Parameters
    ----------
    bus : BenchBus
    module : Module
        Its address is spoken to; told before a reset, asked after it.
    """

    def __init__(self, bus: BenchBus, module: Module) -> None:
        self._bus = bus
        self._module = module
        self._channel = IsoTpChannel(bus, module.address)
        self._client = Client(
            _TickingConnection(self._channel), config=cast("ClientConfig", _client_config())
        )
        self._client.logger = logging.getLogger(f"compassbench.{__name__}.client")
        self._client.logger.setLevel(logging.CRITICAL)  # refusals are raised, not logged
        self._extended = False
        self._last_tick = bus.tick_count
        self._busy = False
        bus.add_hook(self._keep_alive)

    def read_did(self, identifier: int) -> bytes:
        """Return the data of an identifier (service 22h)."""
        with self._service(f"reading {identifier:04X}h"):
            response: Any = self._client.read_data_by_identifier([identifier])
        return bytes(response.service_data.values[identifier])

    def write_did(self, identifier: int, data: bytes) -> None:
        """Write the data of an identifier (service 2Eh); needs `unlock`."""
        with self._service(f"writing {identifier:04X}h"):
            self._client.write_data_by_identifier(identifier, data)

    def routine(self, identifier: int, data: bytes = b"") -> bytes:
        """Start a routine (service 31h) and return its result; needs `unlock` mostly."""
        with self._service(f"routine {identifier:04X}h"):
            response: Any = self._client.start_routine(identifier, data or None)
        return bytes(response.service_data.routine_status_record)

    def extended_session(self) -> None:
        """Enter the extended session (service 10h) and keep it alive from the tick."""
        with self._service("the extended session"):
            self._client.change_session(uds.SESSION_EXTENDED)
        self._extended = True

    def default_session(self) -> None:
        """Return to the default session, which locks the module."""
        self._extended = False
        with self._service("the default session"):
            self._client.change_session(uds.SESSION_DEFAULT)

    def unlock(self) -> None:
        """Enter the extended session and pass security access (service 27h)."""
        self.extended_session()
        with self._service("security access"):
            response: Any = self._client.request_seed(uds.SECURITY_SEED)
            seed = bytes(response.service_data.seed)
            if any(seed):  # a seed of zeros says that it is unlocked already
                self._client.send_key(uds.SECURITY_KEY, uds.security_key(seed))

    def tester_present(self) -> None:
        """Ask whether the module is there (service 3Eh)."""
        with self._service("tester present"):
            self._client.tester_present()

    def reset(self, timeout_s: float = READY_TIMEOUT_S) -> None:
        """Reset the module (service 11h) and wait until it sends again."""
        with self._service("the reset"):
            self._client.ecu_reset(_HARD_RESET)
        self.recover(timeout_s)

    def recover(self, timeout_s: float = READY_TIMEOUT_S) -> None:
        """Wait until the module sends again after a reset, an interrupted one too."""
        self._channel.clear()
        self._extended = False
        self._module.expect_silence()
        self._module.wait_ready(timeout_s)

    def read_dtcs(self) -> list[tuple[int, int]]:
        """Return trouble codes as (code, status) (service 19h 02h)."""
        with self._service("reading trouble codes"):
            response: Any = self._client.get_dtc_by_status_mask(_ALL_DTCS)
        return [(dtc.id, dtc.status.get_byte_as_int()) for dtc in response.service_data.dtcs]

    def clear_dtcs(self) -> None:
        """Clear all trouble codes (service 14h)."""
        with self._service("clearing trouble codes"):
            self._client.clear_dtc(_ALL_GROUPS)

    def read_identity(self) -> ModuleIdentity:
        """Return serial, part, versions and scales."""
        mag_mg_per_count, accel_g_per_count = self._decoded(uds.DID_SCALES, uds.unpack_scales)
        return ModuleIdentity(
            serial=self._text(uds.DID_SERIAL),
            part=self._text(uds.DID_PART_NUMBER),
            hardware=self._text(uds.DID_HARDWARE_VERSION),
            firmware=self._text(uds.DID_FIRMWARE_VERSION),
            mag_mg_per_count=mag_mg_per_count,
            accel_g_per_count=accel_g_per_count,
            flags=self._module.status.flags,
        )

    def read_temperature_c(self) -> float:
        """Return the module's temperature in deg C."""
        return int.from_bytes(self.read_did(uds.DID_TEMPERATURE), "big", signed=True) * 0.01

    def set_sample_period(self, ticks: int) -> None:
        """Let the module measure every `ticks` ticks of 10 ms (unlocks it)."""
        self.unlock()
        self.write_did(uds.DID_SAMPLE_PERIOD, bytes([ticks]))
        self._module.follow_period(ticks)

    def set_reset_pulse(self, current_ma: int) -> None:
        """Fire one set and one reset pulse of a current in mA (unlocks the module)."""
        self.unlock()
        self.routine(uds.ROUTINE_SET_RESET_PULSE, current_ma.to_bytes(2, "big"))

    def self_test(self) -> bytes:
        """Run the module's self-test and return its result; one byte, 0 is a pass."""
        self.extended_session()
        return self.routine(uds.ROUTINE_SELF_TEST)

    def read_coefficients(self) -> Coefficients:
        """Return the coefficients in use."""
        return self._decoded(uds.DID_COEFFICIENTS, uds.unpack_coefficients)

    def write_coefficients(self, coefficients: Coefficients) -> CoefficientWrite:
        """Write, read back, commit, reset and compare; a failure or an abort rolls back."""
        return CoefficientTransaction(self._bus, self, coefficients).run()

    def _text(self, identifier: int) -> str:
        return self.read_did(identifier).decode("ascii", "replace").strip("\0 ")

    def _decoded(self, identifier: int, unpack: Callable[[bytes], T]) -> T:
        try:
            return unpack(self.read_did(identifier))
        except FrameError as error:
            message = f"module {self._module.address:#04x}, data {identifier:04X}h: {error}"
            raise ModuleRefused(message, 0) from error

    def _keep_alive(self) -> None:
        if (
            self._extended
            and not self._busy
            and self._bus.tick_count - self._last_tick >= _KEEP_ALIVE_TICKS
            and self._channel.idle
        ):
            self._last_tick = self._bus.tick_count
            self._channel.send(_TESTER_PRESENT, answered=False)

    @contextmanager
    def _service(self, what: str) -> Iterator[None]:
        address = f"module {self._module.address:#04x}"
        self._busy = True
        try:
            yield
        except NegativeResponseException as refusal:
            response = refusal.response
            message = f"{address} refused {what}: {response.code_name} ({response.code or 0:02X}h)"
            raise ModuleRefused(message, response.code or 0) from refusal
        except TimeoutException as silence:
            message = f"{address} does not answer {what}: check its supply, plug and address"
            raise ModuleSilent(message) from silence
        except (InvalidResponseException, UnexpectedResponseException, ValueError) as other:
            message = f"{address} answered {what} with something else: {other}"
            raise ModuleRefused(message, 0) from other
        finally:
            self._busy = False
            self._last_tick = self._bus.tick_count


def _client_config() -> dict[str, Any]:
    return {
        "data_identifiers": {"default": _Bytes},
        "request_timeout": None,  # the connection waits on the bus's time, not the machine's
        "p2_timeout": P2_CLIENT_S,
        "p2_star_timeout": P2_STAR_CLIENT_S,
        "use_server_timing": False,
        "tolerate_zero_padding": True,
    }
