from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.accelerometer import fit_accelerometer
from bench.calibration.fit import Cause, Fit
from bench.calibration.fit_report import fit_report, fitted, split
from bench.calibration.methods import METHODS, fit_all, fit_named, heading_error, rank, rows_of

if TYPE_CHECKING:
    from collections.abc import Callable

KEYS = {
    "method", "samples", "cause", "offset", "matrix", "field", "dip_deg", "covariance",
    "residual_rms", "chi2_reduced", "rank", "condition", "coverage", "predicted_heading_rms_deg",
}  # fmt: skip


def test_truth_aided_ranks_first_and_raw_is_far_worse(drawn: Callable[..., Any]) -> None:
    truth = drawn(4)
    ranked = rank(fit_all(truth.data), drawn(4).data)
    assert ranked[0].fit.method == "truth_aided"
    assert ranked[0].error.rms_deg < 0.3
    assert heading_error(truth.data, None).max_deg > 10.0
    errors = [entry.error.rms_deg for entry in ranked if entry.error]
    assert errors == sorted(errors)


def test_refused_fits_come_last(drawn: Callable[..., Any]) -> None:
    data = rows_of(drawn(1).data, np.arange(72) < 48)
    ranked = rank(fit_all(data), data)
    assert [entry.fit.refused for entry in ranked] == [False, True, True, True]


def test_without_truth_the_predicted_error_ranks(drawn: Callable[..., Any]) -> None:
    data = replace(drawn(1).data, azimuth_deg=None)
    ranked = rank(fit_all(data), data)
    assert ranked[0].error is None
    assert not ranked[0].fit.refused
    assert ranked[-1].fit.refused


def test_values_that_are_not_finite_are_refused_by_name_and_row(drawn: Callable[..., Any]) -> None:
    data = drawn(1).data
    data.accel_g[7, 1] = np.inf
    with pytest.raises(ValueError, match=r"accel_g must be finite .* inf in row 7"):
        fit_all(data)
    with pytest.raises(ValueError, match="pitch_deg must have 72 rows"):
        fit_named("min_max", replace(drawn(1).data, pitch_deg=np.zeros(3)))


def test_accelerometer_alone_agrees_with_the_truth(drawn: Callable[..., Any]) -> None:
    truth = drawn(3, north_deg=0.1, east_deg=0.05)
    fit = fit_accelerometer(truth.data)
    assert fit.accel_offset_g == pytest.approx(truth.accel_offset_g, abs=0.003)
    assert fit.accel_matrix @ truth.accel_gain == pytest.approx(np.eye(3), abs=0.003)
    assert fit.extra["base_level_north_deg"] == pytest.approx(0.1, abs=0.03)
    assert fit.matrix.tolist() == np.eye(3).tolist()


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"accel_g": None}, Cause.NO_ACCELERATION),
        ({"azimuth_deg": None}, Cause.NO_TRUTH),
        ({"pitch_deg": np.zeros(72), "roll_deg": np.zeros(72)}, Cause.NOT_OBSERVABLE),
        ({"accel_g": np.tile([0.0, 0.0, -1.0], (72, 1))}, Cause.DEGENERATE),
    ],
)
def test_accelerometer_refuses_what_it_cannot_fit(
    drawn: Callable[..., Any], change: dict[str, Any], cause: Cause
) -> None:
    assert fit_accelerometer(replace(drawn(1).data, **change)).cause == cause


@pytest.mark.parametrize("method", list(METHODS))
def test_report_has_the_agreed_keys_and_is_plain_json(
    drawn: Callable[..., Any], method: str
) -> None:
    report = fit_report(drawn(1).data, method)
    assert set(report) == {*KEYS, "heading_error_deg"}
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert set(report["heading_error_deg"]) == {"before", "after"}
    assert set(report["heading_error_deg"]["after"]) == {"rms", "max", "mean"}


def test_report_without_headings_fits_every_row(drawn: Callable[..., Any]) -> None:
    data = replace(drawn(1).data, azimuth_deg=None)
    report = fit_report(data, "ellipsoid")
    assert set(report) == KEYS
    assert report["samples"] == 72


def test_report_of_a_refusal_has_a_cause_and_no_coefficients(drawn: Callable[..., Any]) -> None:
    data = rows_of(drawn(1).data, np.arange(72) < 48)
    report = fit_report(data, "ellipsoid")
    assert report["cause"] == "tilt_too_small"
    assert report["offset"] is report["matrix"] is report["covariance"] is None
    assert report["heading_error_deg"]["after"] is None
    assert "plane" in fitted(data, "ellipsoid")[0].message


def test_all_methods_are_ranked_in_one_object(drawn: Callable[..., Any]) -> None:
    report = fit_report(drawn(1).data, "all")
    assert [entry["method"] for entry in report["ranking"]][0] == "truth_aided"
    assert {entry["method"] for entry in report["ranking"]} == set(METHODS)


def test_blocks_of_twenty_rows_alternate(drawn: Callable[..., Any]) -> None:
    angles = np.column_stack([np.arange(100.0), np.zeros((100, 2))])
    used, judged = split(drawn(1, angles).data, "blocks")
    assert used.azimuth_deg.tolist() == [*range(20), *range(40, 60), *range(80, 100)]
    assert judged.azimuth_deg.tolist() == [*range(20, 40), *range(60, 80)]
    assert len(split(drawn(1, angles).data, "none")[0]) == 100


def test_unknown_holdout_and_method_are_named(drawn: Callable[..., Any]) -> None:
    with pytest.raises(ValueError, match="holdout must be one of"):
        fit_report(drawn(1).data, "ellipsoid", holdout="thirds")
    with pytest.raises(ValueError, match="method must be one of"):
        fit_report(drawn(1).data, "magic")


def test_a_refused_fit_has_nothing_to_correct_with() -> None:
    with pytest.raises(ValueError, match="was refused"):
        Fit(method="x", cause=Cause.TOO_FEW).corrected_mg(np.zeros(3))
