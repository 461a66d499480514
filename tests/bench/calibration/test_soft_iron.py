from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.level_kernel import CAUSES
from bench.calibration.soft_iron import (
    fit_soft_iron,
    soft_iron_batch,
)
from bench.reproduction.printed_formulas import forty_five_soft_iron, printed_soft_iron
from protocols.angles import wrap_180_deg

TURN = np.arange(0.0, 360.0, 1.0)
OFFSET = np.array([60.0, -40.0])


def stretched(theta_deg: float, ratio: float) -> np.ndarray:
    """Return symmetric soft iron, shape (2, 2): longer by `ratio` along theta."""
    axis = np.array([np.cos(np.deg2rad(theta_deg)), np.sin(np.deg2rad(theta_deg))])
    return np.eye(2) + (ratio - 1.0) * np.outer(axis, axis)


def readings_mg(iron: np.ndarray, headings_deg: np.ndarray = TURN) -> np.ndarray:
    turn = np.deg2rad(headings_deg)
    circle = 250.0 * np.stack([np.cos(turn), -np.sin(turn)], axis=-1)
    return OFFSET + circle @ iron.T


def largest_error_deg(level_mg: np.ndarray, headings_deg: np.ndarray = TURN) -> float:
    heading_deg = np.rad2deg(np.arctan2(-level_mg[..., 1], level_mg[..., 0]))
    return float(np.abs(wrap_180_deg(heading_deg - headings_deg)).max())


@pytest.mark.parametrize("theta_deg", [0.0, 20.0, 45.0, 90.0, 110.0, 179.0])
def test_ellipse_is_taken_out_whatever_its_axis_and_nothing_is_rotated(theta_deg: float) -> None:
    field_mg = readings_mg(stretched(theta_deg, 1.3))
    fit = soft_iron_batch(field_mg, 0.5, horizontal_mg=250.0)
    assert wrap_180_deg(2.0 * (fit.theta_deg - theta_deg)) == pytest.approx(0.0, abs=1e-6)
    assert fit.axis_ratio == pytest.approx(1.3)
    assert fit.offset_mg == pytest.approx(OFFSET)
    assert fit.corrected_mg(field_mg) == pytest.approx(readings_mg(np.eye(2)) - OFFSET, abs=1e-6)


def test_printed_scale_stretches_the_ellipse_further() -> None:
    """Konvalin (7): sigma = q/r and x divided by it: 16.3 deg of 8.2."""
    field_mg = readings_mg(stretched(0.0, 4.0 / 3.0))
    printed_mg = printed_soft_iron(field_mg).corrected_mg(field_mg)
    assert largest_error_deg(field_mg - OFFSET) == pytest.approx(8.2, abs=0.05)
    assert largest_error_deg(printed_mg) == pytest.approx(16.3, abs=0.05)
    assert largest_error_deg(soft_iron_batch(field_mg, 0.5).corrected_mg(field_mg)) < 1e-6


def test_printed_angle_mirrors_an_axis_in_the_second_quadrant() -> None:
    """Konvalin (4): arcsin(y1/r) has no x1: 110 deg count as 70, and 11.8 of 8.2 deg stay."""
    field_mg = readings_mg(stretched(110.0, 4.0 / 3.0))
    field_mg[250] += 1e-6 * (field_mg[250] - OFFSET)  # the farthest one lies at 110 deg
    printed = printed_soft_iron(field_mg)
    stretch, axes = np.linalg.eigh(printed.matrix)
    assert np.rad2deg(np.arctan(axes[1, 1] / axes[0, 1])) == pytest.approx(70.0)
    assert stretch[1] == pytest.approx(4.0 / 3.0, abs=1e-3)
    scaled = np.linalg.inv(printed.matrix)
    level_mg = (field_mg - printed.offset_mg) @ scaled.T
    assert largest_error_deg(level_mg) == pytest.approx(11.8, abs=0.05)


def test_forty_five_degrees_are_right_for_axes_at_45_deg_only() -> None:
    """Caruso: of 8.2 deg, 6.9 stay where the major axis is at 20 deg."""
    for theta_deg, left_deg in ((45.0, 0.0), (135.0, 0.0), (20.0, 6.9)):
        field_mg = readings_mg(stretched(theta_deg, 4.0 / 3.0))
        level_mg = forty_five_soft_iron(field_mg).corrected_mg(field_mg)
        assert largest_error_deg(level_mg) == pytest.approx(left_deg, abs=0.05)


