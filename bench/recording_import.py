"""`import`: foreign recordings become the product's.

Values are written as multiples of one resolution that keeps them in int16 counts, so that a
replayed module can send each of them and the bench receives what the file holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from bench.converter_resolution import find_resolution, printed_decimals
from bench.errors import ConfigError
from bench.recording_csv import read_table, write_table
from bench.recording_units import (
    COUNTS,
    accel_scale_g,
    attitude_deg,
    axis_map,
    field_scale_mg,
)
from bench.recordings import (
    ACCEL,
    ATTITUDE,
    DEFAULT_RATE_HZ,
    FIELD,
    FORMAT,
    TIME,
    Recording,
    attitude_columns,
    mean_rate_hz,
    read_recording,
    times_s,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bench.recording_csv import Table

Triple = tuple[str, str, str]
TIME_DECIMALS: Final = 6
ANGLE_DECIMALS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """How a foreign recording is laid out.

    Attributes
    ----------
    columns, accel_columns : tuple of str, optional
        Names for the columns of a file that has no header; of the second file likewise.
    skip_lines : int
        Lines before the header.
    delimiter : str, optional
        Separator; found by itself without.
    time : str, optional
        Column of the time in s; `t_s` is taken where there is one.
    rate_hz : float, optional
        Rate of the rows of a file without times.
    field, accel : tuple of three str
        Columns of the vectors. The acceleration's are needed only if they are given, or if it
        comes from a file of its own.
    field_unit, accel_unit : str
        mG, G, uT, nT or counts; g, mg, m/s2 or counts.
    mg_per_count, g_per_count : float, optional
        Size of a count.
    field_axes, accel_axes : str
        The sensor's axes along body forward, right, down, as "x,-y,-z". A sensor that reads +1 g
        along its upward axis measures specific force; one that reads -1 g needs all signs
        turned.
    resample : "linear" or "nearest"
        How a second file is brought onto the magnetometer's times.
    quaternion : tuple of four str, optional
        Columns w, x, y, z of the rotation from the sensor's axes to east-north-up.
    """

    columns: tuple[str, ...] | None = None
    accel_columns: tuple[str, ...] | None = None
    skip_lines: int = 0
    delimiter: str | None = None
    time: str | None = None
    rate_hz: float | None = None
    field: Triple = FIELD
    field_unit: str = "mG"
    mg_per_count: float | None = None
    field_axes: str = "x,y,z"
    accel: Triple | None = None
    accel_unit: str = "g"
    g_per_count: float | None = None
    accel_axes: str = "x,y,z"
    resample: Literal["linear", "nearest"] = "linear"
    quaternion: tuple[str, str, str, str] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Quantised:
    """Values on the grid of one count, shape (n, 3), in the product's unit."""

    values: NDArray[np.float64]
    decimals: int
    resolution: float
    rounding: float


def import_recording(
    source: Path,
    target: Path,
    options: ImportOptions,
    accelerometer: Path | None = None,
) -> Recording:
    """Bring a foreign recording into the product's CSV and return it as read back.

    Parameters
    ----------
    source : Path
        The recording, or the magnetometer's part of it.
    target : Path
        The file to write.
    options : ImportOptions
        How the source is laid out.
    accelerometer : Path, optional
        A second file, at times of its own, with the acceleration.

    Raises
    ------
    ConfigError
        If the sources cannot be read as described, or the target cannot be written.
    """
    table = read_table(
        source,
        names=options.columns,
        skip_lines=options.skip_lines,
        delimiter=options.delimiter,
    )
    t_s = times_s(table, _time_column(table, options), options.rate_hz)
    body_from_sensor = axis_map(options.field_axes)
    scale_mg = field_scale_mg(options.field_unit, options.mg_per_count)
    values = table.numbers(options.field)
    magnetic = _quantise(values, table.decimals(options.field), scale_mg, body_from_sensor)
    attitude = _attitude(table, options, body_from_sensor)
    force, kept = _acceleration(table, t_s, options, accelerometer)
    preamble = {"format": FORMAT, "source": source.name} | _said_of_field(magnetic, options)
    preamble["rate_hz"] = f"{mean_rate_hz(t_s[kept]):.6g}"
    if _time_column(table, options) is None and options.rate_hz is None:
        preamble["time"] = f"not in the source, counted at {DEFAULT_RATE_HZ:g} Hz"
    columns = {TIME: (t_s[kept], TIME_DECIMALS)}
    columns |= {n: (magnetic.values[kept, i], magnetic.decimals) for i, n in enumerate(FIELD)}
    if force is not None:
        preamble |= _said_of_force(force)
        columns |= {n: (force.values[:, i], force.decimals) for i, n in enumerate(ACCEL)}
    if accelerometer is not None:
        preamble["accel_source"] = accelerometer.name
        preamble["resampling"] = f"{options.resample}, onto the magnetometer's times"
        preamble["rows_outside"] = str(len(t_s) - int(np.count_nonzero(kept)))
    columns |= {name: (column[kept], ANGLE_DECIMALS) for name, column in attitude.items()}
    write_table(target, columns, preamble)
    return read_recording(target)


