"""Heading errors of all methods on readings that none of them fitted."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.compensation import Order
from bench.calibration.fit import CalibrationData, Cause, Fit, rows_of
from bench.calibration.methods import METHODS, fit_all, fit_named
from bench.calibration.ranking import (
    LevelAndTilt,
    borrowed_tilt,
    expected_heading_deg,
    heading_error,
    is_level,
    rank,
    study,
)

if TYPE_CHECKING:
    from collections.abc import Callable

ORDERS = [str(order) for order in Order]


@pytest.fixture(scope="module")
def fitted(drawn: Callable[..., Any]) -> tuple[dict[str, Fit], CalibrationData]:
    truth = drawn(4, soft=0.03)
    clean = drawn(4, soft=0.03, field_sd_mg=0.0, accel_sd_g=0.0, rig_sd_deg=0.0)
    return fit_all(truth.data), clean.data


def test_the_study_has_raw_and_every_accepted_method_in_every_order(
    fitted: tuple[dict[str, Fit], CalibrationData],
) -> None:
    fits, data = fitted
    found = study(fits, data)
    accepted = [name for name, fit in fits.items() if not fit.refused]
    assert fits["set_reset"].cause is Cause.NO_SET_RESET
    assert list(found.orders) == list(found.tilt_from) == accepted
    for name in accepted:
        expected = ["body"] if name.startswith("two_axis") else ORDERS
        assert list(found.orders[name]) == expected
    best = found.orders["truth_aided"]["body"]
    assert best.tilt_rms_deg < 0.2 < 5.0 < found.raw.tilt_rms_deg
    assert found.orders["truth_aided"]["tilt_first"].tilt_rms_deg > 5.0
    plain = found.as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert set(plain["raw"]) == {f"{a}_{b}_deg" for a in ("level", "tilt") for b in ("rms", "max")}


def test_methods_without_an_accelerometer_borrow_its_tilt_and_say_so(
    fitted: tuple[dict[str, Fit], CalibrationData],
) -> None:
    fits, data = fitted
    found = study(fits, data)
    assert found.tilt_from["min_max"] == found.tilt_from["ellipsoid"] == "accelerometer"
    assert found.tilt_from["tilt_aided"] == "accelerometer"
    assert found.tilt_from["truth_aided"] == found.tilt_from["accelerometer"] == "own"
    borrowed = heading_error(data, fits["soft_iron"], tilt=fits["accelerometer"])
    alone = heading_error(data, fits["soft_iron"])
    told = found.orders["soft_iron"]["body"]
    assert max(told.level_max_deg, told.tilt_max_deg) == pytest.approx(borrowed.max_deg)
    assert told.level_rms_deg < alone.rms_deg
    assert found.raw.level_max_deg == study({}, data).raw.level_max_deg


def test_a_fit_against_the_raw_force_keeps_the_raw_tilt(
    fitted: tuple[dict[str, Fit], CalibrationData], drawn: Callable[..., Any]
) -> None:
    fits, data = fitted
    read = drawn(4, soft=0.03).data
    raw = fit_named("tilt_aided", replace(read, azimuth_deg=None))
    assert (raw.accel_from, raw.accel_matrix) == ("raw", None)
    assert borrowed_tilt(raw, fits, data) == ("raw", None)


def test_the_lender_is_the_first_accepted_one(
    fitted: tuple[dict[str, Fit], CalibrationData],
) -> None:
    fits, data = fitted
    refused = Fit(method="accelerometer", cause=Cause.TOO_FEW)
    without = {**fits, "accelerometer": refused}
    assert borrowed_tilt(fits["min_max"], without, data) == ("truth_aided", fits["truth_aided"])
    assert borrowed_tilt(fits["min_max"], {"accelerometer": refused}, data) == ("raw", None)
    assert borrowed_tilt(None, fits, data) == ("raw", None)
    assert borrowed_tilt(fits["min_max"], fits, replace(data, accel_g=None)) == ("given", None)


def test_level_means_pitch_and_roll_below_one_degree(drawn: Callable[..., Any]) -> None:
    angles = np.array([[0, 0.99, -0.99], [0, 1.0, 0.0], [0, 0.0, 1.01], [0, 0.0, 30.0]])
    data = drawn(1, angles, accel_sd_g=0.0, rig_sd_deg=0.0).data
    assert is_level(data).tolist() == [True, False, False, False]
    bare = replace(data, pitch_deg=None, roll_deg=None, accel_g=None)
    assert is_level(bare).all()


def test_rows_that_are_missing_are_none_and_not_zero(
    fitted: tuple[dict[str, Fit], CalibrationData],
) -> None:
    fits, data = fitted
    only_level = replace(
        data,
        **{
            name: getattr(data, name)[:24]
            for name in ("field_mg", "accel_g", "azimuth_deg", "pitch_deg", "roll_deg")
        },
    )
    found = study(fits, only_level)
    assert found.raw.tilt_rms_deg is found.raw.tilt_max_deg is None
    assert isinstance(found.raw, LevelAndTilt)
    assert found.raw.level_rms_deg > 1.0


def test_the_reference_is_the_rig_s_azimuth_from_magnetic_north(drawn: Callable[..., Any]) -> None:
    data = drawn(1, azimuth_deg=0.0).data
    turned = replace(data, station_field_mg=np.array([0.0, 250.0, 433.0]))
    assert expected_heading_deg(turned) == pytest.approx(np.mod(data.azimuth_deg - 90.0, 360.0))
    with pytest.raises(ValueError, match="azimuth_deg must be given"):
        study({}, replace(data, azimuth_deg=None))


def test_ranking_follows_the_order_of_compensation_that_is_asked_for(
    fitted: tuple[dict[str, Fit], CalibrationData],
) -> None:
    fits, data = fitted
    assert set(fits) == set(METHODS)
    body = rank(list(fits.values()), data)
    assert body[0].fit.method == "truth_aided"
    assert body[0].tilt_from == "own"
    assert body[-1].fit.refused
    assert rank(list(fits.values()), data, order=Order.TILT_FIRST)[0].fit.two_axis


def test_raw_is_far_worse_and_the_ranking_is_by_error(
    fitted: tuple[dict[str, Fit], CalibrationData],
) -> None:
    fits, data = fitted
    errors = [entry.error.rms_deg for entry in rank(list(fits.values()), data) if entry.error]
    assert errors == sorted(errors)
    assert heading_error(data, None).max_deg > 10.0


def test_refused_fits_come_last(drawn: Callable[..., Any]) -> None:
    data = rows_of(drawn(1, soft=0.03).data, np.arange(72) < 48)
    ranked = rank(list(fit_all(data).values()), data)
    refused = [entry.fit.refused for entry in ranked]
    assert refused == sorted(refused)
    assert {entry.fit.method for entry in ranked if not entry.fit.refused} >= {
        "min_max", "soft_iron", "four_position",
    }  # fmt: skip


def test_without_truth_a_fit_that_predicts_nothing_stands_before_a_refused_one() -> None:
    refused, unpredicted = Fit(method="ellipsoid", cause=Cause.TOO_FEW), Fit(method="set_reset")
    ranked = rank([refused, unpredicted], CalibrationData(field_mg=np.zeros((4, 3))))
    assert [entry.fit.method for entry in ranked] == ["set_reset", "ellipsoid"]


def test_without_truth_the_predicted_error_ranks(
    fitted: tuple[dict[str, Fit], CalibrationData],
) -> None:
    fits, data = fitted
    ranked = rank(list(fits.values()), replace(data, azimuth_deg=None))
    assert ranked[0].error is None
    told = [entry.fit.predicted_heading_rms_deg for entry in ranked if not entry.fit.refused]
    assert told == sorted(told)
    assert ranked[-1].fit.refused
