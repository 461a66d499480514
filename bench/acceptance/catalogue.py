"""The measurements that a run can make: name, unit, meaning, and whether samples give them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class MeasurementKind:
    """Unit and meaning of a measurement; `from_samples` if `judge` can recompute it."""

    unit: str
    meaning: str
    from_samples: bool = True


def _of_axes(name: str, unit: str, meaning: str) -> dict[str, MeasurementKind]:
    return {f"{name}_{axis}": MeasurementKind(unit, meaning.format(axis=axis)) for axis in "xyz"}


CHECKS: Final = frozenset({"serial_match", "firmware_version", "fit_accepted", "read_back"})
"""Measurements that are 1 (yes) or 0 (no)."""

BUDGETED: Final = frozenset({"level_max", "level_rms", "tilt_max", "tilt_rms"})
"""Measurements whose uncertainty is computed where the limits know the part."""

MEASUREMENTS: Final[dict[str, MeasurementKind]] = {
    "frames_lost": MeasurementKind("frames", "Frames missed by E2E counters or link", False),
    "bus_load": MeasurementKind("%", "Bus load at worst-case bit stuffing", False),
    "serial_match": MeasurementKind("", "The module's serial number is the scanned one", False),
    "firmware_version": MeasurementKind("", "The module runs the released firmware", False),
    "read_back": MeasurementKind("", "Coefficients read back equal those written", False),
    **_of_axes("noise", "mG", "Standard deviation of one {axis} reading at rest"),
    **_of_axes(
        "set_reset_amplitude",
        "%",
        "Swing of the {axis} set/reset reading against that of the station's field",
    ),
    **_of_axes(
        "set_reset_symmetry", "%", "Difference between the swings of {axis} set and reset readings"
    ),
    **_of_axes("bridge_offset", "mG", "Bridge offset of {axis} without its cross-axis part"),
    **_of_axes("hk", "G", "Anisotropy field of the {axis} film from its cross-axis term"),
    "peak_reading": MeasurementKind("mG", "Largest set or reset reading on any axis"),
    **_of_axes("axis_sense", "", "Cosine between the magnetic {axis} axis and the body's"),
    **_of_axes("accel_sense", "", "Cosine between the accelerometer's {axis} axis and the body's"),
    "raw_max": MeasurementKind("deg", "Largest heading error of the raw readings, level"),
    "hysteresis": MeasurementKind("mG", "Largest clockwise to counter-clockwise difference"),
    "return_to_start": MeasurementKind("mG", "Change between the sweep's first and last reading"),
    "fit_accepted": MeasurementKind("", "The calibration did not refuse the data"),
    "fit_residual": MeasurementKind("mG", "RMS residual of the magnetometer calibration"),
    "fit_residual_share": MeasurementKind("%", "RMS residual of the fit in the field's strength"),
    "fit_condition": MeasurementKind("", "Condition number of the calibration"),
    "predicted_uncertainty": MeasurementKind(
        "deg", "Largest heading error of the coefficients at 95 %, by the fit's covariance"
    ),
    "field_azimuth_difference": MeasurementKind(
        "deg", "Field azimuth of the calibration against the station's record"
    ),
    "dip_difference": MeasurementKind("deg", "Dip of the calibration against the station's record"),
    "sensitivity": MeasurementKind(
        "%", "Mean sensitivity of the three axes against the nominal one"
    ),
    "accel_bias": MeasurementKind("mg", "Largest bias of an accelerometer axis"),
    "accel_residual": MeasurementKind("mg", "RMS residual of the accelerometer calibration"),
    "field_magnitude_difference": MeasurementKind(
        "%", "Mean strength of the corrected field, at other poses, against the station's record"
    ),
    "level_max": MeasurementKind("deg", "Largest heading error of the module, level"),
    "level_rms": MeasurementKind("deg", "RMS heading error of the module, level"),
    "tilt_max": MeasurementKind("deg", "Largest heading error of the module, tilted"),
    "tilt_rms": MeasurementKind("deg", "RMS heading error of the module, tilted"),
    "achieved_level_max": MeasurementKind(
        "deg", "Largest heading error of the judged method, computed by the bench, level"
    ),
    "achieved_level_rms": MeasurementKind(
        "deg", "RMS heading error of the judged method, computed by the bench, level"
    ),
    "achieved_tilt_max": MeasurementKind(
        "deg", "Largest heading error of the judged method, computed by the bench, tilted"
    ),
    "achieved_tilt_rms": MeasurementKind(
        "deg", "RMS heading error of the judged method, computed by the bench, tilted"
    ),
    "behind_best": MeasurementKind(
        "deg", "Largest heading error of the judged method less that of the best method"
    ),
    "z_estimate_difference": MeasurementKind(
        "mG", "RMS of the estimated z against the checking axis, two-axis module"
    ),
    "seat_index_change": MeasurementKind(
        "", "Change of the seat's index against the station's file, over its U (E_n)"
    ),
    "seat_level_change": MeasurementKind(
        "", "Change of the seat's pitch or roll against the station's file, over its U (E_n)"
    ),
    "fixture_iron_change": MeasurementKind(
        "", "Change of the fixture's iron against the station's file, over its U (E_n)"
    ),
    "field_azimuth_change": MeasurementKind(
        "", "Change of the field's azimuth against the station's file, over its U (E_n)"
    ),
    "dip_change": MeasurementKind(
        "", "Change of the dip against the station's file, over its U (E_n)"
    ),
    "seating": MeasurementKind("deg", "Largest turn of one mounting against the others"),
    "repeatability": MeasurementKind("deg", "Pooled standard deviation of returns to a heading"),
    "closing_error": MeasurementKind("deg", "Shift between earlier and later returns"),
    "bench_against_module": MeasurementKind(
        "deg", "Bench's heading against the module's, same readings"
    ),
    "temperature_change": MeasurementKind("deg C", "Change between calibration and verification"),
}
