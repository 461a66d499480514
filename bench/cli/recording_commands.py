"""`import` and `fit`: recordings from elsewhere."""

from __future__ import annotations

import json as json_module
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from bench.calibration.fit import CalibrationData
from bench.calibration.fit_report import ALL, fit_report
from bench.errors import ConfigError
from bench.recording_import import ImportOptions
from bench.recording_import import import_recording as bring
from bench.recording_presets import PRESETS, preset
from bench.recordings import read_recording
from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from pathlib import Path

    from bench.recordings import Recording


_LISTS: Final = {"columns": None, "accel_columns": None, "field": 3, "accel": 3, "quaternion": 4}
"""Options that list columns, with the number that they need."""
_ACHIEVED: Final = ("level rms, max (deg)", "tilted rms, max (deg)", "tilt from")
_TOLD: Final = ("coverage", "predicted rms (deg)")
"""Columns of a recording with headings, and of one without."""


def import_recording(
    source: Path,
    target: Path,
    preset_name: str | None,
    accelerometer: Path | None,
    layout: dict[str, Any],
) -> int:
    """Write the product's CSV and say what is in it.

    Parameters
    ----------
    preset_name : str or None
        Known layout to begin with, or "list" to print their names.
    layout : dict
        Fields of `ImportOptions` that were given; None where they were not.

    Raises
    ------
    ConfigError
        If the file or an option cannot be used.
    """
    if preset_name == "list":
        typer.echo("\n".join(PRESETS))
        return 0
    options = _options(preset_name, layout)
    recording = bring(source, target, options, accelerometer)
    parts = [f"{len(recording.t_s)} rows", "magnetometer"]
    if recording.accel_g is not None:
        parts.append("accelerometer")
    if recording.heading_deg is not None:
        parts.append("headings")
    typer.echo(f"{target}: {', '.join(parts)}")
    return 0


def _options(preset_name: str | None, layout: dict[str, Any]) -> ImportOptions:
    given = {name: value for name, value in layout.items() if value is not None}
    for name, count in _LISTS.items():
        if name in given:
            given[name] = tuple(part.strip() for part in given[name].split(","))
            if count is not None and len(given[name]) != count:
                message = f"{name} must name {count} columns; instead received {layout[name]}"
                raise ConfigError(message)
    if layout["resample"] not in (None, "nearest", "linear"):
        message = f"--resample must be nearest or linear; instead received {layout['resample']!r}"
        raise ConfigError(message)
    options = preset(preset_name) if preset_name else ImportOptions()
    return replace(options, **given)


def fit_recording(
    path: Path,
    *,
    method: str,
    unit: str | None,
    holdout: str,
    order: str,
    declination_deg: float,
    json: bool,
) -> int:
    """Fit a recording and print the result; return 1 where no method accepted the data.

    Parameters
    ----------
    method, holdout, order : str
        As `fit_report` takes them.

    Raises
    ------
    ConfigError
        If the recording or an option cannot be used.
    """
    if not abs(declination_deg) <= 180.0:
        message = f"--declination must be from -180 to 180 deg; instead received {declination_deg}"
        raise ConfigError(message)
    data = _data(read_recording(path, unit=unit), declination_deg)
    try:
        report = fit_report(data, method, holdout, order)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    results = report["ranking"] if method == ALL else [report]
    if json:
        typer.echo(json_module.dumps(report, indent=1, allow_nan=False))
    else:
        _print_fits(results, report)
    return int(all(result["cause"] is not None for result in results))


def _data(recording: Recording, declination_deg: float) -> CalibrationData:
    heading_deg = recording.heading_deg
    if heading_deg is not None:
        heading_deg = wrap_360_deg(heading_deg - declination_deg)
    earth = recording.earth_ned_mg
    return CalibrationData(
        field_mg=recording.field_mg,
        accel_g=recording.accel_g,
        azimuth_deg=heading_deg,
        pitch_deg=recording.pitch_deg,
        roll_deg=recording.roll_deg,
        station_field_mg=None if earth is None else np.asarray(earth.mean(axis=0)),
    )


def _print_fits(results: list[dict[str, Any]], report: dict[str, Any]) -> None:
    console = Console(highlight=False)
    console.width = max(console.width, 130)
    judged = "raw" in report
    table = Table("method", "samples", "residual (mG)", *(_ACHIEVED if judged else _TOLD), "remark")
    if judged:
        table.add_row("raw", "", "", *_errors(report["raw"]), "raw", "no coefficients")
    for result in results:
        refused = result["cause"] is not None
        table.add_row(
            result["method"],
            str(result["samples"]),
            _text(result["residual_rms"]),
            *(_achieved(result) if judged else _told(result)),
            f"refused: {result['message']}" if refused else _order_text(result["order"]),
        )
    console.print(table)
    for result in results:
        if result["cause"] is None and len(results) == 1:
            _print_coefficients(console, result)


def _print_coefficients(console: Console, result: dict[str, Any]) -> None:
    console.print(f"offset (mG)  {np.round(result['offset'], 3).tolist()}")
    console.print(f"matrix       {np.round(result['matrix'], 6).tolist()}")
    if result["extended_dip_deg"] is not None:
        console.print(f"extended dip {result['extended_dip_deg']:.3f} deg")


def _achieved(result: dict[str, Any]) -> tuple[str, ...]:
    return *_errors(result["orders"].get(result["order"])), result["tilt_from"] or ""


def _told(result: dict[str, Any]) -> tuple[str, ...]:
    return _text(result["coverage"]), _text(result["predicted_heading_rms_deg"])


def _order_text(order: str) -> str:
    return "" if order == "body" else f"order {order}"


def _errors(achieved: dict[str, Any] | None) -> tuple[str, str]:
    if achieved is None:
        return "", ""
    level, tilt = (
        (achieved[f"{rows}_rms_deg"], achieved[f"{rows}_max_deg"]) for rows in ("level", "tilt")
    )
    return _pair(*level), _pair(*tilt)


def _pair(rms_deg: float | None, max_deg: float | None) -> str:
    return "" if rms_deg is None else f"{rms_deg:.2f}, {max_deg:.2f}"


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
