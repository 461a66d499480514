"""All methods under one name each, fitted on the same data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.accelerometer import fit_accelerometer
from bench.calibration.ellipsoid import fit_ellipsoid
from bench.calibration.fixture import without_fixture
from bench.calibration.four_position import fit_four_position
from bench.calibration.min_max import fit_min_max
from bench.calibration.set_reset import fit_set_reset
from bench.calibration.soft_iron import fit_soft_iron
from bench.calibration.three_headings import fit_three_headings
from bench.calibration.tilt_aided import fit_tilt_aided
from bench.calibration.truth_aided import fit_truth_aided
from bench.calibration.two_axis_fit import fit_two_axis, fit_two_axis_aided

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.calibration.fit import CalibrationData, Fit

METHODS: Final[dict[str, Callable[[CalibrationData], Fit]]] = {
    "set_reset": fit_set_reset,
    "min_max": fit_min_max,
    "four_position": fit_four_position,
    "soft_iron": fit_soft_iron,
    "three_headings": fit_three_headings,
    "ellipsoid": fit_ellipsoid,
    "tilt_aided": fit_tilt_aided,
    "accelerometer": fit_accelerometer,
    "two_axis": fit_two_axis,
    "two_axis_aided": fit_two_axis_aided,
    "truth_aided": fit_truth_aided,
}
"""Methods by name, from the simplest to what is written to the unit."""


def fit_named(name: str, data: CalibrationData) -> Fit:
    """Fit one method; what the fixture's iron adds to the offset is taken out.

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
    return without_fixture(METHODS[name](data), data)


def fit_all(data: CalibrationData) -> dict[str, Fit]:
    """Return the fit of every method, by name, on the same data; refused ones with their cause."""
    require_finite(data)
    return {name: without_fixture(fit(data), data) for name, fit in METHODS.items()}


def require_finite(data: CalibrationData) -> None:
    """Raise ValueError unless all columns have the same length and finite values.

    >>> from bench.calibration.fit import CalibrationData
    >>> require_finite(CalibrationData(field_mg=np.array([[0.0, np.nan, 1.0]])))
    Traceback (most recent call last):
    ValueError: field_mg must be finite in every row; instead received nan in row 0
    """
    columns = ("field_mg", "accel_g", "azimuth_deg", "pitch_deg", "roll_deg", "offset_mg")
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
