"""What may go wrong on a channel without an exception: faults that a link counts.

SocketCAN reports the controller's state in error frames (Linux kernel,
include/uapi/linux/can/error.h): the class of error is in the identifier, the controller's
state in data byte 1.
"""

from __future__ import annotations

import logging
from collections import Counter
from enum import StrEnum
from typing import Final

logger = logging.getLogger(f"compassbench.{__name__}")

_CLASS_CONTROLLER: Final = 0x004
_CLASS_BUS_OFF: Final = 0x040
_CONTROLLER_OVERFLOW: Final = 0x03  # receive or transmit
_CONTROLLER_WARNING: Final = 0x0C
_CONTROLLER_PASSIVE: Final = 0x30
_CONTROLLER_ACTIVE: Final = 0x40


class LinkFault(StrEnum):
    """One kind of fault of a channel."""

    BUS_OFF = "bus_off"
    """The controller has left the bus; nothing is sent or received until it is restarted."""
    ERROR_PASSIVE = "error_passive"
    """More than 127 errors counted: wiring, termination, bitrate or a lone node."""
    ERROR_WARNING = "error_warning"
    """More than 95 errors counted."""
    CONTROLLER_OVERFLOW = "controller_overflow"
    """The adapter's own buffer was full; frames are lost."""
    BUS_ERROR = "bus_error"
    """An error frame of any other kind: bit, stuff, form, CRC or acknowledgement."""
    RECEIVE_DROPPED = "receive_dropped"
    """The kernel's receive buffer was full; frames are lost."""
    SEND_BLOCKED = "send_blocked"
    """The transmit queue was full; the frame was tried again until the deadline."""


def error_frame_fault(can_id: int, data: bytes) -> LinkFault | None:
    """Return the fault that an error frame reports, None for a return to the active state.

    Parameters
    ----------
    can_id : int
        Error class, the low 29 bits of the frame's identifier.
    data : bytes
        The frame's data; byte 1 is the state of the controller.
    """
    if can_id & _CLASS_BUS_OFF:
        return LinkFault.BUS_OFF
    if not can_id & _CLASS_CONTROLLER:
        return LinkFault.BUS_ERROR
    state = data[1] if len(data) > 1 else 0
    if state & _CONTROLLER_OVERFLOW:
        return LinkFault.CONTROLLER_OVERFLOW
    if state & _CONTROLLER_PASSIVE:
        return LinkFault.ERROR_PASSIVE
    if state & _CONTROLLER_WARNING:
        return LinkFault.ERROR_WARNING
    return None if state & _CONTROLLER_ACTIVE else LinkFault.BUS_ERROR


class FaultCounter:
    """Counts faults by kind and logs the first of each.

    Attributes
    ----------
    kinds : list of str
        Each kind once, in the order in which they first appeared.
    counts : Counter
        Occurrences by kind; for RECEIVE_DROPPED the number of frames.
    """

    def __init__(self, channel: str) -> None:
        self._channel = channel
        self.kinds: list[str] = []
        self.counts: Counter[LinkFault] = Counter()

    def add(self, fault: LinkFault, count: int = 1) -> None:
        """Count a fault `count` times."""
        if fault not in self.counts:
            self.kinds.append(fault)
            logger.warning("channel %s reports %s", self._channel, fault.value)
        self.counts[fault] += count