def test_angle_and_ratio_lie_within_their_uncertainty() -> None:
    rng = np.random.default_rng(1)
    field_mg = readings_mg(stretched(130.0, 1.2), np.arange(0.0, 360.0, 15.0))
    fits = soft_iron_batch(field_mg + rng.normal(0.0, 2.0, (3000, 24, 2)), 2.0)
    assert (np.abs(fits.theta_deg - 130.0) < 2.0 * fits.theta_sd_deg).mean() > 0.94
    assert (np.abs(fits.axis_ratio - 1.2) < 2.0 * fits.axis_ratio_sd).mean() > 0.94
    assert fits.theta_sd_deg.mean() < 1.2 * np.std(fits.theta_deg)
    round_ = soft_iron_batch(readings_mg(np.eye(2)), 0.5)
    assert round_.theta_sd_deg == pytest.approx(51.96, abs=0.01)


def test_unequal_spacing_does_not_pull_the_ellipse() -> None:
    """Three quarters of the readings in a sixth of the turn, with noise of 2 % of the field."""
    rng = np.random.default_rng(2)
    headings = np.concatenate([np.arange(0.0, 360.0, 45.0), np.linspace(10.0, 70.0, 24)])
    iron = stretched(70.0, 1.2)
    noisy = readings_mg(iron, headings) + rng.normal(0.0, 5.0, (4000, 32, 2))
    fits = soft_iron_batch(noisy, 5.0, horizontal_mg=250.0)
    assert not fits.cause.any()
    assert fits.offset_mg.mean(axis=0) == pytest.approx(OFFSET, abs=0.15)
    assert fits.matrix.mean(axis=0) == pytest.approx(np.linalg.inv(iron), abs=1.5e-3)


def test_bias_by_noise_is_a_small_part_of_the_noise() -> None:
    """Noise makes every fitted circle a little larger, here by 1.7e-3, all around alike."""
    rng = np.random.default_rng(3)
    noisy = readings_mg(np.eye(2), np.arange(0.0, 360.0, 10.0)) + rng.normal(0, 12.5, (3000, 36, 2))
    matrix = soft_iron_batch(noisy, 12.5, horizontal_mg=250.0).matrix.mean(axis=0)
    assert matrix[0, 0] == pytest.approx(1.0, abs=3e-3)
    assert matrix[0, 0] - matrix[1, 1] == pytest.approx(0.0, abs=1e-3)
    assert matrix[0, 1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("span_deg", [120.0, 200.0, 280.0])
def test_a_part_of_a_turn_is_refused(span_deg: float) -> None:
    field_mg = readings_mg(stretched(20.0, 1.2), np.arange(0.0, span_deg, 10.0))
    assert CAUSES[soft_iron_batch(field_mg, 0.5).cause] == Cause.NO_TURN


def test_two_branches_of_a_hyperbola_are_refused() -> None:
    along = np.linspace(-1.5, 1.5, 20)
    branch = 100.0 * np.column_stack([np.cosh(along), np.sinh(along)])
    fit = soft_iron_batch(np.vstack([branch, -branch]), 0.5)
    assert CAUSES[fit.cause] in {Cause.DEGENERATE, Cause.NO_TURN}


def test_readings_off_any_ellipse_are_refused() -> None:
    square = np.clip(readings_mg(1.45 * np.eye(2)) - OFFSET, -252.0, 252.0)
    square += np.random.default_rng(1).normal(0.0, 40.0, square.shape)
    assert CAUSES[soft_iron_batch(square, 0.5).cause] == Cause.RESIDUAL_TOO_LARGE


def test_z_stays_and_the_station_sets_the_radius() -> None:
    field_mg = np.insert(readings_mg(stretched(20.0, 1.2)), 2, 433.0, axis=1)
    data = CalibrationData(field_mg=field_mg, station_field_mg=np.array([180.0, 0.0, 400.0]))
    fit = fit_soft_iron(data)
    level = fit.corrected_mg(field_mg)
    assert np.hypot(level[:, 0], level[:, 1]) == pytest.approx(np.full(360, 180.0))
    assert level[:, 2] == pytest.approx(np.full(360, 433.0))
    assert fit_soft_iron(replace(data, station_field_mg=None)).field_mg == pytest.approx(
        250.0 * np.sqrt(1.2)
    )
