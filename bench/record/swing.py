"""What the report draws: headings before and after, and of every method, from the samples."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.acceptance.seat import seat_of
from bench.acceptance.site import (
    heading_error_deg,
    is_level,
    reference_heading_deg,
)
from bench.acceptance.two_axis_evaluation import fit_of
from bench.calibration.ranking import RAW
from bench.errors import ConfigError
from bench.record.entries import coefficients_of
from bench.record.recorded_fits import (
    VERIFIED_KINDS,
    judged_method,
    recorded_fits,
    step_positions,
)
from bench.samples import readings_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from bench.calibration.expectation import PoseErrors
    from bench.calibration.fit import Fit

RAW_KINDS = ("sweep", "poses")
WRITTEN_KINDS = ("verify",)
"""Kinds of steps in which the module sends its heading with the new coefficients."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingPoint:
    """One pose in a plot: reference heading, error, and how it was taken."""

    heading_deg: float
    error_deg: float
    level: bool
    direction: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedPoint:
    """What was expected of one pose: reference heading, error and its standard deviation."""

    heading_deg: float
    error_deg: float
    sd_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """Heading errors and level field readings before and after the calibration.

    Attributes
    ----------
    compensated_by : str
        Method whose heading the bench computed; empty where it is the module's own.
    methods : dict
        Level verification poses, first of the raw readings, then of each method.
    expected : dict
        What the unit's model said of the same poses before, likewise; empty without one.
    """

    raw: list[HeadingPoint] = field(default_factory=list)
    compensated: list[HeadingPoint] = field(default_factory=list)
    compensated_by: str = ""
    raw_xy_mg: list[tuple[float, float]] = field(default_factory=list)
    corrected_xy_mg: list[tuple[float, float]] = field(default_factory=list)
    methods: dict[str, list[HeadingPoint]] = field(default_factory=dict)
    expected: dict[str, list[ExpectedPoint]] = field(default_factory=dict)


def site_of(record: Mapping[str, Any]) -> SimpleNamespace | None:
    """Return the station's field of a record, or None if the record has none."""
    station = record["station"]
    keys = ("horizontal_mg", "dip_deg", "field_azimuth_deg")
    if any(station.get(key) is None for key in keys):
        return None
    try:
        seat = seat_of(station.get("seat") or {})
    except (AttributeError, TypeError, ValueError) as error:
        message = f"the record's station must hold its seat in numbers; instead {error}"
        raise ConfigError(message) from error
    return SimpleNamespace(**{key: float(station[key]) for key in keys}, seat=seat)


def swing_of(run_dir: Path, record: Mapping[str, Any]) -> Swing:
    """Return the swing of a run; empty where it took no samples or knows no station."""
    site = site_of(record)
    path = run_dir / "samples.parquet"
    if site is None or not path.exists() or not record["poses"]:
        return Swing()
    from bench.sample_file import read_samples

    readings = readings_of(read_samples(path))
    fits = recorded_fits(record)
    judged = judged_method(record) or ""
    raw = _of_kinds(readings, record, RAW_KINDS)
    raw = raw[is_level(raw)]
    sent = _of_kinds(readings, record, WRITTEN_KINDS)
    verified = _of_kinds(readings, record, VERIFIED_KINDS)
    computed = not len(sent) and judged in fits.by_method
    shown = verified if computed else sent
    by_method = fits.headings_deg(verified)
    level = is_level(verified)
    return Swing(
        raw=_points(fits.heading_deg(RAW, raw["field_mg"], raw), raw, record, site),
        compensated=_points(
            by_method[judged] if computed else sent["heading_deg"], shown, record, site
        ),
        compensated_by=judged if computed else "",
        raw_xy_mg=_xy(raw["field_mg"]),
        corrected_xy_mg=_corrected_xy(raw["field_mg"], record, fits.by_method.get(judged)),
        methods={
            method: _points(heading_deg[level], verified[level], record, site)
            for method, heading_deg in by_method.items()
        }
        if level.any()
        else {},
        expected=_expected_points(
            fits.expected_errors(verified[level], site), verified[level], site
        ),
    )


def _corrected_xy(
    field_mg: NDArray[np.float64], record: Mapping[str, Any], judged: Fit | None
) -> list[tuple[float, float]]:
    """Return the readings corrected as in the module, where nothing was written by the fit."""
    written = record["coefficients"].get("written")
    if written:
        return _xy(fit_of(coefficients_of(written)).corrected_mg(field_mg))
    return [] if judged is None else _xy(judged.corrected_mg(field_mg))


def _of_kinds(
    readings: NDArray[np.void], record: Mapping[str, Any], kinds: tuple[str, ...]
) -> NDArray[np.void]:
    return readings[np.isin(readings["position"], step_positions(record, kinds))]


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


def _expected_points(
    errors: Mapping[str, PoseErrors], readings: NDArray[np.void], site: Any
) -> dict[str, list[ExpectedPoint]]:
    heading_deg = reference_heading_deg(readings, site).tolist()
    return {
        method: [
            ExpectedPoint(heading_deg=x, error_deg=y, sd_deg=sd)
            for x, y, sd in zip(
                heading_deg, found.mean_deg.tolist(), found.sd_deg.tolist(), strict=True
            )
        ]
        for method, found in errors.items()
    }


def _xy(field_mg: NDArray[np.float64]) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y, _ in field_mg]
