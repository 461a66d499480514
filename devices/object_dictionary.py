"""A CANopen node's object dictionary and its expedited SDO server (CiA 301, 7.2.4)."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final, NamedTuple

from protocols.canopen import (
    pack_sdo_abort,
    pack_sdo_downloaded,
    pack_sdo_uploaded,
    unpack_sdo_request,
)

if TYPE_CHECKING:
    from collections.abc import Callable

ABORT_COMMAND: Final = 0x05040001
ABORT_WRITE_ONLY: Final = 0x06010001
ABORT_READ_ONLY: Final = 0x06010002
ABORT_NO_OBJECT: Final = 0x06020000
ABORT_LENGTH: Final = 0x06070010
ABORT_NO_SUBINDEX: Final = 0x06090011
ABORT_VALUE: Final = 0x06090030
ABORT_STATE: Final = 0x08000022

_CODES: Final = {"u8": "<B", "i8": "<b", "u16": "<H", "i16": "<h", "u32": "<I", "i32": "<i"}


class SdoRefused(Exception):  # noqa: N818  # CiA 301 calls it an abort, not an error
    """Raised by the writer of an object; `code` is the SDO abort code to answer."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort {code:08X}h")
        self.code = code


class Entry(NamedTuple):
    """One object; without `read` it is write-only, without `write` read-only."""

    layout: struct.Struct
    read: Callable[[], int] | None
    write: Callable[[int], None] | None


class ObjectDictionary:
    """Objects by index and subindex, and the answers of the SDO server that owns them."""

    def __init__(self) -> None:
        self._entries: dict[tuple[int, int], Entry] = {}
        self._indices: set[int] = set()

    def add(
        self,
        index: int,
        subindex: int,
        kind: str,
        read: Callable[[], int] | None,
        write: Callable[[int], None] | None = None,
    ) -> None:
        """Add an object of `kind` u8, i8, u16, i16, u32 or i32."""
        self._entries[index, subindex] = Entry(struct.Struct(_CODES[kind]), read, write)
        self._indices.add(index)

    def constant(self, index: int, subindex: int, kind: str, value: int) -> None:
        """Add a read-only object that never changes."""
        self.add(index, subindex, kind, lambda: value)

    def keys(self) -> tuple[tuple[int, int], ...]:
        """Return all (index, subindex) in ascending order."""
        return tuple(sorted(self._entries))

    def answer(self, data: bytes) -> bytes:
        """Return the payload that answers one SDO request of a client."""
        request = unpack_sdo_request(data)
        if request is None:
            padded = data.ljust(4, b"\0")
            return pack_sdo_abort(padded[1] | padded[2] << 8, padded[3], ABORT_COMMAND)
        index, subindex, value = request
        try:
            entry = self._find(index, subindex)
            if value is None:
                return pack_sdo_uploaded(index, subindex, self._read(entry))
            self._write(entry, value)
        except SdoRefused as refusal:
            return pack_sdo_abort(index, subindex, refusal.code)
        return pack_sdo_downloaded(index, subindex)

    def _find(self, index: int, subindex: int) -> Entry:
        entry = self._entries.get((index, subindex))
        if entry is None:
            raise SdoRefused(ABORT_NO_SUBINDEX if index in self._indices else ABORT_NO_OBJECT)
        return entry

    def _read(self, entry: Entry) -> bytes:
        if entry.read is None:
            raise SdoRefused(ABORT_WRITE_ONLY)
        return entry.layout.pack(entry.read())

    def _write(self, entry: Entry, value: bytes) -> None:
        if entry.write is None:
            raise SdoRefused(ABORT_READ_ONLY)
        if len(value) != entry.layout.size:
            raise SdoRefused(ABORT_LENGTH)
        entry.write(entry.layout.unpack(value)[0])
