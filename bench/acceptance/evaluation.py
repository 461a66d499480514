"""Every judged number that comes from samples, in one place for the run and for `judge`.

The functions live by subject in `sensor_evaluation` (noise, set/reset, senses, sweep),
`fit_evaluation` and `heading_evaluation` (verification, returns, agreement, temperature).
They are pure: the same READING arrays, poses, fits and station give the same measurements.
`MEASUREMENTS` names all measurements of a run with unit and meaning.
"""

from __future__ import annotations

from bench.acceptance.catalogue import MEASUREMENTS, MeasurementKind
from bench.acceptance.fit_evaluation import evaluate_fit
from bench.acceptance.heading_evaluation import (
    achieved_heading,
    bench_heading_deg,
    evaluate_agreement,
    evaluate_field_strength,
    evaluate_raw_heading,
    evaluate_returns,
    evaluate_temperature,
    evaluate_verification,
    ranking,
)
from bench.acceptance.sensor_evaluation import (
    evaluate_noise,
    evaluate_peaks,
    evaluate_senses,
    evaluate_set_reset,
    evaluate_sweep,
)
from bench.acceptance.site import (
    SiteField,
    calibration_data,
    field_rig_mg,
    heading_error_deg,
    is_level,
    reference_heading_deg,
)

__all__ = [
    "MEASUREMENTS",
    "MeasurementKind",
    "SiteField",
    "achieved_heading",
    "bench_heading_deg",
    "calibration_data",
    "evaluate_agreement",
    "evaluate_field_strength",
    "evaluate_fit",
    "evaluate_noise",
    "evaluate_peaks",
    "evaluate_raw_heading",
    "evaluate_returns",
    "evaluate_senses",
    "evaluate_set_reset",
    "evaluate_sweep",
    "evaluate_temperature",
    "evaluate_verification",
    "field_rig_mg",
    "heading_error_deg",
    "is_level",
    "ranking",
    "reference_heading_deg",
]
