"""All methods under one name each, fitted on the same data and ranked by heading error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.accelerometer import fit_accelerometer
from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.ellipsoid import fit_ellipsoid
from bench.calibration.min_max import fit_min_max
from bench.calibration.truth_aided import fit_truth_aided
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit

METHODS: Final[dict[str, Callable[[CalibrationData], Fit]]] = {
    "min_max": fit_min_max,
    "ellipsoid": fit_ellipsoid,
    "accelerometer": fit_accelerometer,
    "truth_aided": fit_truth_aided,
}
"""Methods by name, from the simplest to what is written to the unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingError:
    """Statistics of heading errors in degrees; `max_deg` is the largest magnitude."""

    rms_deg: float
    max_deg: float
    mean_deg: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RankedFit:
    """A fit and the heading error that it achieved on data it was ranked on, if there was truth."""

    fit: Fit
    error: HeadingError | None


def fit_named(name: str, data: CalibrationData) -> Fit:
    """Fit one method.

    Raises
    ------
    ValueError
        If there is no such method, or the data have a value that is not finite or columns of
        different lengths.
    """
    if name not in METHODS:
        message = f"method must be one of {', '.join(METHODS)}; instead received {name}"
        raise ValueError(message)
    require_finite(data)
    return METHODS[name](data)


def fit_all(data: CalibrationData) -> list[Fit]:
    """Fit every method on the same data; those that cannot are refused with their cause."""
    require_finite(data)
    return [method(data) for method in METHODS.values()]


def require_finite(data: CalibrationData) -> None:
    """Raise ValueError unless all columns have the same length and finite values.

    >>> from bench.calibration.fit import CalibrationData
    >>> require_finite(CalibrationData(field_mg=np.array([[0.0, np.nan, 1.0]])))
    Traceback (most recent call last):
    ValueError: field_mg must be finite in every row; instead received nan in row 0
    """
    columns = ("field_mg", "accel_g", "azimuth_deg", "pitch_deg", "roll_deg")
    for name in columns:
        values = getattr(data, name)
        if values is None:
            continue
        if len(values) != len(data):
            message = f"{name} must have {len(data)} rows; instead received {len(values)}"
            raise ValueError(message)
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            value = values[tuple(bad[0])]
            message = (
                f"{name} must be finite in every row; instead received {value} in row {bad[0][0]}"
            )
            raise ValueError(message)


def computed_heading_deg(data: CalibrationData, fit: Fit | None) -> NDArray[np.float64]:
    """Return the magnetic heading, shape (n,), that a fit makes of raw readings.

    Tilt is taken from the (corrected) specific force, without one from the rig's pitch and
    roll, without those as level. A fit of None leaves the readings raw.
    """
    pitch_deg = 0.0 if data.pitch_deg is None else data.pitch_deg
    roll_deg = 0.0 if data.roll_deg is None else data.roll_deg
    return compensated_heading_deg(
        fit, data.field_mg, data.accel_g, pitch_deg=pitch_deg, roll_deg=roll_deg
    )


def expected_heading_deg(data: CalibrationData) -> NDArray[np.float64]:
    """Return the true magnetic heading, shape (n,), in [0, 360): rig azimuth less field azimuth.

    Raises
    ------
    ValueError
        If the data have no azimuth.
    """
    if data.azimuth_deg is None:
        message = "azimuth_deg must be given for a heading error; instead received none"
        raise ValueError(message)
    station = data.station_field_mg
    field_azimuth_deg = 0.0 if station is None else np.rad2deg(np.arctan2(station[1], station[0]))
    return np.asarray(np.mod(data.azimuth_deg - field_azimuth_deg, 360.0))


def heading_errors_deg(data: CalibrationData, fit: Fit | None) -> NDArray[np.float64]:
    """Return heading errors in (-180, 180], shape (n,); a fit of None leaves readings raw."""
    return wrap_180_deg(computed_heading_deg(data, fit) - expected_heading_deg(data))


def heading_error(data: CalibrationData, fit: Fit | None) -> HeadingError:
    """Return RMS, maximum and mean of the heading errors."""
    errors_deg = heading_errors_deg(data, fit)
    return HeadingError(
        rms_deg=float(np.sqrt((errors_deg**2).mean())),
        max_deg=float(np.abs(errors_deg).max()),
        mean_deg=float(errors_deg.mean()),
    )


def rank(fits: Sequence[Fit], data: CalibrationData) -> list[RankedFit]:
    """Return the fits, best first: by heading error where there is truth, else as predicted.

    Parameters
    ----------
    fits : sequence of Fit
        Refused ones come last.
    data : CalibrationData
        Readings that none of the fits used.
    """
    has_truth = data.azimuth_deg is not None and len(data) > 0
    ranked = [
        RankedFit(
            fit=fit, error=heading_error(data, fit) if has_truth and not fit.refused else None
        )
        for fit in fits
    ]
    return sorted(ranked, key=_order)


def _order(ranked: RankedFit) -> tuple[bool, float]:
    if ranked.error is not None:
        return (False, ranked.error.rms_deg)
    predicted = ranked.fit.predicted_heading_rms_deg
    return (ranked.fit.refused, float("inf") if predicted is None else predicted)


def rows_of(data: CalibrationData, rows: NDArray[np.bool_]) -> CalibrationData:
    """Return the data of the rows that are True in a mask of shape (n,)."""

    def chosen(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return None if values is None else values[rows]

    return replace(
        data,
        field_mg=data.field_mg[rows],
        accel_g=chosen(data.accel_g),
        azimuth_deg=chosen(data.azimuth_deg),
        pitch_deg=chosen(data.pitch_deg),
        roll_deg=chosen(data.roll_deg),
    )
