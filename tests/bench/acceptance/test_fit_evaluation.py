"""A fit against the station's record."""

from __future__ import annotations

import numpy as np
import pytest

from bench.acceptance.fit_evaluation import evaluate_fit
from bench.calibration.fit import Cause, Fit


def test_differences_from_the_station_are_absolute_and_wrap(site):
    fit = Fit(
        method="truth_aided", offset_mg=np.zeros(3), matrix=np.eye(3), residual_rms_mg=0.3,
        condition=12.0, dip_deg=59.8, field_mg=500.0, accel_residual_rms_g=0.0015,
        accel_offset_g=np.array([0.01, -0.03, 0.02]),
        extra={"field_azimuth_deg": 361.05, "field_magnitude_mg": 505.0},
    )  # fmt: skip

    found = {m.name: (m.value, m.unit) for m in evaluate_fit("fit", fit, site)}

    assert found["fit_accepted"] == (1.0, "")
    assert found["fit_residual"] == (0.3, "mG")
    assert found["field_azimuth_difference"] == (pytest.approx(0.2), "deg")
    assert found["dip_difference"] == (pytest.approx(0.2), "deg")
    assert found["sensitivity"] == (pytest.approx(101.0), "%")
    assert found["accel_bias"] == (pytest.approx(30.0), "mg")
    assert found["accel_residual"] == (pytest.approx(1.5), "mg")


def test_a_refused_fit_is_one_missed_measurement_with_its_reason(site):
    fit = Fit(method="ellipsoid", cause=Cause.DEGENERATE, message="no ellipsoid")

    (only,) = evaluate_fit("fit", fit, site)

    assert (only.name, only.value) == ("fit_accepted", 0.0)
    assert only.note == "ellipsoid: degenerate: no ellipsoid"


def test_what_a_method_does_not_give_is_not_measured(site):
    fit = Fit(method="min_max", offset_mg=np.zeros(3), matrix=np.eye(3), residual_rms_mg=4.0)

    names = [m.name for m in evaluate_fit("fit", fit, site)]

    assert names == ["fit_accepted", "fit_residual"]
