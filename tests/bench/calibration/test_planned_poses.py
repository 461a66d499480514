from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from bench.calibration.fit import Cause
from bench.calibration.methods import METHODS, fit_named
from bench.calibration.planned_poses import predict
from bench.pose import Attitude

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray


def attitudes(angles_deg: NDArray[np.float64]) -> list[Attitude]:
    return [Attitude(azimuth_deg=a, pitch_deg=p, roll_deg=r) for a, p, r in angles_deg]


@pytest.mark.parametrize("method", ["ellipsoid", "truth_aided", "accelerometer"])
def test_prediction_from_poses_is_that_of_the_fit_on_readings(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64], method: str
) -> None:
    data = drawn(1, soft=0.01).data
    prediction = predict(attitudes(eol_deg), method, data)
    fit = fit_named(method, data)
    assert prediction.cause is None
    assert prediction.rank == fit.rank
    assert prediction.condition == pytest.approx(fit.condition, rel=0.3)
    assert prediction.predicted_heading_rms_deg == pytest.approx(
        fit.predicted_heading_rms_deg, rel=0.35
    )


def test_level_plan_is_said_to_leave_12_of_24_unobserved(eol_deg: NDArray[np.float64]) -> None:
    prediction = predict(attitudes(eol_deg[:24]), "truth_aided")
    assert (prediction.cause, prediction.rank) == (Cause.TILT_TOO_SMALL, 12)
    assert prediction.predicted_heading_rms_deg is None
    assert predict(attitudes(eol_deg[:24]), "min_max").cause is None


def test_more_poses_and_less_noise_predict_a_smaller_error(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    few = predict(attitudes(eol_deg[::2]), "truth_aided", drawn(1).data)
    many = predict(attitudes(eol_deg), "truth_aided", drawn(1).data)
    quiet = predict(attitudes(eol_deg), "truth_aided", drawn(1, field_sd_mg=0.1).data)
    errors = [p.predicted_heading_rms_deg for p in (few, many, quiet)]
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.parametrize("method", list(METHODS))
def test_no_poses_are_refused(method: str) -> None:
    assert predict([], method).cause is not None


def test_unknown_method_is_named() -> None:
    with pytest.raises(ValueError, match="method must be one of set_reset, min_max"):
        predict([Attitude(azimuth_deg=0.0)], "guess")
