"""Recordings of a magnetometer: the product's own format, read for `fit` and for replay."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.errors import ConfigError
from bench.recording_csv import Table, read_table
from bench.recording_units import COUNTS, accel_scale_g, field_scale_mg
from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

FORMAT: Final = "compass-bench/recording/1"
TIME: Final = "t_s"
FIELD: Final = ("mx", "my", "mz")
ACCEL: Final = ("ax", "ay", "az")
ATTITUDE: Final = ("heading_deg", "pitch_deg", "roll_deg")
EARTH: Final = ("hn", "he", "hd")
HEADING_ALIAS: Final = "azimuth_deg"
DEFAULT_RATE_HZ: Final = 100.0
ROWS_MIN: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """What a recording holds, in the product's units and axes.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
        Times, never decreasing.
    field_mg : ndarray, shape (n, 3)
        Sensor readings along body forward, right, down.
    accel_g : ndarray, shape (n, 3), or None
        Specific force: (0, 0, -1) level at rest.
    heading_deg, pitch_deg, roll_deg : ndarray, shape (n,), or None
        Attitude from elsewhere, held for true; heading from magnetic north unless a declination
        is given to whoever uses it.
    earth_ned_mg : ndarray, shape (n, 3), or None
        The field around the sensor at each row.
    metadata : mapping
        The preamble, as text.
    """

    t_s: NDArray[np.float64]
    field_mg: NDArray[np.float64]
    accel_g: NDArray[np.float64] | None = None
    heading_deg: NDArray[np.float64] | None = None
    pitch_deg: NDArray[np.float64] | None = None
    roll_deg: NDArray[np.float64] | None = None
    earth_ned_mg: NDArray[np.float64] | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                held = np.array(value, dtype=np.float64)
                held.setflags(write=False)
                object.__setattr__(self, name, held)

    def __len__(self) -> int:
        return len(self.field_mg)

    @property
    def rate_hz(self) -> float:
        """Mean rate of the rows."""
        return mean_rate_hz(self.t_s)

    @property
    def mag_resolution_mg(self) -> float | None:
        """Size of one count of the magnetometer, or None if the file does not say it."""
        return _resolution(self.metadata, "mag_resolution_mg")

    @property
    def accel_resolution_g(self) -> float | None:
        """Size of one count of the accelerometer, or None if the file does not say it."""
        return _resolution(self.metadata, "accel_resolution_g")


def mean_rate_hz(t_s: NDArray[np.float64]) -> float:
    """Return the mean rate of rows at these times, shape (n,)."""
    duration_s = float(t_s[-1] - t_s[0])
    return (len(t_s) - 1) / duration_s if duration_s > 0.0 else DEFAULT_RATE_HZ


def read_recording(
    path: Path,
    *,
    unit: str | None = None,
    mg_per_count: float | None = None,
    accel_unit: str | None = None,
) -> Recording:
    """Read a recording with the product's column names, in any unit.

    Columns: mx,my,mz [,ax,ay,az] [,heading_deg,pitch_deg,roll_deg] [,hn,he,hd] [,t_s]; others
    are left alone, and azimuth_deg stands for heading_deg where there is none.

    Parameters
    ----------
    path : Path
        The file.
    unit : str, optional
        mG, G, uT, nT or counts. Without it, what the preamble says, else mG.
    mg_per_count : float, optional
        For counts: their size.
    accel_unit : str, optional
        g, mg, m/s2 or counts. Without it, what the preamble says, else g.

    Raises
    ------
    ConfigError
        If the file is unreadable or empty, lacks a column, has ragged rows or values that are
        not finite numbers, or if units are unknown or contradict its preamble.
    """
    table = read_table(path)
    mag_unit = _unit(table, "mag_unit", unit, "mG")
    scale_mg = field_scale_mg(mag_unit, mg_per_count)
    scale_g = accel_scale_g(_unit(table, "accel_unit", accel_unit, "g"))
    metadata = {**table.preamble, "mag_unit": mag_unit}
    if mag_unit == COUNTS and mg_per_count is None:
        metadata["mag_scale"] = "unknown, one count is taken as 1 mG"
    return Recording(
        field_mg=table.numbers(FIELD) * scale_mg,
        t_s=times_s(
            table, TIME if table.has(TIME) else None, _resolution(table.preamble, "rate_hz")
        ),
        accel_g=table.numbers(ACCEL) * scale_g if table.has_any(*ACCEL) else None,
        earth_ned_mg=table.numbers(EARTH) * scale_mg if table.has_any(*EARTH) else None,
        metadata=metadata,
        **attitude_columns(table),
    )


def attitude_columns(table: Table) -> dict[str, NDArray[np.float64]]:
    """Return those of heading_deg, pitch_deg and roll_deg that the table has, shape (n,) each."""
    found = {name: table.numbers([name])[:, 0] for name in ATTITUDE if table.has(name)}
    if "heading_deg" not in found and table.has(HEADING_ALIAS):
        found["heading_deg"] = table.numbers([HEADING_ALIAS])[:, 0]
    if "heading_deg" in found:
        found["heading_deg"] = wrap_360_deg(found["heading_deg"])
    return found


def times_s(table: Table, column: str | None, rate_hz: float | None) -> NDArray[np.float64]:
    """Return the times of a table's rows, shape (n,): its own, else counted at a rate.

    Raises
    ------
    ConfigError
        If there are fewer than two rows, times decrease, or the rate is not positive.
    """
    if len(table.rows) < ROWS_MIN:
        message = f"{table.path} must hold at least {ROWS_MIN} rows; instead received 1"
        raise ConfigError(message)
    if column is None:
        rate_hz = DEFAULT_RATE_HZ if rate_hz is None else rate_hz
        if not (np.isfinite(rate_hz) and rate_hz > 0.0):
            message = f"rate of the rows must be positive; instead received {rate_hz} Hz"
            raise ConfigError(message)
        return np.arange(len(table.rows)) / rate_hz
    times = table.numbers([column])[:, 0]
    back = np.flatnonzero(np.diff(times) < 0.0)
    if len(back):
        row = int(back[0]) + 1
        message = (
            f"{table.path}:{table.lines[row]}: {column} must not decrease; instead received "
            f"{times[row]} s after {times[row - 1]} s"
        )
        raise ConfigError(message)
    return times


def _unit(table: Table, key: str, asked: str | None, default: str) -> str:
    said = table.preamble.get(key)
    if asked is not None and said is not None and asked != said:
        message = f"{table.path} says {key} {said}; instead received the unit {asked!r}"
        raise ConfigError(message)
    return asked or said or default


def _resolution(metadata: Mapping[str, str], key: str) -> float | None:
    text = metadata.get(key)
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not (np.isfinite(value) and value > 0.0):
        message = f"{key} of a recording must be a positive number; instead received {text!r}"
        raise ConfigError(message)
    return value
