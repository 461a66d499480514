from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.accelerometer import fit_accelerometer
from bench.calibration.fit import Cause, Fit
from bench.calibration.methods import fit_all, fit_named

if TYPE_CHECKING:
    from collections.abc import Callable


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


def test_a_refused_fit_has_nothing_to_correct_with() -> None:
    with pytest.raises(ValueError, match="was refused"):
        Fit(method="x", cause=Cause.TOO_FEW).corrected_mg(np.zeros(3))
