"""One row a measuring cycle, kept on disk as it is measured: samples.parquet.

A row is packed as raw counts and converted with thousands of others at once, because
scaling each by itself costs ten times as much.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, Final, Protocol, Self

import numpy as np

from bench.pairing import PAIRED_WITHIN_NS
from bench.reference import NO_COUNTS, field_mg_of
from bench.sample_file import SampleFile, read_metadata, read_samples
from bench.samples import MOVING, SAMPLE
from protocols.compass import (
    HEADING_DEG_PER_COUNT,
    PITCH_DEG_PER_COUNT,
    ROLL_DEG_PER_COUNT,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from bench.module import Cycle, Module

__all__ = ["PositionSource", "SampleLog", "read_metadata", "read_samples"]

BLOCK_ROWS: Final = 4096
"""Rows of a full block, also of a row group of the file."""

_RAW: Final = np.dtype(
    [
        ("t_ns", "<i8"),
        ("tick", "<i4"),
        ("position", "<i2"),
        ("complete", "u1"),
        ("flags", "u1"),
        ("rig", "<i4", 3),
        ("temperature_c", "<f8"),
        ("group", "u1"),
        ("set_head", "u1", 2),
        ("set", "<i2", 3),
        ("reset_head", "u1", 2),
        ("reset", "<i2", 3),
        ("accel_head", "u1", 2),
        ("accel", "<i2", 3),
        ("heading_head", "u1", 2),
        ("heading", "<u2"),
        ("attitude", "<u4"),
        ("reference", "<i2", 3),
    ]
)
_ROW: Final = struct.Struct("<qihBB3idB8s8s8s8s3h")
_NO_POSITION: Final = -(2**31)


class PositionSource(Protocol):
    """Where the rig is."""

    @property
    def counts(self) -> tuple[int, int, int]:
        """Azimuth, pitch and roll in position counts, as last received."""
        ...

    @property
    def received_ns(self) -> int:
        """When the oldest of these counts was received, on the bench's clock in ns."""
        ...

    @property
    def counts_per_deg(self) -> float:
        """Position counts in a degree."""
        ...


class ReferenceSource(Protocol):
    """What the reference magnetometer reads."""

    @property
    def counts(self) -> tuple[int, int, int]:
        """The newest reading in counts, `bench.reference.NO_COUNTS` where there is none."""
        ...


