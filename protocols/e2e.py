"""End-to-end protection: AUTOSAR E2E profile 1, variant 1A (AUTOSAR_PRS_E2EProtocol, 6.3).

CRC-8 with polynomial 0x1D, initial value 0 and no final XOR over the two bytes of the
data ID (low byte first) and then over the frame's bytes behind the CRC byte.
The four-bit counter runs 0..14.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

COUNTER_MODULUS: Final = 15
MAX_DELTA_COUNTER: Final = 5
"""Up to this step of the counter a gap is accepted as OK_SOME_LOST."""


def _crc8_table() -> bytes:
    table = bytearray(256)
    for value in range(256):
        crc = value
        for _ in range(8):
            crc = (crc << 1) ^ 0x1D if crc & 0x80 else crc << 1
        table[value] = crc & 0xFF
    return bytes(table)


_TABLE: Final = _crc8_table()


class E2eState(Enum):
    """What the receiver knows after one cycle (AUTOSAR E2E profile 1 check states)."""

    OK = "ok"
    OK_SOME_LOST = "ok_some_lost"
    REPEATED = "repeated"
    WRONG_SEQUENCE = "wrong_sequence"
    ERROR = "error"
    NOT_AVAILABLE = "not_available"

    @property
    def usable(self) -> bool:
        """Whether the data of the frame may be used."""
        return self in {E2eState.OK, E2eState.OK_SOME_LOST}


def data_id_seed(data_id: int) -> int:
    """Return the CRC register after the two bytes of the data ID."""
    return _TABLE[_TABLE[data_id & 0xFF] ^ (data_id >> 8 & 0xFF)]


def crc8(seed: int, payload: bytes) -> int:
    """Return the CRC-8 of the bytes behind the CRC byte, from `data_id_seed`."""
    table = _TABLE
    crc = seed
    for byte in payload:
        crc = table[crc ^ byte]
    return crc


class E2eReceiver:
    """Checks CRC and counter of one protected frame, and counts what was lost.

    Attributes
    ----------
    lost : int
        Frames that the counter shows to be missing since the start.
    errors : int
        Frames whose CRC was wrong.
    """

    def __init__(self, data_id: int) -> None:
        self._seed = data_id_seed(data_id)
        self._counter: int | None = None
        self.lost = 0
        self.errors = 0
        self.repeated = 0
        self.wrong_sequence = 0

    def check(self, data: bytes) -> E2eState:
        """Return the state that one received frame of 8 bytes leads to."""
        if len(data) != 8 or crc8(self._seed, data[1:]) != data[0]:
            self.errors += 1
            return E2eState.ERROR
        counter = data[1] & 0x0F
        last, self._counter = self._counter, counter
        if last is None:
            return E2eState.OK
        delta = (counter - last) % COUNTER_MODULUS
        if delta == 1:
            return E2eState.OK
        if delta == 0:
            self.repeated += 1
            return E2eState.REPEATED
        self.lost += delta - 1
        if delta <= MAX_DELTA_COUNTER:
            return E2eState.OK_SOME_LOST
        self.wrong_sequence += 1
        return E2eState.WRONG_SEQUENCE

    def restart(self) -> None:
        """Forget the counter, as after a reset of the sender that the bench asked for."""
        self._counter = None


class E2eSender:
    """Builds protected frames of one data ID."""

    def __init__(self, data_id: int) -> None:
        self._seed = data_id_seed(data_id)
        self._counter = 0

    def protect(self, group: int, payload: bytes) -> bytes:
        """Return CRC, counter and group in front of six bytes of payload."""
        counter = self._counter
        self._counter = counter + 1 if counter < COUNTER_MODULUS - 1 else 0
        tail = bytes((counter | group << 4,)) + payload
        return bytes((crc8(self._seed, tail),)) + tail
