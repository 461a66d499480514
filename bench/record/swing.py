"""What the report draws: headings before and after, from the samples in the run's folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.acceptance.site import (
    heading_error_deg,
    is_level,
    reference_heading_deg,
)
from bench.calibration.tilt import tilt_compensated_heading_deg
from bench.record.entries import coefficients_of
from bench.samples import readings_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

RAW_KINDS = ("sweep",)
VERIFIED_KINDS = ("verify",)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingPoint:
    """One pose in a plot: reference heading, error, and how it was taken."""

    heading_deg: float
    error_deg: float
    level: bool
    direction: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """Heading errors and level field readings before and after the calibration."""

    raw: list[HeadingPoint] = field(default_factory=list)
    compensated: list[HeadingPoint] = field(default_factory=list)
    raw_xy_mg: list[tuple[float, float]] = field(default_factory=list)
    corrected_xy_mg: list[tuple[float, float]] = field(default_factory=list)


def site_of(record: Mapping[str, Any]) -> SimpleNamespace | None:
    """Return the station's field of a record, or None if the record has none."""
    station = record["station"]
    keys = ("horizontal_mg", "dip_deg", "field_azimuth_deg")
    if any(station.get(key) is None for key in keys):
        return None
    return SimpleNamespace(**{key: float(station[key]) for key in keys})


def swing_of(run_dir: Path, record: Mapping[str, Any]) -> Swing:
    """Return the swing of a run; empty where it took no samples or knows no station."""
    site = site_of(record)
    path = run_dir / "samples.parquet"
    if site is None or not path.exists() or not record["poses"]:
        return Swing()
    from bench.sample_file import read_samples

    readings = readings_of(read_samples(path))
    raw = _of_kinds(readings, record, RAW_KINDS)
    raw = raw[is_level(raw)]
    verified = _of_kinds(readings, record, VERIFIED_KINDS)
    swing = Swing()
    if len(raw):
        heading_deg = tilt_compensated_heading_deg(raw["field_mg"], raw["accel_g"])
        swing.raw.extend(_points(heading_deg, raw, record, site))
        swing.raw_xy_mg.extend(_xy(raw["field_mg"]))
        written = record["coefficients"].get("written")
        if written:
            coefficients = coefficients_of(written)
            matrix = np.reshape(coefficients.mag_matrix, (3, 3))
            corrected = (raw["field_mg"] - np.array(coefficients.mag_offset_mg)) @ matrix.T
            swing.corrected_xy_mg.extend(_xy(corrected))
    if len(verified):
        swing.compensated.extend(_points(verified["heading_deg"], verified, record, site))
    return swing


def _of_kinds(
    readings: NDArray[np.void], record: Mapping[str, Any], kinds: tuple[str, ...]
) -> NDArray[np.void]:
    names = {entry["name"] for entry in record["steps"] if entry["kind"] in kinds}
    positions = [entry["position"] for entry in record["poses"] if entry["step"] in names]
    return readings[np.isin(readings["position"], positions)]


def _points(
    heading_deg: NDArray[np.float64],
    readings: NDArray[np.void],
    record: Mapping[str, Any],
    site: Any,
) -> list[HeadingPoint]:
    direction = {entry["position"]: entry["direction"] for entry in record["poses"]}
    columns = zip(
        reference_heading_deg(readings, site).tolist(),
        heading_error_deg(heading_deg, readings, site).tolist(),
        is_level(readings).tolist(),
        readings["position"].tolist(),
        strict=True,
    )
    return [
        HeadingPoint(heading_deg=x, error_deg=y, level=level, direction=direction[position])
        for x, y, level, position in columns
        if np.isfinite(x) and np.isfinite(y)
    ]


def _xy(field_mg: NDArray[np.float64]) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y, _ in field_mg]
