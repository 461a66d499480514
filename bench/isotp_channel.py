"""ISO-TP (ISO 15765-2) to one module, timed by the bench's clock.

can-isotp's state machine without its threads; its timers, which read the machine's clock,
are replaced in this instance by timers on the bus's time.
"""

from __future__ import annotations

import logging
from collections import deque
from typing import TYPE_CHECKING, Any, Final

import isotp
from isotp.protocol import TransportLayerLogic
from isotp.tools import Timer

from bench.errors import ModuleSilent
from protocols.frame import EXTENDED
from protocols.j1939 import TESTER_ADDRESS
from protocols.uds import physical_response_id

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.bus import BenchBus
    from protocols.frame import Frame

PADDING: Final = 0xCC
FLOW_CONTROL_TIMEOUT_S: Final = 1.0
"""N_Bs: from a first frame or block to the receiver's flow control."""
CONSECUTIVE_FRAME_TIMEOUT_S: Final = 1.0
"""N_Cr: between two consecutive frames."""
TRANSFER_TIMEOUT_S: Final = 30.0
"""No message takes longer, waits of the receiver included."""

INTERRUPTED_S: Final = 0.2
"""How long the answer to an interrupted request is waited for before the next one."""

logger = logging.getLogger(f"compassbench.{__name__}")

_PARAMETERS: Final[dict[str, Any]] = {
    "tx_padding": PADDING,
    "tx_data_min_length": 8,
    "stmin": 0,
    "blocksize": 0,
    "rx_flowcontrol_timeout": round(FLOW_CONTROL_TIMEOUT_S * 1000.0),
    "rx_consecutive_frame_timeout": round(CONSECUTIVE_FRAME_TIMEOUT_S * 1000.0),
    "logger_name": f"{logger.name}.transport",
}


class ClockTimer(Timer):
    """can-isotp's timer on an injected clock; its methods are those of `isotp.tools.Timer`."""

    def __init__(self, timeout: float, now_ns: Callable[[], int]) -> None:
        super().__init__(timeout)
        self._now_ns = now_ns

    def start(self, timeout: float | None = None) -> None:
        """Start, with another time-out in seconds if given."""
        if timeout is not None:
            self.set_timeout(timeout)
        self.start_time = self._now_ns()

    def elapsed(self) -> float:
        """Return the seconds since the start."""
        return self.elapsed_ns() * 1e-9

    def elapsed_ns(self) -> int:
        """Return the nanoseconds since the start, 0 if stopped."""
        return 0 if self.start_time is None else self._now_ns() - self.start_time


class _TransportOnBusTime(TransportLayerLogic):
    """The state machine with its three timers on the bus's time."""

    def __init__(
        self,
        now_ns: Callable[[], int],
        receive: Callable[[float], isotp.CanMessage | None],
        send: Callable[[isotp.CanMessage], None],
        address: isotp.Address,
        report: Callable[[Exception], None],
    ) -> None:
        self._now_ns = now_ns
        super().__init__(receive, send, address, report, _PARAMETERS)
        self.timer_tx_stmin = ClockTimer(0.0, now_ns)

    def load_params(self) -> None:
        super().load_params()
        self.timer_rx_fc = ClockTimer(FLOW_CONTROL_TIMEOUT_S, self._now_ns)
        self.timer_rx_cf = ClockTimer(CONSECUTIVE_FRAME_TIMEOUT_S, self._now_ns)

    def _start_rx_fc_timer(self) -> None:
        self.timer_rx_fc.start(FLOW_CONTROL_TIMEOUT_S)

    def _start_rx_cf_timer(self) -> None:
        self.timer_rx_cf.start(CONSECUTIVE_FRAME_TIMEOUT_S)


class IsoTpChannel:
    """Sends and receives whole messages; waiting lets the bus tick.

    Parameters
    ----------
    bus : BenchBus
    module_address : int
        Source address of the module; 29-bit normal fixed addressing, tester F1h.
    """

    def __init__(self, bus: BenchBus, module_address: int) -> None:
        self._bus = bus
        self._inbox: deque[isotp.CanMessage] = deque()
        self._error: Exception | None = None
        self._awaiting = False
        self._response_id = physical_response_id(module_address)
        address = isotp.Address(
            isotp.AddressingMode.NormalFixed_29bits,
            source_address=TESTER_ADDRESS,
            target_address=module_address,
        )
        self._transport = _TransportOnBusTime(
            lambda: round(bus.now_s * 1e9), self._next, self._send_frame, address, self._report
        )
        bus.subscribe(self._response_id, self._on_frame)

    @property
    def idle(self) -> bool:
        """Whether no message is being sent or received."""
        transport = self._transport
        return not transport.transmitting() and not self._receiving

    def send(self, payload: bytes, *, answered: bool = True) -> None:
        """Start to send a message; `receive` or `finish` carries on with it.

        Parameters
        ----------
        payload : bytes
        answered : bool
            Whether the module is to answer it.
        """
        self._error = None
        self._awaiting = answered
        self._transport.send(payload)
        self._transport.process()

    def finish(self) -> None:
        """Tick until the message has left.

        Raises
        ------
        ModuleSilent
            If the module does not take it.
        """
        deadline_s = self._bus.now_s + TRANSFER_TIMEOUT_S
        while self._transport.transmitting():
            self._advance(deadline_s)

    def receive(self, timeout_s: float) -> bytes | None:
        """Tick until a message is there; None when none has begun within `timeout_s`.

        Raises
        ------
        ModuleSilent
            If a message breaks off.
        """
        self.finish()
        start_s = self._bus.now_s
        while not self._transport.available():
            if self._bus.now_s - start_s >= timeout_s and not self._receiving:
                self._awaiting = False
                return None
            self._advance(start_s + timeout_s + TRANSFER_TIMEOUT_S)
        self._awaiting = False
        message = self._transport.recv()
        return None if message is None else bytes(message)

    def clear(self) -> None:
        """Forget what was received and not read.

        An exchange that was interrupted, by an abort for instance, is first carried to its
        end: else the next request would be given its answer.
        """
        if self._awaiting:
            try:
                self.receive(INTERRUPTED_S)
            except ModuleSilent as error:
                logger.info("an interrupted exchange is given up: %s", error)
        self._inbox.clear()
        while self._transport.available():
            self._transport.recv()

    def close(self) -> None:
        """Stop listening."""
        self._bus.unsubscribe(self._response_id, self._on_frame)

    @property
    def _receiving(self) -> bool:
        return bool(self._transport.rx_state != TransportLayerLogic.RxState.IDLE)

    def _advance(self, deadline_s: float) -> None:
        self._bus.tick()
        self._transport.process()
        if self._error is None and self._bus.now_s > deadline_s:
            self._error = isotp.IsoTpError("it took too long")
        if self._error is not None:
            error, self._error = self._error, None
            self._awaiting = False
            self._transport.reset()
            message = f"the module broke off a diagnostic message: {error}"
            raise ModuleSilent(message)

    def _next(self, timeout_s: float) -> isotp.CanMessage | None:
        del timeout_s  # never waits: the bus does
        return self._inbox.popleft() if self._inbox else None

    def _send_frame(self, message: isotp.CanMessage) -> None:
        self._bus.send(message.arbitration_id | EXTENDED, bytes(message.data))

    def _on_frame(self, frame: Frame) -> None:
        self._inbox.append(
            isotp.CanMessage(
                arbitration_id=frame.can_id & ~EXTENDED,
                data=frame.data,
                dlc=len(frame.data),
                extended_id=True,
            )
        )

    def _report(self, error: Exception) -> None:
        self._error = error
