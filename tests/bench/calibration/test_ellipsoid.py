from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.ellipsoid import fit_ellipsoid
from bench.calibration.fit import CalibrationData, Cause, rows_of
from bench.calibration.sphere_model import sphere_rows
from bench.calibration.taubin import taubin_batch

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

SHAPE = np.array([[1.1, 0.05, -0.02], [0.05, 0.9, 0.03], [-0.02, 0.03, 1.0]])
OFFSET = np.array([120.0, -60.0, 30.0])


def readings_mg(
    count: int, noise_mg: float, seed: int = 1, cap: float = -1.0
) -> NDArray[np.float64]:
    """Readings of a 500 mG field in random directions whose x is above `cap`."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(400 * count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions[directions[:, 0] > cap][:count]
    return 500.0 * directions @ np.linalg.inv(SHAPE) + OFFSET + rng.normal(0, noise_mg, (count, 3))


def test_given_no_noise_when_fitted_then_offset_and_symmetric_matrix_are_exact() -> None:
    fit = fit_ellipsoid(CalibrationData(field_mg=readings_mg(50, 0.0)))
    scale = np.linalg.det(SHAPE) ** (1 / 3)
    assert fit.offset_mg == pytest.approx(OFFSET, abs=1e-4)
    assert fit.matrix == pytest.approx(SHAPE / scale, abs=1e-6)
    assert fit.field_mg == pytest.approx(500.0 / scale, abs=1e-3)


def test_station_field_sets_the_sphere_s_radius() -> None:
    station = np.array([300.0, 0.0, 400.0])
    data = CalibrationData(field_mg=readings_mg(50, 0.0), station_field_mg=station)
    assert np.linalg.norm(fit_ellipsoid(data).corrected_mg(data.field_mg), axis=1) == pytest.approx(
        np.full(50, 500.0), abs=1e-3
    )


def test_errors_match_the_covariance_over_many_draws() -> None:
    squares = []
    for seed in range(60):
        fit = fit_ellipsoid(CalibrationData(field_mg=readings_mg(60, 0.5, seed)))
        squares.append((fit.offset_mg - OFFSET) ** 2 / np.diag(fit.covariance)[6:])
    assert np.mean(squares) == pytest.approx(1.0, abs=0.35)


def test_taubin_start_is_nearly_unbiased_at_one_percent_of_noise() -> None:
    unit = (readings_mg(4000, 5.0) - OFFSET) / 500.0
    start = taubin_batch((unit - unit.mean(axis=0))[None])
    assert start.matrix[0] == pytest.approx(SHAPE, abs=3e-3)
    assert start.centre[0] + unit.mean(axis=0) == pytest.approx(np.zeros(3), abs=2e-3)


def test_sampson_residual_is_the_distance_near_a_unit_sphere() -> None:
    points = np.array([[1.001, 0, 0], [0, -0.998, 0]])
    residual, _ = sphere_rows(np.eye(3)[None], np.zeros((1, 3)), points[None], np.ones(1))
    assert residual[0] == pytest.approx([0.001, -0.002], abs=1e-5)


def test_level_readings_are_refused(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    fit = fit_ellipsoid(rows_of(drawn(1).data, np.abs(eol_deg[:, 1:]).max(axis=1) == 0))
    assert fit.cause == Cause.TILT_TOO_SMALL
    assert fit.matrix is None


def test_level_and_one_tilt_are_refused(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    fit = fit_ellipsoid(rows_of(drawn(1).data, (eol_deg[:, 1] >= 0) & (eol_deg[:, 2] == 0)))
    assert fit.cause in {Cause.DEGENERATE, Cause.NOT_OBSERVABLE}


@pytest.mark.parametrize("noise_mg", [0.0, 0.1, 0.35, 5.0])
@pytest.mark.parametrize("seed", range(25))
def test_two_rings_are_refused_although_a_wrong_ellipsoid_fits_them(
    seed: int, noise_mg: float
) -> None:
    """Parallel rings lie on a family of ellipsoids; the noise picks one hundreds of mG off."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0.0, 2.0 * np.pi, 48)
    height = np.where(np.arange(48) % 2, 0.87, 0.6)
    across = np.sqrt(1.0 - height**2)
    directions = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    field = 500.0 * directions @ np.linalg.inv(SHAPE) + OFFSET
    fit = fit_ellipsoid(CalibrationData(field_mg=field + rng.normal(0.0, noise_mg, field.shape)))
    assert fit.cause in {Cause.DEGENERATE, Cause.NOT_OBSERVABLE, Cause.NOT_CONVERGED}
    assert fit.matrix is None


