"""Every frame of a run, written as it happens to a BLF file.

Vector's tools, python-can and tshark read it. The format is that of python-can's writer
(objects of type CAN_MESSAGE in zlib-compressed containers), built here from whole blocks: an
object is one row of a structured array.
"""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from typing import TYPE_CHECKING, Final, Self

import numpy as np

from bench.errors import BenchNotReady

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

    from numpy.typing import NDArray

_FILE_HEADER: Final = struct.Struct("<4sLBBBBBBBBQQLL8H8H")
_FILE_HEADER_LENGTH: Final = 144
_OBJECT_HEADER: Final = struct.Struct("<4sHHLL")
_CONTAINER_HEADER: Final = struct.Struct("<H6xL4x")
_LOG_CONTAINER: Final = 10
_CAN_MESSAGE: Final = 1
_NANOSECONDS: Final = 2
_ZLIB: Final = 2
_COMPRESSION_LEVEL: Final = 1  # a tenth of the time of level 9, a fifth more bytes
_CONTAINER_OBJECTS: Final = 2730  # 128 KiB, the most that readers are used to
_SENT_FLAG: Final = 1

_OBJECT: Final = np.dtype(
    [
        ("signature", "S4"),
        ("header_size", "<u2"),
        ("header_version", "<u2"),
        ("object_size", "<u4"),
        ("object_type", "<u4"),
        ("flags", "<u4"),
        ("client", "<u2"),
        ("version", "<u2"),
        ("t_ns", "<u8"),
        ("channel", "<u2"),
        ("message_flags", "u1"),
        ("length", "u1"),
        ("can_id", "<u4"),
        ("data", "u1", 8),
    ]
)


class Capture:
    """Writes blocks of frames to a BLF file; a `FrameSink`.

    Parameters
    ----------
    path : Path
        The file, made anew.
    start_ns : int
        Time of the bench's clock that becomes zero in the file.
    started : datetime, optional
        Date and time (UTC) of zero; left open where two runs are to give the same bytes.

    Raises
    ------
    BenchNotReady
        If the file cannot be written.
    """

    def __init__(self, path: Path, *, start_ns: int = 0, started: datetime | None = None) -> None:
        self.path: Final = path
        self._start_ns = start_ns
        self._started = started
        self._objects = 0
        self._uncompressed = _FILE_HEADER_LENGTH
        self._rows = _empty_rows()
        try:
            self._file = path.open("wb")
        except OSError as error:
            message = f"capture {path} cannot be written: {error.strerror}; choose another folder"
            raise BenchNotReady(message) from error
        self._write_header()

    def __call__(self, frames: NDArray[np.void]) -> None:
        """Write a block, ndarray of FRAME, shape (n,).

        Raises
        ------
        BenchNotReady
            If the disk does not take it.
        """
        try:
            for first in range(0, len(frames), _CONTAINER_OBJECTS):
                self._write_container(frames[first : first + _CONTAINER_OBJECTS])
        except OSError as error:
            message = f"capture {self.path} cannot be written: {error.strerror}; free the disk"
            raise BenchNotReady(message) from error

    def close(self) -> None:
        """Complete the header; may be called twice.

        Raises
        ------
        BenchNotReady
            If the disk does not take the rest.
        """
        if self._file.closed:
            return
        try:
            self._file.seek(0)
            self._write_header()
            self._file.close()
        except OSError as error:
            with suppress(OSError):  # closes it, and says once more that the disk is full
                self._file.close()
            message = f"capture {self.path} cannot be completed: {error.strerror}; free the disk"
            raise BenchNotReady(message) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write_container(self, frames: NDArray[np.void]) -> None:
        objects = self._rows[: len(frames)]
        objects["t_ns"] = np.maximum(frames["t_ns"] - self._start_ns, 0)
        objects["message_flags"] = np.where(frames["sent"], _SENT_FLAG, 0)
        objects["length"] = frames["length"]
        objects["can_id"] = frames["can_id"]
        objects["data"] = frames["data"]
        plain = objects.tobytes()
        packed = zlib.compress(plain, _COMPRESSION_LEVEL)
        size = _OBJECT_HEADER.size + _CONTAINER_HEADER.size + len(packed)
        self._file.write(_OBJECT_HEADER.pack(b"LOBJ", 16, 1, size, _LOG_CONTAINER))
        self._file.write(_CONTAINER_HEADER.pack(_ZLIB, len(plain)))
        self._file.write(packed)
        self._file.write(bytes(size % 4))  # as Vector's own files are padded
        self._uncompressed += _OBJECT_HEADER.size + _CONTAINER_HEADER.size + len(plain)
        self._objects += len(frames)

    def _write_header(self) -> None:
        started = _system_time(self._started)
        size = max(self._file.seek(0, 2), _FILE_HEADER_LENGTH)
        self._file.seek(0)
        header = _FILE_HEADER.pack(
            b"LOGG", _FILE_HEADER_LENGTH, 5, 0, 0, 0, 2, 6, 8, 1,
            size, self._uncompressed, self._objects, 0, *started, *started,
        )  # fmt: skip
        self._file.write(header.ljust(_FILE_HEADER_LENGTH, b"\0"))


def _empty_rows() -> NDArray[np.void]:
    rows = np.zeros(_CONTAINER_OBJECTS, dtype=_OBJECT)
    rows["signature"] = b"LOBJ"
    rows["header_size"] = 32
    rows["header_version"] = 1
    rows["object_size"] = _OBJECT.itemsize
    rows["object_type"] = _CAN_MESSAGE
    rows["flags"] = _NANOSECONDS
    rows["channel"] = 1
    return rows


def _system_time(moment: datetime | None) -> tuple[int, ...]:
    if moment is None:
        return (0,) * 8
    return (
        moment.year,
        moment.month,
        moment.isoweekday() % 7,
        moment.day,
        moment.hour,
        moment.minute,
        moment.second,
        moment.microsecond // 1000,
    )
