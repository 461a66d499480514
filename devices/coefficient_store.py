r"""The module's non-volatile memory: two banks of coefficients and a marker, kept twice.

```
offset 0    magic "CBNVM02\0"
       8    marker A    sequence u32 | active u8 | staged u8 | boots u16 | CRC-32
      20    marker B    the same; the valid one with the higher sequence counts
      32    bank 0      protocols.uds.pack_coefficients, with its own CRC-32, then zeros
     156    bank 1
```
A write never touches the bank or the marker in use: it fills the other bank, or the other
marker. So an image of which only a part was written still holds the old coefficients or
the new ones, and a file is besides replaced whole (written aside, flushed, renamed).

An image of the former layout ("CBNVM01\0", places for banks without cross-axis terms) is read as it
is; the first write after that replaces it whole by one of the present layout.
"""

from __future__ import annotations

import logging
import os
import struct
import zlib
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from protocols.errors import FrameError
from protocols.uds import (
    BANK_LENGTH,
    DEFAULT_COEFFICIENTS,
    PLAIN_BANK_LENGTH,
    bank_in,
    unpack_coefficients,
)

if TYPE_CHECKING:
    from pathlib import Path

    from protocols.uds import Coefficients

MAGIC: Final = b"CBNVM02\0"
FORMER_MAGIC: Final = b"CBNVM01\0"
NO_BANK: Final = 0xFF
"""Active bank of a module that was never calibrated."""

_MARKER = struct.Struct("<IBBH")
_MARKER_LENGTH: Final = _MARKER.size + 4
_MARKERS: Final = (len(MAGIC), len(MAGIC) + _MARKER_LENGTH)
_BANKS_BEGIN: Final = len(MAGIC) + 2 * _MARKER_LENGTH
_BANKS: Final = (_BANKS_BEGIN, _BANKS_BEGIN + BANK_LENGTH)
IMAGE_LENGTH: Final = _BANKS[1] + BANK_LENGTH
FORMER_IMAGE_LENGTH: Final = _BANKS_BEGIN + 2 * PLAIN_BANK_LENGTH

logger = logging.getLogger(f"compassbench.{__name__}")


class Marker(NamedTuple):
    """What the marker says: bank in use, whether the other holds a staged set, boots."""

    sequence: int
    active: int
    staged: int
    boots: int


class Medium(Protocol):
    """Where the image is kept."""

    def read(self) -> bytes:
        """Return what is stored; empty if nothing was ever."""
        ...

    def write(self, image: bytes, changed: slice) -> None:
        """Store an image of which only `changed` differs from what is stored."""
        ...


class MemoryMedium:
    """An image in this process's memory."""

    def __init__(self, image: bytes = b"") -> None:
        self._image = image

    def read(self) -> bytes:
        """Return the image."""
        return self._image

    def write(self, image: bytes, changed: slice) -> None:
        """Keep the image."""
        del changed
        self._image = image