def test_clustered_readings_are_refused() -> None:
    fit = fit_ellipsoid(CalibrationData(field_mg=readings_mg(60, 0.5, cap=0.985)))
    assert fit.cause in {Cause.NOT_OBSERVABLE, Cause.DEGENERATE}
    assert fit.message


def test_readings_at_rest_are_refused() -> None:
    rest = np.tile([100.0, 20.0, 400.0], (50, 1))
    assert fit_ellipsoid(CalibrationData(field_mg=rest)).cause == Cause.NO_TURN
    noisy = rest + np.random.default_rng(1).normal(0, 0.5, rest.shape)
    assert fit_ellipsoid(CalibrationData(field_mg=noisy)).refused


def test_too_few_readings_and_none_at_all_are_refused() -> None:
    for count in (8, 0):
        data = CalibrationData(field_mg=readings_mg(8, 0.1)[:count])
        assert fit_ellipsoid(data).cause == Cause.TOO_FEW


def test_readings_beyond_any_magnetometer_are_refused_and_named() -> None:
    fit = fit_ellipsoid(CalibrationData(field_mg=1e9 * readings_mg(30, 0.1)))
    assert fit.cause == Cause.NO_TURN
    assert "beyond 1e+07 mG" in fit.message


def test_without_a_station_the_prediction_is_for_the_dip_that_the_accelerometer_sees(
    drawn: Callable[..., Any],
) -> None:
    steep, flat = (
        fit_ellipsoid(replace(drawn(1, dip_deg=dip, soft=0.0).data, station_field_mg=None))
        for dip in (75.0, 20.0)
    )
    assert steep.predicted_heading_rms_deg > 2.0 * flat.predicted_heading_rms_deg


def test_a_moving_iron_is_refused_as_disturbed_field() -> None:
    field = readings_mg(300, 0.5)
    phase = np.linspace(0, 20, 300)
    field = field + 300.0 * np.sin(phase)[:, None] * np.array([1.0, -1.0, 0.5])
    fit = fit_ellipsoid(CalibrationData(field_mg=field))
    assert fit.cause in {Cause.FIELD_DISTURBED, Cause.RESIDUAL_TOO_LARGE}


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("cap", [0.3, 0.7, 0.9, 0.97])
def test_no_draw_gives_a_hyperboloid_or_a_value_that_is_not_finite(seed: int, cap: float) -> None:
    fit = fit_ellipsoid(CalibrationData(field_mg=readings_mg(12, 5.0, seed, cap)))
    if fit.refused:
        assert fit.message
        return
    assert np.isfinite(fit.covariance).all()
    assert (np.linalg.eigvalsh(fit.matrix) > 0).all()
    assert fit.predicted_heading_rms_deg <= 3.0


def test_dip_is_told_where_there_is_an_accelerometer(drawn: Callable[..., Any]) -> None:
    data = drawn(1, soft=0.0).data
    assert fit_ellipsoid(data).dip_deg == pytest.approx(60.0, abs=2.5)
    assert fit_ellipsoid(replace(data, accel_g=None)).dip_deg is None


STATION = np.array([300.0, 0.0, 400.0])


@pytest.mark.parametrize("size_mg", [6.0, 60.0, 400.0])
@pytest.mark.parametrize("noise_known", [True, False])
def test_a_few_disturbed_poses_are_named_and_left_out(size_mg: float, noise_known: bool) -> None:
    field = readings_mg(60, 0.35)
    clean = fit_ellipsoid(
        CalibrationData(field_mg=np.delete(field, [8, 30], axis=0), field_sd_mg=0.35)
    )
    outward = field[[8, 30]] - OFFSET
    field[[8, 30]] += [[size_mg], [-size_mg]] * outward / np.linalg.norm(outward, axis=1)[:, None]
    data = CalibrationData(field_mg=field, field_sd_mg=0.35, noise_known=noise_known)
    fit = fit_ellipsoid(data)
    assert "left out as disturbed: poses 8 by " in fit.message
    assert [name for name in fit.extra if name.endswith("sigmas")] == [
        "disturbed_8_sigmas",
        "disturbed_30_sigmas",
    ]
    assert fit.samples == 58
    assert fit.matrix == pytest.approx(clean.matrix, abs=1e-9)