class SampleLog:
    """Collects the module's cycles with the rig's position, and writes them to a file.

    Parameters
    ----------
    path : Path or None
        The Parquet file; None keeps no file.
    module : Module
        Its cycles become rows.
    rig : PositionSource, optional
        Without it the rig's angles are not-a-number.
    reference : ReferenceSource, optional
        Without it the reference field is not-a-number.
    metadata : mapping of str to str, optional
        Written into the file's schema.

    Attributes
    ----------
    rows : int
        Rows so far.
    unpaired : int
        Rows of dwells without an angle of their time, on a bus whose devices run free: they
        count as moving and are not judged.

    Raises
    ------
    BenchNotReady
        If the file cannot be written.
    """

    def __init__(
        self,
        path: Path | None,
        module: Module,
        rig: PositionSource | None = None,
        *,
        reference: ReferenceSource | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self.rows = 0
        self.unpaired = 0
        self.path: Final = path
        self._module = module
        self._rig = rig
        self._reference = reference
        self._scales = (module.mag_mg_per_count, module.accel_g_per_count)
        self._block: list[bytes] = []
        self._dwell: list[bytes] | None = None
        self._position = MOVING
        self._free = module.bus.mode == "free"
        self._sinks: list[Callable[[NDArray[np.void]], None]] = []
        self._file = None if path is None else SampleFile(path, metadata or {})
        module.add_listener(self._record)

    def add_sink(self, sink: Callable[[NDArray[np.void]], None]) -> None:
        """Give `sink` every block of rows, ndarray of SAMPLE, shape (n,)."""
        self._sinks.append(sink)

    def begin_dwell(self, position: int) -> None:
        """Mark the rows from now on as taken at a settled pose, and keep them.

        Parameters
        ----------
        position : int
            Number of the dwell in the run, from 0.
        """
        self._position = position
        self._dwell = []

    def end_dwell(self) -> NDArray[np.void]:
        """Return the rows since `begin_dwell`, ndarray of SAMPLE, shape (n,), and forget them."""
        rows, self._dwell, self._position = self._dwell or [], None, MOVING
        self._follow_scales()
        return self._samples(rows)

    def flush(self) -> None:
        """Convert and write the rows collected so far."""
        if not self._block:
            return
        samples = self._samples(self._block)
        self._block = []
        if self._file is not None:
            self._file.write(samples)
        for sink in self._sinks:
            sink(samples)

    def close(self) -> None:
        """Write the last rows and complete the file; may be called twice."""
        self.flush()
        if self._file is not None:
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _record(self, cycle: Cycle) -> None:
        t_ns, group, complete, mag_set, mag_reset, acceleration, heading = cycle
        module, rig, reference = self._module, self._rig, self._reference
        if module.mag_mg_per_count != self._scales[0]:
            self._follow_scales()
        azimuth, pitch, roll = (_NO_POSITION,) * 3 if rig is None else rig.counts
        status = module.status
        position = self._position
        if position != MOVING and self._free and not self._is_paired(t_ns):
            position = MOVING
            self.unpaired += 1
        row = _ROW.pack(
            t_ns, module.bus.tick_count, position, complete, status[2],
            azimuth, pitch, roll, status[0], group, mag_set, mag_reset, acceleration, heading,
            *(NO_COUNTS if reference is None else reference.counts),
        )  # fmt: skip
        if self._dwell is not None and position != MOVING:
            self._dwell.append(row)
        self._block.append(row)
        self.rows += 1
        if len(self._block) >= BLOCK_ROWS:
            self.flush()

    def _is_paired(self, t_ns: int) -> bool:
        return self._rig is None or abs(t_ns - self._rig.received_ns) <= PAIRED_WITHIN_NS

    def _follow_scales(self) -> None:
        scales = (self._module.mag_mg_per_count, self._module.accel_g_per_count)
        if scales != self._scales:
            self.flush()
            self._scales = scales

    def _samples(self, rows: list[bytes]) -> NDArray[np.void]:
        raw = np.frombuffer(b"".join(rows), dtype=_RAW)
        samples = np.zeros(len(raw), dtype=SAMPLE)
        samples["t_s"] = (raw["t_ns"] - self._module.bus.start_ns) * 1e-9
        for name in ("tick", "position", "group", "complete", "flags", "temperature_c"):
            samples[name] = raw[name]
        mag_mg_per_count, accel_g_per_count = self._scales
        complete = raw["complete"]
        _fill(samples["set_mg"], raw["set"] * mag_mg_per_count, complete & 1)
        _fill(samples["reset_mg"], raw["reset"] * mag_mg_per_count, complete & 2)
        _fill(samples["accel_g"], raw["accel"] * accel_g_per_count, complete & 4)
        attitude = raw["attitude"]
        _fill(samples["heading_deg"], raw["heading"] * HEADING_DEG_PER_COUNT, complete & 8)
        pitch_counts, roll_counts = _signed_14(attitude), _signed_14(attitude >> 14)
        _fill(samples["pitch_deg"], pitch_counts * PITCH_DEG_PER_COUNT, complete & 8)
        _fill(samples["roll_deg"], roll_counts * ROLL_DEG_PER_COUNT, complete & 8)
        samples["quality"] = attitude >> 28
        per_deg = 1.0 if self._rig is None else self._rig.counts_per_deg
        for axis, name in enumerate(("rig_azimuth_deg", "rig_pitch_deg", "rig_roll_deg")):
            counts = raw["rig"][:, axis]
            _fill(samples[name], counts / per_deg, counts != _NO_POSITION)
        samples["reference_mg"] = field_mg_of(raw["reference"])
        return samples


def _signed_14(field: NDArray[Any]) -> NDArray[np.int64]:
    value = (field & 0x3FFF).astype(np.int64)
    return np.where(value & 0x2000, value - 0x4000, value)


def _fill(column: NDArray[Any], values: NDArray[Any], present: NDArray[Any]) -> None:
    column[:] = values
    column[present == 0] = np.nan
