"""CANopen object identifiers and expedited SDO (CiA 301)."""

from __future__ import annotations

import struct
from typing import Final, NamedTuple

from protocols.errors import FrameError, SdoAbort

AZIMUTH_NODE: Final = 1
PITCH_NODE: Final = 2
ROLL_NODE: Final = 3
AXIS_NODES: Final = (AZIMUTH_NODE, PITCH_NODE, ROLL_NODE)
BENCH_NODE: Final = 0x7F
"""Node-ID of the bench as a heartbeat producer."""

NMT_ID: Final = 0x000
NMT_START: Final = 0x01
NMT_STOP: Final = 0x02
NMT_PRE_OPERATIONAL: Final = 0x80
NMT_RESET_NODE: Final = 0x81
NMT_RESET_COMMUNICATION: Final = 0x82

STATE_BOOT: Final = 0x00
STATE_STOPPED: Final = 0x04
STATE_OPERATIONAL: Final = 0x05
STATE_PRE_OPERATIONAL: Final = 0x7F

SDO_SENTENCES: Final = {
    0x05030000: "toggle bit not alternated",
    0x05040000: "SDO protocol timed out",
    0x05040001: "command specifier not valid or unknown",
    0x06010000: "unsupported access to an object",
    0x06010001: "attempt to read a write-only object",
    0x06010002: "attempt to write a read-only object",
    0x06020000: "object does not exist in the object dictionary",
    0x06070010: "data type does not match, length of parameter does not match",
    0x06090011: "sub-index does not exist",
    0x06090030: "invalid value for parameter",
    0x08000000: "general error",
    0x08000020: "data cannot be transferred or stored to the application",
    0x08000022: "data cannot be stored because of the present device state",
}

_SDO = struct.Struct("<BHB4s")
_TPDO = struct.Struct("<Hi")
_RPDO = struct.Struct("<Hi")


def nmt_frame(command: int, node_id: int) -> bytes:
    """Return the NMT payload for one node, or for all with node 0."""
    return bytes((command, node_id))


def heartbeat_id(node_id: int) -> int:
    """Return the identifier of a node's heartbeat and boot-up."""
    return 0x700 + node_id


def emergency_id(node_id: int) -> int:
    """Return the identifier of a node's EMCY object."""
    return 0x080 + node_id


def tpdo1_id(node_id: int) -> int:
    """Return the identifier of TPDO1: statusword and actual position."""
    return 0x180 + node_id


def rpdo1_id(node_id: int) -> int:
    """Return the identifier of RPDO1: controlword and target position."""
    return 0x200 + node_id


def sdo_request_id(node_id: int) -> int:
    """Return the identifier of SDO requests to a node."""
    return 0x600 + node_id


def sdo_response_id(node_id: int) -> int:
    """Return the identifier of SDO answers of a node."""
    return 0x580 + node_id


def pack_tpdo1(statusword: int, position: int) -> bytes:
    """Return the payload of TPDO1."""
    return _TPDO.pack(statusword, position)


def unpack_tpdo1(data: bytes) -> tuple[int, int]:
    """Return (statusword, position in counts).

    Raises
    ------
    FrameError
        If the frame has not 6 bytes.
    """
    try:
        return _TPDO.unpack(data)
    except struct.error as error:
        sentence = f"drive status must be {_TPDO.size} bytes; instead received {len(data)}"
        raise FrameError(sentence) from error


def pack_rpdo1(controlword: int, target: int) -> bytes:
    """Return the payload of RPDO1."""
    return _RPDO.pack(controlword, target)


def unpack_rpdo1(data: bytes) -> tuple[int, int]:
    """Return (controlword, target position in counts)."""
    return _RPDO.unpack(data)


class SdoRequest(NamedTuple):
    """An expedited SDO request as the server sees it; `value` is None for an upload."""

    index: int  # type: ignore[assignment]  # the standard's word; tuple.index is not needed
    subindex: int
    value: bytes | None


def _pack_expedited(command: int, index: int, subindex: int, value: bytes) -> bytes:
    if not 1 <= len(value) <= 4:
        sentence = f"expedited SDO value must be 1 to 4 bytes; instead received {len(value)}"
        raise FrameError(sentence)
    return _SDO.pack(command | (4 - len(value)) << 2, index, subindex, value.ljust(4, b"\0"))


def _expedited_length(command: int) -> int:
    """Return the bytes in use; four where the sender does not indicate the size (bit 0)."""
    return 4 - (command >> 2 & 3) if command & 1 else 4


def pack_sdo_upload(index: int, subindex: int) -> bytes:
    """Return the request to read an object."""
    return _SDO.pack(0x40, index, subindex, b"\0\0\0\0")


def pack_sdo_download(index: int, subindex: int, value: bytes) -> bytes:
    """Return the request to write 1 to 4 bytes to an object."""
    return _pack_expedited(0x23, index, subindex, value)


def unpack_sdo_request(data: bytes) -> SdoRequest | None:
    """Return an expedited request, or None for a command that the server does not know."""
    if len(data) != 8:
        return None
    command, index, subindex, raw = _SDO.unpack(data)
    if command == 0x40:
        return SdoRequest(index, subindex, None)
    if command & 0xE2 == 0x22:
        return SdoRequest(index, subindex, raw[: _expedited_length(command)])
    return None


def pack_sdo_uploaded(index: int, subindex: int, value: bytes) -> bytes:
    """Return the answer to an upload."""
    return _pack_expedited(0x43, index, subindex, value)


def pack_sdo_downloaded(index: int, subindex: int) -> bytes:
    """Return the answer to a download."""
    return _SDO.pack(0x60, index, subindex, b"\0\0\0\0")


def pack_sdo_abort(index: int, subindex: int, code: int) -> bytes:
    """Return an abort of either side."""
    return _SDO.pack(0x80, index, subindex, code.to_bytes(4, "little"))


def unpack_sdo_response(node_id: int, data: bytes) -> tuple[int, int, bytes]:
    """Return (index, subindex, value) of a server's answer; the value of a download is empty.

    Raises
    ------
    SdoAbort
        If the server refused.
    FrameError
        If the answer is none of expedited upload, download or abort.
    """
    if len(data) != 8:
        sentence = f"SDO answer of drive {node_id} must be 8 bytes; instead received {len(data)}"
        raise FrameError(sentence)
    command, index, subindex, raw = _SDO.unpack(data)
    if command == 0x80:
        code = int.from_bytes(raw, "little")
        raise SdoAbort(node_id, index, subindex, code, SDO_SENTENCES.get(code, "unknown reason"))
    if command == 0x60:
        return index, subindex, b""
    if command & 0xE2 == 0x42:
        return index, subindex, raw[: _expedited_length(command)]
    sentence = f"SDO answer of drive {node_id} has an unknown command {command:02X}h"
    raise FrameError(sentence)
