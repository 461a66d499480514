"""ISO 15765-2 transport of one pair of identifiers, driven by the time that it is given.

```
single       0|length   data 1..7
first        1|length (12 bits)   data 6
consecutive  2|sequence           data 1..7
flow control 3|status   block size   STmin       status 0 go on, 1 wait, 2 overflow
```
Classic CAN with normal addressing; every frame is filled up to eight bytes with CCh.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable

PADDING: Final = 0xCC
N_BS_S: Final = 1.0
"""Longest wait for flow control (clause 9.8, table 16)."""
N_CR_S: Final = 1.0
"""Longest wait for the next consecutive frame."""
MAX_LENGTH: Final = 4095
MAX_WAIT_FRAMES: Final = 10
"""N_WFTmax: so many flow control frames may ask for patience."""

_SINGLE: Final = 0
_FIRST: Final = 1
_CONSECUTIVE: Final = 2
_FLOW: Final = 3
_GO_ON: Final = 0
_WAIT: Final = 1
_OVERFLOW: Final = 2
_NS_PER_S: Final = 1_000_000_000


def separation_ns(st_min: int) -> int:
    """Return the least gap between consecutive frames that an STmin byte asks for.

    Reserved values mean the longest gap, 127 ms (clause 9.6.5.5).

    >>> separation_ns(0x14), separation_ns(0xF3), separation_ns(0x80)
    (20000000, 300000, 127000000)
    """
    if st_min <= 0x7F:
        return st_min * 1_000_000
    if 0xF1 <= st_min <= 0xF9:
        return (st_min - 0xF0) * 100_000
    return 127_000_000


class IsoTpServer:
    """Sends and receives messages of up to 4095 bytes in frames of eight.

    Parameters
    ----------
    send : callable
        Takes the payload of one CAN frame.
    block_size : int
        Consecutive frames that the peer may send before it waits; 0 for all.
    st_min : int
        STmin byte asked of the peer.
    capacity : int
        Longest message that is accepted, in bytes.

    Attributes
    ----------
    aborted : list of str
        Transfers that failed, in words, the latest last; at most 16.
    """

    def __init__(
        self,
        send: Callable[[bytes], None],
        *,
        block_size: int = 8,
        st_min: int = 0,
        capacity: int = 512,
    ) -> None:
        self._send = send
        self._flow = bytes((_FLOW << 4 | _GO_ON, block_size, st_min))
        self._block_size = block_size
        self._capacity = min(capacity, MAX_LENGTH)
        self.aborted: list[str] = []
        self.reset()

    def reset(self) -> None:
        """Forget every transfer under way."""
        self._incoming: bytearray | None = None
        self._outgoing: bytes | None = None
        self._waiting_for_flow = False

    @property
    def sending(self) -> bool:
        """Whether a message is still leaving."""
        return self._outgoing is not None

    @property
    def idle(self) -> bool:
        """Whether `poll` has nothing to do."""
        return self._outgoing is None and self._incoming is None

    def transmit(self, t_ns: int, payload: bytes) -> None:
        """Start to send a message of 1 to 4095 bytes; one under way is dropped."""
        if len(payload) <= 7:
            self._outgoing = None
            self._emit(bytes((len(payload),)) + payload)
            return
        self._outgoing = payload
        self._offset = 6
        self._sequence = 1
        self._wait_frames = 0
        self._waiting_for_flow = True
        self._deadline_ns = t_ns + int(N_BS_S * _NS_PER_S)
        self._emit(bytes((_FIRST << 4 | len(payload) >> 8, len(payload) & 0xFF)) + payload[:6])

    def receive(self, t_ns: int, data: bytes) -> bytes | None:
        """Take one frame; return the message that it completes, if it does."""
        if not data:
            return None
        kind = data[0] >> 4
        if kind == _SINGLE:
            return self._take_single(data)
        if kind == _FIRST:
            self._take_first(t_ns, data)
        elif kind == _CONSECUTIVE:
            return self._take_consecutive(t_ns, data)
        elif kind == _FLOW:
            self._take_flow(t_ns, data)
        return None

    def poll(self, t_ns: int) -> None:
        """Send what is due and give up what has waited too long."""
        if self._incoming is not None and t_ns > self._gap_ns:
            self._incoming = None
            self._abort(f"no consecutive frame within {N_CR_S} s")
        if self._outgoing is None:
            return
        if self._waiting_for_flow:
            if t_ns > self._deadline_ns:
                self._outgoing = None
                self._abort(f"no flow control within {N_BS_S} s")
            return
        while t_ns >= self._next_ns and self._send_consecutive(t_ns, self._outgoing):
            pass

    def _emit(self, data: bytes) -> None:
        self._send(data.ljust(8, bytes((PADDING,))))

    def _abort(self, reason: str) -> None:
        self.aborted.append(reason)
        del self.aborted[:-16]

    def _take_single(self, data: bytes) -> bytes | None:
        length = data[0] & 0x0F
        if not 1 <= length <= len(data) - 1:
            return None
        if self._incoming is not None:
            self._incoming = None
            self._abort("a new message began before the last was complete")
        return data[1 : 1 + length]

    def _take_first(self, t_ns: int, data: bytes) -> None:
        length = (data[0] & 0x0F) << 8 | data[1] if len(data) == 8 else 1
        if 0 < length < 8:
            return
        if self._incoming is not None:
            self._abort("a new message began before the last was complete")
        self._incoming = None
        if length == 0 or length > self._capacity:
            self._abort(f"message is longer than {self._capacity} bytes")
            self._emit(bytes((_FLOW << 4 | _OVERFLOW, 0, 0)))
            return
        self._incoming = bytearray(data[2:8])
        self._expected = length
        self._next_sequence = 1
        self._in_block = 0
        self._gap_ns = t_ns + int(N_CR_S * _NS_PER_S)
        self._emit(self._flow)

    def _take_consecutive(self, t_ns: int, data: bytes) -> bytes | None:
        message = self._incoming
        if message is None:
            return None
        if data[0] & 0x0F != self._next_sequence:
            self._incoming = None
            self._abort(f"sequence {data[0] & 0x0F} where {self._next_sequence} was due")
            return None
        left = self._expected - len(message)
        if len(data) - 1 < min(left, 7):
            self._incoming = None
            self._abort("a consecutive frame was too short")
            return None
        message += data[1 : 1 + min(left, 7)]
        self._next_sequence = self._next_sequence + 1 & 0x0F
        self._gap_ns = t_ns + int(N_CR_S * _NS_PER_S)
        if len(message) == self._expected:
            self._incoming = None
            return bytes(message)
        self._in_block += 1
        if self._in_block == self._block_size:
            self._in_block = 0
            self._emit(self._flow)
        return None

    def _take_flow(self, t_ns: int, data: bytes) -> None:
        if self._outgoing is None or not self._waiting_for_flow or len(data) < 3:
            return
        status = data[0] & 0x0F
        if status == _WAIT and self._wait_frames < MAX_WAIT_FRAMES:
            self._wait_frames += 1
            self._deadline_ns = t_ns + int(N_BS_S * _NS_PER_S)
        elif status == _GO_ON:
            self._wait_frames = 0
            self._waiting_for_flow = False
            self._block_left = data[1] or math.inf
            self._separation_ns = separation_ns(data[2])
            self._next_ns = t_ns
        else:
            self._outgoing = None
            reasons = {_WAIT: "the receiver asked to wait too often", _OVERFLOW: "overflow"}
            self._abort(reasons.get(status, "invalid flow status"))

    def _send_consecutive(self, t_ns: int, payload: bytes) -> bool:
        """Send one frame; return whether another may follow without flow control."""
        part = payload[self._offset : self._offset + 7]
        self._emit(bytes((_CONSECUTIVE << 4 | self._sequence,)) + part)
        self._offset += 7
        self._sequence = self._sequence + 1 & 0x0F
        self._next_ns = t_ns + self._separation_ns
        self._block_left -= 1
        if self._offset >= len(payload):
            self._outgoing = None
            return False
        if self._block_left == 0:
            self._waiting_for_flow = True
            self._deadline_ns = t_ns + int(N_BS_S * _NS_PER_S)
            return False
        return True