def _said_of_field(magnetic: _Quantised, options: ImportOptions) -> dict[str, str]:
    said = {
        "mag_unit": "mG",
        "mag_resolution_mg": repr(magnetic.resolution),
        "mag_rounding_mg": f"{magnetic.rounding:.3g}",
    }
    if options.field_unit == COUNTS and options.mg_per_count is None:
        said["mag_scale"] = "unknown, one count is taken as 1 mG"
    return said


def _said_of_force(force: _Quantised) -> dict[str, str]:
    return {
        "accel_unit": "g",
        "accel_resolution_g": repr(force.resolution),
        "accel_rounding_g": f"{force.rounding:.3g}",
    }


def _time_column(table: Table, options: ImportOptions) -> str | None:
    if options.time is not None:
        return options.time
    return TIME if table.has(TIME) else None


def _quantise(
    values: NDArray[np.float64],
    decimals: int,
    scale: float,
    body_from_sensor: NDArray[np.float64],
    printed: NDArray[np.float64] | None = None,
) -> _Quantised:
    """Put values on the grid of the converter that `printed` (or they themselves) came from."""
    found = find_resolution(values if printed is None else printed, decimals)
    counts = found.counts(values)
    # Twelve digits: the double that is printed, so that what replays it computes the same.
    resolution = float(f"{found.step * scale:.12g}")
    grid = counts * resolution
    shift = round(float(np.log10(scale)), 9)
    kept = decimals - int(shift) if shift.is_integer() else None
    if kept is None or not np.array_equal(np.round(grid, kept), np.round(values * scale, kept)):
        kept = printed_decimals(resolution)
    return _Quantised(
        values=grid @ body_from_sensor.T,
        decimals=max(0, kept),
        resolution=resolution,
        rounding=float(np.max(np.abs(grid - values * scale))),
    )


def _attitude(
    table: Table, options: ImportOptions, body_from_sensor: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    if options.quaternion is None:
        return attitude_columns(table)
    angles_deg = attitude_deg(table.numbers(options.quaternion), body_from_sensor)
    return {name: angles_deg[:, place] for place, name in enumerate(ATTITUDE)}


def _acceleration(
    table: Table,
    t_s: NDArray[np.float64],
    options: ImportOptions,
    accelerometer: Path | None,
) -> tuple[_Quantised | None, NDArray[np.bool_]]:
    """Return the acceleration at the rows that are kept, and which rows those are."""
    every = np.ones(len(t_s), dtype=bool)
    names = options.accel or ACCEL
    body_from_sensor = axis_map(options.accel_axes)
    scale_g = accel_scale_g(options.accel_unit, options.g_per_count)
    if accelerometer is None:
        if options.accel is None and not table.has(*names):
            return None, every
        values = table.numbers(names)
        return _quantise(values, table.decimals(names), scale_g, body_from_sensor), every
    second = read_table(
        accelerometer,
        names=options.accel_columns,
        skip_lines=options.skip_lines,
        delimiter=options.delimiter,
    )
    times = times_s(second, _time_column(second, options), options.rate_hz)
    values = second.numbers(names)
    reach_s = 1.0 / mean_rate_hz(times)
    kept = (t_s >= times[0] - reach_s) & (t_s <= times[-1] + reach_s)
    if np.count_nonzero(kept) < 2:
        message = (
            f"{accelerometer} must cover the times of {table.path} ({t_s[0]} to {t_s[-1]} s); "
            f"instead received {times[0]} to {times[-1]} s"
        )
        raise ConfigError(message)
    resampled = resample(times, values, t_s[kept], options.resample)
    decimals = second.decimals(names)
    return _quantise(resampled, decimals, scale_g, body_from_sensor, printed=values), kept


def resample(
    times_s: NDArray[np.float64],
    values: NDArray[np.float64],
    wanted_s: NDArray[np.float64],
    rule: str,
) -> NDArray[np.float64]:
    """Return values, shape (n, k), at other times, shape (m,): shape (m, k).

    Outside the span of `times_s` the first and the last row are held.

    Raises
    ------
    ConfigError
        If the rule is neither linear nor nearest.
    """
    if rule == "linear":
        return np.column_stack([np.interp(wanted_s, times_s, column) for column in values.T])
    if rule == "nearest":
        after = np.clip(np.searchsorted(times_s, wanted_s), 1, len(times_s) - 1)
        earlier = wanted_s - times_s[after - 1] <= times_s[after] - wanted_s
        return values[np.where(earlier, after - 1, after)]
    message = f"rule of resampling must be linear or nearest; instead received {rule!r}"
    raise ConfigError(message)
