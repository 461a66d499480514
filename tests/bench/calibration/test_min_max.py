from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.level_kernel import largest_gap_deg
from bench.calibration.min_max import fit_min_max, min_max_batch
from bench.calibration.ranking import heading_error

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


def turn_mg(headings_deg: NDArray[np.float64], x_gain: float = 1.0) -> NDArray[np.float64]:
    turn = np.deg2rad(headings_deg)
    return np.column_stack(
        [
            90.0 + 250.0 * x_gain * np.cos(turn),
            -40.0 - 250.0 * np.sin(turn),
            433.0 + 0.0 * turn,
        ]
    )


FULL = np.arange(0.0, 360.0, 15.0)


def test_hard_iron_and_unequal_gains_of_a_level_turn_are_removed() -> None:
    data = CalibrationData(field_mg=turn_mg(FULL, 1.3), azimuth_deg=FULL)
    fit = fit_min_max(data)
    assert fit.offset_mg == pytest.approx([90.0, -40.0, 0.0])
    assert heading_error(data, None).max_deg > 20.0
    assert heading_error(data, fit).max_deg < 1e-6


def test_station_sets_the_amplitude() -> None:
    station = np.array([180.0, 0.0, 400.0])
    fit = fit_min_max(CalibrationData(field_mg=turn_mg(FULL), station_field_mg=station))
    corrected = fit.corrected_mg(turn_mg(FULL))
    assert np.hypot(corrected[:, 0], corrected[:, 1]) == pytest.approx(np.full(24, 180.0))
    assert corrected[:, 2] == pytest.approx(np.full(24, 433.0))


def test_tilted_rows_are_left_out(drawn: Callable[..., Any]) -> None:
    data = drawn(1, soft=0.02).data
    assert fit_min_max(data).samples == 48
    assert fit_min_max(replace(data, pitch_deg=None, roll_deg=None)).samples == 48


@pytest.mark.parametrize("headings", [FULL[:12], FULL[:16], FULL[FULL < 200]])
def test_a_turn_with_a_gap_is_refused(headings: NDArray[np.float64]) -> None:
    assert fit_min_max(CalibrationData(field_mg=turn_mg(headings))).cause == Cause.NO_TURN


def test_no_motion_a_stuck_axis_and_too_few_rows_are_refused() -> None:
    still = np.random.default_rng(1).normal(0, 0.3, (50, 3)) + [100, 0, 400]
    assert fit_min_max(CalibrationData(field_mg=still)).refused
    stuck = turn_mg(FULL)
    stuck[:, 1] = 5.0
    assert fit_min_max(CalibrationData(field_mg=stuck)).cause == Cause.DEGENERATE
    assert fit_min_max(CalibrationData(field_mg=turn_mg(FULL[:3]))).cause == Cause.TOO_FEW


def test_readings_that_are_no_circle_are_refused() -> None:
    rng = np.random.default_rng(1)
    field = rng.normal(0, 200, (500, 3))
    assert fit_min_max(CalibrationData(field_mg=field)).cause == Cause.RESIDUAL_TOO_LARGE


def test_prediction_follows_the_noise() -> None:
    rng = np.random.default_rng(1)
    noisy = turn_mg(FULL) + rng.normal(0, 0.5, (24, 3))
    fit = fit_min_max(CalibrationData(field_mg=noisy))
    assert 0.03 < fit.predicted_heading_rms_deg < 0.3
    assert fit.predicted_heading_max_deg > fit.predicted_heading_rms_deg


def test_gap_closes_round_the_circle() -> None:
    unit = np.column_stack([np.cos(np.deg2rad(FULL)), np.sin(np.deg2rad(FULL))])
    assert largest_gap_deg(unit) == pytest.approx(15.0)


def test_extremes_of_a_dense_noisy_turn_lie_outside_on_both_axes_alike() -> None:
    """Two standard deviations of amplitude for a thousand readings; offset and ratio stay."""
    rng = np.random.default_rng(1)
    dense = turn_mg(np.arange(0.0, 360.0, 0.36))[:, :2] + rng.normal(0, 1.0, (500, 1000, 2))
    fits = min_max_batch(dense, 1.0)
    assert not fits.cause.any()
    assert fits.amplitude_mg.mean(axis=0) == pytest.approx([251.9, 251.9], abs=0.3)
    assert fits.offset_mg.mean(axis=0) == pytest.approx([90.0, -40.0], abs=0.1)
    ratio = fits.amplitude_mg[:, 0] / fits.amplitude_mg[:, 1]
    assert ratio.mean() == pytest.approx(1.0, abs=3e-4)


def test_what_a_coarse_turn_misses_of_the_extremes_is_in_the_covariance() -> None:
    """Seven uneven headings miss an extreme by up to 10 deg of turn: 4 mG of 250."""
    headings = np.array([8.0, 62.0, 100.0, 155.0, 201.0, 262.0, 310.0])
    fits = min_max_batch(turn_mg(headings)[:, :2], 0.05)
    sigma = np.sqrt(np.diag(fits.covariance))
    errors = np.append(fits.offset_mg - [90.0, -40.0], fits.amplitude_mg - 250.0)
    assert np.abs(errors).max() > 1.0
    assert (np.abs(errors) < 2.0 * sigma).all()
    even = min_max_batch(turn_mg(FULL)[:, :2], 0.05)
    assert np.sqrt(np.diag(even.covariance)).max() < 0.1