def test_many_disturbed_poses_are_refused() -> None:
    field = readings_mg(60, 0.35)
    field[:14] += 30.0 * np.random.default_rng(2).normal(size=(14, 3))
    data = CalibrationData(field_mg=field, field_sd_mg=0.35, noise_known=True)
    fit = fit_ellipsoid(data)
    assert fit.cause in {Cause.FIELD_DISTURBED, Cause.RESIDUAL_TOO_LARGE}
    assert "the field around the module changed" in fit.message


def test_an_undisturbed_run_names_no_pose() -> None:
    for seed in range(40):
        data = CalibrationData(field_mg=readings_mg(48, 0.35, seed), field_sd_mg=0.35)
        assert "disturbed_poses" not in fit_ellipsoid(replace(data, noise_known=True)).extra


def test_residuals_that_known_noise_cannot_explain_are_refused_and_guessed_noise_is_not_asked() -> (
    None
):
    data = CalibrationData(field_mg=readings_mg(60, 3.0), field_sd_mg=0.35)
    assert not fit_ellipsoid(data).refused
    fit = fit_ellipsoid(replace(data, noise_known=True))
    assert fit.cause == Cause.RESIDUAL_TOO_LARGE
    assert "times what the noise explains" in fit.message


def test_the_strength_is_held_or_free_and_the_heading_is_the_same() -> None:
    data = CalibrationData(field_mg=readings_mg(60, 0.5), station_field_mg=STATION)
    held, free = fit_ellipsoid(data), fit_ellipsoid(data, strength_free=True)
    assert held.field_mg == pytest.approx(500.0)
    assert np.linalg.det(free.matrix) == pytest.approx(1.0)
    assert free.field_mg == pytest.approx(500.0 / np.cbrt(np.linalg.det(SHAPE)), rel=1e-3)
    ratio = np.cbrt(np.linalg.det(held.matrix))
    assert held.matrix == pytest.approx(ratio * free.matrix, abs=1e-9)
    assert held.predicted_heading_rms_deg == pytest.approx(free.predicted_heading_rms_deg)
    assert "field_mg_sd" not in held.extra


@pytest.mark.parametrize("strength_free", [True, False])
def test_the_covariance_holds_the_matrix_with_a_held_and_with_a_free_strength(
    strength_free: bool,
) -> None:
    squares, strengths = [], []
    scale = np.cbrt(np.linalg.det(SHAPE)) if strength_free else 1.0
    truth = (SHAPE / scale)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    for seed in range(60):
        data = CalibrationData(field_mg=readings_mg(60, 0.5, seed), station_field_mg=STATION)
        fit = fit_ellipsoid(data, strength_free=strength_free)
        off = fit.matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]] - truth
        squares.append(off**2 / np.diag(fit.covariance)[:6])
        if strength_free:
            strengths.append((fit.field_mg - 500.0 / scale) / fit.extra["field_mg_sd"])
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)
    if strength_free:
        assert np.std(strengths) == pytest.approx(1.0, abs=0.3)


def test_a_mirror_image_is_refused_where_force_and_station_tell(
    drawn: Callable[..., Any],
) -> None:
    data = drawn(2).data
    assert not fit_ellipsoid(data).refused
    mirrored = replace(data, field_mg=data.field_mg * [1.0, -1.0, 1.0])
    fit = fit_ellipsoid(mirrored)
    assert fit.cause == Cause.DEGENERATE
    assert "an axis is mirrored or two are swapped" in fit.message
    turned = replace(data, field_mg=data.field_mg[:, [1, 2, 0]])
    assert not fit_ellipsoid(turned).refused
    assert not fit_ellipsoid(replace(mirrored, accel_g=None)).refused  # cannot be seen
