"""What `fit --json` prints: one method, or all of them ranked."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.fit import rows_of
from bench.calibration.fit_report import fit_report, fitted, split
from bench.calibration.methods import METHODS

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.calibration.fit import CalibrationData

KEYS = {
    "method", "samples", "cause", "message", "offset", "matrix", "field", "dip_deg",
    "extended_dip_deg", "covariance", "residual_rms", "chi2_reduced", "rank", "condition",
    "coverage", "predicted_heading_rms_deg", "extra", "order", "tilt_from",
}  # fmt: skip
WITH_HEADINGS = {"heading_error_deg", "orders"}


@pytest.fixture(scope="module")
def data(drawn: Callable[..., Any]) -> CalibrationData:
    """Readings of the 72 poses of a run."""
    readings: CalibrationData = drawn(1, soft=0.03).data
    return readings


@pytest.mark.parametrize("method", list(METHODS))
def test_report_has_the_agreed_keys_and_is_plain_json(data: CalibrationData, method: str) -> None:
    report = fit_report(data, method)
    assert set(report) == KEYS | WITH_HEADINGS | {"raw"}
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert set(report["heading_error_deg"]) == {"before", "after"}
    if report["cause"] is None:
        assert set(report["heading_error_deg"]["after"]) == {"rms", "max", "mean"}
        assert "body" in report["orders"]


def test_report_without_headings_fits_every_row(data: CalibrationData) -> None:
    report = fit_report(replace(data, azimuth_deg=None), "ellipsoid")
    assert set(report) == KEYS
    assert report["samples"] == 72


def test_report_of_a_refusal_has_a_cause_a_sentence_and_no_coefficients(
    data: CalibrationData,
) -> None:
    level = rows_of(data, np.arange(72) < 48)
    report = fit_report(level, "ellipsoid")
    assert report["cause"] == "tilt_too_small"
    assert report["offset"] is report["matrix"] is report["covariance"] is None
    assert report["heading_error_deg"]["after"] is report["tilt_from"] is None
    assert report["orders"] == {}
    assert "plane" in report["message"]
    assert fitted(level, "ellipsoid")[0].message == report["message"]


def test_single_readings_have_no_set_and_reset_and_the_sentence_says_it(
    data: CalibrationData,
) -> None:
    report = fit_report(data, "set_reset")
    assert report["cause"] == "no_set_reset"
    assert "set and reset" in report["message"]


def test_all_methods_are_ranked_in_one_object_with_raw_beside_them(data: CalibrationData) -> None:
    report = fit_report(data, "all")
    assert report["ranking"][0]["method"] == "truth_aided"
    assert {entry["method"] for entry in report["ranking"]} == set(METHODS)
    assert report["ranking"][-1]["cause"] is not None
    assert report["raw"]["tilt_rms_deg"] > 5.0
    errors = [entry["heading_error_deg"]["after"] for entry in report["ranking"]]
    rms_deg = [error["rms"] for error in errors if error is not None]
    assert rms_deg == sorted(rms_deg)
    assert json.loads(json.dumps(report, allow_nan=False)) == report


def test_one_method_borrows_the_tilt_as_it_does_among_all(data: CalibrationData) -> None:
    alone = fit_report(data, "soft_iron")
    among = next(
        entry for entry in fit_report(data, "all")["ranking"] if entry["method"] == "soft_iron"
    )
    assert alone["tilt_from"] == among["tilt_from"] == "accelerometer"
    assert alone["orders"] == among["orders"]


def test_another_order_of_compensation_is_for_study(data: CalibrationData) -> None:
    body, tilt_first = (fit_report(data, "truth_aided", order=o) for o in ("body", "tilt_first"))
    assert body["orders"] == tilt_first["orders"]
    assert tilt_first["order"] == "tilt_first"
    after = tilt_first["heading_error_deg"]["after"]
    assert after["rms"] > 10.0 * body["heading_error_deg"]["after"]["rms"]
    two_axis = fit_report(data, "two_axis_aided", order="tilt_first")
    assert two_axis["order"] == "body"
    assert list(two_axis["orders"]) == ["body"]
    assert two_axis["extended_dip_deg"] == pytest.approx(60.0, abs=3.0)


def test_blocks_of_twenty_rows_alternate(drawn: Callable[..., Any]) -> None:
    angles = np.column_stack([np.arange(100.0), np.zeros((100, 2))])
    used, judged = split(drawn(1, angles).data, "blocks")
    assert used.azimuth_deg.tolist() == [*range(20), *range(40, 60), *range(80, 100)]
    assert judged.azimuth_deg.tolist() == [*range(20, 40), *range(60, 80)]
    assert len(split(drawn(1, angles).data, "none")[0]) == 100


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"method": "magic"}, "method must be one of set_reset, min_max"),
        ({"method": "ellipsoid", "holdout": "thirds"}, "holdout must be one of"),
        ({"method": "min_max", "order": "scale"}, "order must be one of body, soft_first"),
    ],
)
def test_unknown_names_are_named(
    data: CalibrationData, options: dict[str, str], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        fit_report(data, **options)