class FileMedium:
    """An image in a file that is only ever replaced whole."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> bytes:
        """Return the file's content, empty if there is no file."""
        try:
            return self._path.read_bytes()
        except FileNotFoundError:
            return b""

    def write(self, image: bytes, changed: slice) -> None:
        """Replace the file: what a kill leaves behind is the old one or the new."""
        del changed
        aside = self._path.with_name(self._path.name + ".new")
        with aside.open("wb") as file:
            file.write(image)
            file.flush()
            os.fsync(file.fileno())
        aside.replace(self._path)
        folder = os.open(self._path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


class CoefficientStore:
    """Banks and marker of one module.

    Attributes
    ----------
    active : Coefficients
        What the last `boot` found; the default set if there was nothing sound.
    calibrated : bool
        Whether `active` came from a bank and is not the default set.
    lost : bool
        Whether a bank or an image was stored and is not sound.

    Raises
    ------
    OSError
        From `boot` and every write, if the medium refuses.
    """

    def __init__(self, path: Path | None = None, *, medium: Medium | None = None) -> None:
        if medium is None:
            medium = MemoryMedium() if path is None else FileMedium(path)
        self._medium = medium
        self._load()

    @property
    def boots(self) -> int:
        """Boots that the medium has seen, modulo 65536."""
        return self._marker.boots

    @property
    def committed(self) -> bool:
        """Whether a commit waits for the next boot."""
        return self._marker.active != self._running

    def boot(self) -> None:
        """Read the medium afresh, as after power-on, and count the boot."""
        self._load()
        self._mark(self._marker._replace(boots=self._marker.boots + 1 & 0xFFFF))

    def staged(self) -> bytes | None:
        """Return the staged bank, or None."""
        if not self._marker.staged or self.committed:
            return None
        return self._bank(self._other())

    def stage(self, bank: bytes) -> None:
        """Write a bank beside the one in use.

        Raises
        ------
        FrameError
            If the bank's length or CRC-32 is wrong; nothing is written then.
        RuntimeError
            If a commit waits for the next boot.
        """
        unpack_coefficients(bank)
        if self.committed:
            message = "a committed bank waits for the next boot; reset the module or roll back"
            raise RuntimeError(message)
        if self._marker.staged:
            self._mark(self._marker._replace(staged=0))
        start = _BANKS[self._other()]
        self._put(start, bank.ljust(BANK_LENGTH, b"\0"))
        self._mark(self._marker._replace(staged=1))

    def commit(self) -> bool:
        """Make the staged bank the one of the next boot; False if there is none."""
        if self.staged() is None:
            return False
        self._mark(self._marker._replace(active=self._other(), staged=0))
        return True

    def rollback(self) -> None:
        """Drop the staged bank and undo a commit that no boot has followed."""
        if self._marker.staged or self.committed:
            self._mark(self._marker._replace(active=self._running, staged=0))

    def _other(self) -> int:
        return 1 if self._marker.active == 0 else 0

    def _bank(self, number: int) -> bytes:
        return bank_in(self._image[_BANKS[number] : _BANKS[number] + BANK_LENGTH])

    def _load(self) -> None:
        image = self._medium.read()
        self.lost = False
        self._former = image.startswith(FORMER_MAGIC)
        marker = _newest_marker(image)
        if self._former and marker is not None:
            image = _of_present_layout(image)
        if marker is None:
            self.lost = bool(image)
            marker = Marker(0, NO_BANK, 0, 0)
            image = MAGIC + bytes(IMAGE_LENGTH - len(MAGIC))
        self._image = image
        self._marker = marker
        self.active = DEFAULT_COEFFICIENTS
        self.calibrated = False
        if marker.active != NO_BANK:
            self._use(marker.active)
        if marker.staged and _sound(self._bank(self._other())) is None:
            self._marker = self._marker._replace(staged=0)
        self._running = self._marker.active

    def _use(self, number: int) -> None:
        coefficients = _sound(self._bank(number))
        if coefficients is None:
            logger.warning("bank %d of the coefficients is not sound; using the defaults", number)
            self.lost = True
            self._marker = self._marker._replace(active=NO_BANK)
            return
        self.active = coefficients
        self.calibrated = coefficients != DEFAULT_COEFFICIENTS

    def _mark(self, marker: Marker) -> None:
        marker = marker._replace(sequence=self._marker.sequence + 1 & 0xFFFFFFFF)
        body = _MARKER.pack(*marker)
        record = body + zlib.crc32(MAGIC + body).to_bytes(4, "little")
        self._put(_MARKERS[marker.sequence & 1], record)
        self._marker = marker

    def _put(self, start: int, data: bytes) -> None:
        changed = slice(start, start + len(data))
        image = self._image[:start] + data + self._image[changed.stop :]
        self._medium.write(image, slice(0, len(image)) if self._former else changed)
        self._image = image
        self._former = False


def _newest_marker(image: bytes) -> Marker | None:
    magic = image[: len(MAGIC)]
    lengths = {MAGIC: IMAGE_LENGTH, FORMER_MAGIC: FORMER_IMAGE_LENGTH}
    if len(image) != lengths.get(magic):
        return None
    markers = []
    for start in _MARKERS:
        body = image[start : start + _MARKER.size]
        crc = image[start + _MARKER.size : start + _MARKER_LENGTH]
        if zlib.crc32(magic + body).to_bytes(4, "little") == crc:
            marker = Marker(*_MARKER.unpack(body))
            if marker.active in (0, 1, NO_BANK):
                markers.append(marker)
    return max(markers, default=None)


def _of_present_layout(image: bytes) -> bytes:
    """Return an image of the former layout in the present one; a broken marker becomes zeros."""
    head = MAGIC
    for start in _MARKERS:
        body = image[start : start + _MARKER.size]
        crc = image[start + _MARKER.size : start + _MARKER_LENGTH]
        sound = zlib.crc32(FORMER_MAGIC + body).to_bytes(4, "little") == crc
        renewed = body + zlib.crc32(MAGIC + body).to_bytes(4, "little")
        head += renewed if sound else bytes(_MARKER_LENGTH)
    second = _BANKS_BEGIN + PLAIN_BANK_LENGTH
    banks = (image[_BANKS_BEGIN:second], image[second:])
    return head + b"".join(bank.ljust(BANK_LENGTH, b"\0") for bank in banks)


def _sound(bank: bytes) -> Coefficients | None:
    try:
        return unpack_coefficients(bank)
    except FrameError:
        return None
