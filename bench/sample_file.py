"""samples.parquet: the rows of a run in flat columns, exact to the last bit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.errors import BenchNotReady, ConfigError
from bench.samples import SAMPLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

BATCH_ROWS: Final = 4096
"""Rows that `iterate_samples` yields at a time."""
LATER_FIELDS: Final = ("reference_mg",)
"""Fields that a file of an earlier version lacks; they are not-a-number then."""
_AXES: Final = ("x", "y", "z")


def column_names() -> dict[str, tuple[str, int | None]]:
    """Return column name to (field of SAMPLE, axis or None); "set_mg" is set_x_mg, set_y_mg, ...

    >>> list(column_names())[5:8]
    ['set_x_mg', 'set_y_mg', 'set_z_mg']
    """
    columns: dict[str, tuple[str, int | None]] = {}
    for name in SAMPLE.names or ():
        if SAMPLE[name].shape:
            quantity, unit = name.rsplit("_", 1)
            for axis, letter in enumerate(_AXES):
                columns[f"{quantity}_{letter}_{unit}"] = (name, axis)
        else:
            columns[name] = (name, None)
    return columns


class SampleFile:
    """Appends blocks of SAMPLE to a Parquet file (zstd).

    Raises
    ------
    BenchNotReady
        If the file cannot be written.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str]) -> None:
        import pyarrow as pa
        from pyarrow.parquet import ParquetWriter

        self._columns = column_names()
        fields = [
            pa.field(column, pa.from_numpy_dtype(SAMPLE[name].base))
            for column, (name, _) in self._columns.items()
        ]
        self._schema = pa.schema(fields, metadata=dict(metadata))
        self._open = True
        self._failed = False
        try:
            self._writer: Any = ParquetWriter(
                path, self._schema, compression="zstd", use_dictionary=False
            )
        except OSError as error:
            message = f"samples {path} cannot be written: {error}; choose another folder"
            raise BenchNotReady(message) from error

    def write(self, samples: NDArray[np.void]) -> None:
        """Append a block, ndarray of SAMPLE, shape (n,); a file that failed takes nothing more.

        Raises
        ------
        BenchNotReady
            If the disk does not take it, once.
        """
        import pyarrow as pa

        if self._failed:
            return
        arrays = [
            pa.array(np.ascontiguousarray(_column(samples, name, axis)))
            for name, axis in self._columns.values()
        ]
        try:
            self._writer.write_batch(pa.record_batch(arrays, schema=self._schema))
        except OSError as error:
            self._failed = True
            message = f"samples cannot be written: {error}; free the disk"
            raise BenchNotReady(message) from error

    def close(self) -> None:
        """Complete the file; may be called twice.

        Raises
        ------
        BenchNotReady
            If the disk does not take the rest.
        """
        if not self._open:
            return
        self._open = False
        try:
            self._writer.close()
        except OSError as error:
            message = f"samples cannot be completed: {error}; free the disk"
            raise BenchNotReady(message) from error


def read_samples(path: Path) -> NDArray[np.void]:
    """Return the rows of a file, ndarray of SAMPLE, shape (n,), equal to what was written.

    Raises
    ------
    ConfigError
        If the file does not exist, is incomplete, or lacks a column.
    """
    blocks = list(iterate_samples(path))
    return np.concatenate(blocks) if blocks else np.zeros(0, dtype=SAMPLE)


def iterate_samples(path: Path) -> Iterator[NDArray[np.void]]:
    """Yield the rows of a file block by block, ndarray of SAMPLE, as they were written.

    Raises
    ------
    ConfigError
        If the file does not exist, is incomplete, or lacks a column.
    """
    import pyarrow as pa
    from pyarrow.parquet import ParquetFile

    columns = column_names()
    try:
        with ParquetFile(path) as file:
            present = _present(columns, file.schema_arrow.names, path)
            for batch in file.iter_batches(batch_size=BATCH_ROWS, columns=list(present)):
                samples = np.zeros(batch.num_rows, dtype=SAMPLE)
                for name in LATER_FIELDS:
                    samples[name] = np.nan
                for column, (name, axis) in present.items():
                    _column(samples, name, axis)[:] = batch.column(column).to_numpy()
                yield samples
    except (OSError, pa.ArrowInvalid) as error:
        message = f"samples {path} cannot be read: {error}"
        raise ConfigError(message) from error


def _present(
    columns: dict[str, tuple[str, int | None]], names: Sequence[str], path: Path
) -> dict[str, tuple[str, int | None]]:
    """Return the columns that a file has; only those of `LATER_FIELDS` may be missing."""
    missing = sorted(columns.keys() - set(names))
    if any(columns[column][0] not in LATER_FIELDS for column in missing):
        needed = next(c for c in missing if columns[c][0] not in LATER_FIELDS)
        message = f"samples {path} must have the column {needed}; instead received others"
        raise ConfigError(message)
    return {column: place for column, place in columns.items() if column not in missing}


def read_metadata(path: Path) -> dict[str, str]:
    """Return the metadata written into a file's schema."""
    from pyarrow.parquet import read_schema

    metadata = read_schema(path).metadata or {}
    return {key.decode(): value.decode() for key, value in metadata.items()}


def _column(samples: NDArray[np.void], name: str, axis: int | None) -> NDArray[Any]:
    column: NDArray[Any] = samples[name]
    return column if axis is None else column[:, axis]
