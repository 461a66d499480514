from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.four_position import (
    fit_four_position,
    four_position_batch,
)
from bench.calibration.level_kernel import CAUSES
from bench.calibration.ranking import heading_error
from bench.reproduction.printed_formulas import printed_four_position
from protocols.angles import wrap_180_deg

QUARTERS = np.arange(0.0, 360.0, 90.0)
STARTS = np.arange(0.0, 360.0, 5.0)


def readings_mg(
    headings_deg: np.ndarray, *, y_gain: float = 0.8, second_mg: float = 0.0
) -> np.ndarray:
    """Return x and y with hard iron (40, -30) mG, unequal gains and a second harmonic of x."""
    turn = np.deg2rad(headings_deg)
    x = 40.0 + 250.0 * np.cos(turn) + second_mg * np.cos(2.0 * turn)
    return np.stack([x, -30.0 - 250.0 * y_gain * np.sin(turn)], axis=-1)


def data_at(headings_deg: np.ndarray, **known: object) -> CalibrationData:
    field = np.insert(readings_mg(headings_deg), 2, 433.0, axis=1)
    return replace(CalibrationData(field_mg=field, azimuth_deg=headings_deg), **known)


def test_any_start_angle_gives_the_same_offset_and_amplitude() -> None:
    fits = four_position_batch(readings_mg(STARTS[:, None] + QUARTERS), 0.5)
    assert not fits.cause.any()
    assert fits.offset_mg == pytest.approx(np.tile([40.0, -30.0], (72, 1)))
    assert fits.amplitude_mg == pytest.approx(np.tile([250.0, 200.0], (72, 1)))
    assert wrap_180_deg(fits.alpha_deg[:, 0] - STARTS - 90.0) == pytest.approx(0.0, abs=1e-9)


def test_printed_formula_drops_the_scale_at_half_of_all_start_angles() -> None:
    """Skula (5)-(7) with Ay/Ax = 0.8: up to 6.4 deg at 36 of 72 start angles off the axes."""
    printed = printed_four_position(readings_mg(STARTS[:, None] + 2.5 + QUARTERS))
    dropped = (printed.matrix[:, [0, 1], [0, 1]] == 1.0).all(axis=-1)
    assert dropped.sum() == 36
    turn = np.arange(0.0, 360.0, 1.0)
    level = printed.corrected_mg(readings_mg(turn))
    off_deg = wrap_180_deg(np.rad2deg(np.arctan2(-level[..., 1], level[..., 0])) - turn)
    assert np.abs(off_deg[dropped]).max(axis=1) == pytest.approx(np.full(36, 6.38), abs=0.01)
    assert np.abs(off_deg[~dropped]).max() < 1e-6


def test_printed_formula_has_no_value_where_alpha_is_zero() -> None:
    flat = np.array([[100.0, 0.0], [250.0, 100.0], [100.0, 0.0], [-50.0, -100.0]])
    assert np.isnan(printed_four_position(flat).matrix[0, 0])
    assert np.isfinite(four_position_batch(flat, 0.5, largest_misclosure=1.0).matrix).all()


def test_a_second_harmonic_reaches_the_printed_offset_only() -> None:
    turned = readings_mg(STARTS[:, None] + QUARTERS, second_mg=8.0)
    mean = four_position_batch(turned, 0.5, largest_misclosure=0.1)
    assert not mean.cause.any()
    assert mean.offset_mg[:, 0] == pytest.approx(np.full(72, 40.0))
    assert np.ptp(printed_four_position(turned).offset_mg[:, 0]) == pytest.approx(16.0, abs=0.1)
    assert CAUSES[four_position_batch(turned[0], 0.5).cause] == Cause.POSITIONS_NOT_SQUARE


def test_the_first_row_and_its_quarters_are_taken_from_a_longer_turn() -> None:
    """Whatever the order and wherever the cable has wound the azimuth to."""
    headings = np.array([20.0, 200.0, 45.0, 290.0, 470.0, 110.3, 60.0])
    fit = fit_four_position(data_at(headings))
    assert fit.samples == 4
    assert fit.offset_mg == pytest.approx([40.0, -30.0, 0.0])
    assert heading_error(data_at(headings), fit).max_deg < 1e-6
    assert fit.extra["alpha_x_deg"] == pytest.approx(110.0)


@pytest.mark.parametrize(
    "headings",
    [[0.0, 90.0, 180.0, 273.0], [0.0, 85.0, 180.0, 270.0], [0.0, 60.0, 120.0, 180.0]],
)
@pytest.mark.parametrize("known", [True, False])
def test_positions_that_are_not_square_are_refused_with_and_without_azimuths(
    headings: list[float], *, known: bool
) -> None:
    data = data_at(np.array(headings), **({} if known else {"azimuth_deg": None}))
    fit = fit_four_position(data)
    assert fit.cause == Cause.POSITIONS_NOT_SQUARE
    assert "90 deg apart" in fit.message or "quarter turn" in fit.message


def test_rows_without_azimuths_are_taken_in_order_or_by_fours() -> None:
    for headings in (QUARTERS + 33.0, np.arange(33.0, 393.0, 15.0)):
        fit = fit_four_position(data_at(headings, azimuth_deg=None))
        assert fit.offset_mg == pytest.approx([40.0, -30.0, 0.0])
    five = data_at(np.arange(0.0, 360.0, 72.0), azimuth_deg=None)
    assert fit_four_position(five).cause == Cause.POSITIONS_NOT_SQUARE


def test_square_positions_with_readings_that_are_not_mean_a_changed_field() -> None:
    data = data_at(QUARTERS)
    field_mg = data.field_mg.copy()
    field_mg[3] += [40.0, 0.0, 0.0]
    fit = fit_four_position(replace(data, field_mg=field_mg))
    assert fit.cause == Cause.FIELD_DISTURBED
    assert "positions are square" in fit.message


def test_axes_far_from_square_need_another_method() -> None:
    data = data_at(QUARTERS + 10.0)
    field_mg = data.field_mg.copy()
    field_mg[:, 1] += 0.5 * field_mg[:, 0]
    assert fit_four_position(replace(data, field_mg=field_mg)).cause == Cause.RESIDUAL_TOO_LARGE


def test_a_rig_that_did_not_turn_is_said() -> None:
    assert fit_four_position(data_at(np.full(6, 12.0))).cause == Cause.NO_TURN


def test_one_extreme_read_twice_is_saturation() -> None:
    clipped = np.minimum(readings_mg(QUARTERS + 40.0), [150.0, 1e3])
    assert CAUSES[four_position_batch(clipped, 0.5).cause] == Cause.SATURATED


def test_errors_of_the_positions_are_in_the_covariance() -> None:
    rng = np.random.default_rng(1)
    off_deg = rng.normal(0.0, 0.3, (4000, 4))
    fits = four_position_batch(
        readings_mg(QUARTERS + 25.0 + off_deg), 0.05, position_sd_deg=0.3, largest_misclosure=0.1
    )
    quiet = four_position_batch(readings_mg(QUARTERS + 25.0), 0.05, position_sd_deg=0.3)
    errors = np.hstack([fits.offset_mg, fits.amplitude_mg]) - [40.0, -30.0, 250.0, 200.0]
    assert np.cov(errors.T) == pytest.approx(quiet.covariance, abs=0.03)


def test_more_or_fewer_than_four_positions_are_named() -> None:
    with pytest.raises(ValueError, match=r"field_mg must have the shape \(..., 4, 2\)"):
        four_position_batch(readings_mg(np.arange(0.0, 360.0, 60.0)), 0.5)
