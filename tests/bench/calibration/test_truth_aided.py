from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.fit import Cause, rows_of
from bench.calibration.ranking import heading_errors_deg
from bench.calibration.truth_aided import fit_truth_aided
from bench.calibration.truth_disturbed import outstanding
from bench.calibration.truth_model import rig_poses
from bench.calibration.truth_solver import solved, started

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


def test_given_no_noise_when_fitted_then_every_coefficient_is_exact(
    drawn: Callable[..., Any],
) -> None:
    truth = drawn(1, field_sd_mg=0.0, accel_sd_g=0.0, rig_sd_deg=0.0)
    fit = fit_truth_aided(truth.data)
    assert not fit.refused
    assert fit.matrix @ truth.gain == pytest.approx(np.eye(3), abs=1e-7)
    assert fit.offset_mg == pytest.approx(truth.offset_mg, abs=1e-5)
    assert fit.accel_matrix @ truth.accel_gain == pytest.approx(np.eye(3), abs=1e-7)
    assert fit.accel_offset_g == pytest.approx(truth.accel_offset_g, abs=1e-7)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("with_station", [True, False])
def test_field_azimuth_dip_and_base_level_are_recovered_within_four_sigma(
    drawn: Callable[..., Any], seed: int, with_station: bool
) -> None:
    truth = drawn(seed, azimuth_deg=0.5, dip_deg=60.3, north_deg=0.1, east_deg=-0.2)
    data = truth.data if with_station else replace(truth.data, station_field_mg=None)
    extra = fit_truth_aided(data).extra
    expected = {
        "field_azimuth_deg": 0.5,
        "dip_deg": 60.3,
        "base_level_north_deg": 0.1,
        "base_level_east_deg": -0.2,
    }
    for name, value in expected.items():
        assert abs(extra[name] - value) < 4.0 * extra[f"{name}_sd"] + 5e-4, name
        assert extra[f"{name}_sd"] < 0.03


def test_given_many_units_when_fitted_then_errors_match_the_covariance(
    drawn: Callable[..., Any],
) -> None:
    squares, chi2 = [], []
    for seed in range(60):
        truth = drawn(seed)
        fit = fit_truth_aided(truth.data)
        found = np.concatenate([np.linalg.inv(fit.matrix).ravel(), fit.offset_mg])
        true = np.concatenate([truth.gain.ravel(), truth.offset_mg])
        squares.append((found - true) ** 2 / np.diag(fit.covariance)[:12])
        chi2.append(fit.chi2_reduced)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.05)


def test_predicted_heading_error_is_the_achieved_one(drawn: Callable[..., Any]) -> None:
    rng = np.random.default_rng(5)
    angles = np.column_stack([rng.uniform(0, 360, 120), *rng.uniform(-30, 30, (2, 120))])
    achieved, predicted = [], []
    for seed in range(40):
        truth = drawn(seed)
        fit = fit_truth_aided(truth.data)
        clean = drawn(seed, angles, field_sd_mg=0.0, accel_sd_g=0.0, rig_sd_deg=0.0)
        achieved.append(np.sqrt(np.mean(heading_errors_deg(clean.data, fit) ** 2)))
        predicted.append(fit.predicted_heading_rms_deg)
    ratio = np.sqrt(np.mean(np.square(achieved)) / np.mean(np.square(predicted)))
    assert 0.8 < ratio < 1.2


def test_a_slipped_azimuth_index_is_seen_as_field_azimuth(drawn: Callable[..., Any]) -> None:
    fit = fit_truth_aided(drawn(3, azimuth_deg=-0.5).data)
    assert fit.extra["field_azimuth_deg"] == pytest.approx(-0.5, abs=0.08)
    assert abs(fit.extra["field_azimuth_deg"]) > 0.1


@pytest.mark.parametrize(
    ("choose", "cause", "rank"),
    [
        (lambda p, r: (p == 0) & (r == 0), Cause.TILT_TOO_SMALL, 12),
        (lambda p, r: (p >= 0) & (r == 0), Cause.NOT_OBSERVABLE, 18),
        (lambda p, r: r == 0, Cause.NOT_OBSERVABLE, 21),
        (lambda p, r: p == 0, Cause.NOT_OBSERVABLE, 21),
    ],
    ids=["level only", "single tilt", "pitch only", "roll only"],
)
def test_poses_that_cannot_observe_are_refused_with_their_rank(
    drawn: Callable[..., Any],
    eol_deg: NDArray[np.float64],
    choose: Callable[..., NDArray[np.bool_]],
    cause: Cause,
    rank: int,
) -> None:
    data = rows_of(drawn(1).data, choose(eol_deg[:, 1], eol_deg[:, 2]))
    fit = fit_truth_aided(data)
    assert (fit.cause, fit.rank) == (cause, rank)
    assert fit.offset_mg is None
    assert f"{rank} of 24" in fit.message


def test_wobble_of_level_poses_does_not_pass_for_tilt(drawn: Callable[..., Any]) -> None:
    rng = np.random.default_rng(1)
    angles = np.column_stack([np.arange(0, 360, 15.0), *rng.normal(0, 0.05, (2, 24))])
    assert fit_truth_aided(drawn(1, angles).data).cause == Cause.TILT_TOO_SMALL


def test_without_accelerometer_only_the_magnetometer_is_fitted(drawn: Callable[..., Any]) -> None:
    fit = fit_truth_aided(replace(drawn(2).data, accel_g=None))
    assert fit.rank == 12
    assert fit.accel_matrix is None
    assert len(fit.parameters) == 14 == len(fit.covariance)


@pytest.mark.parametrize("missing", ["azimuth_deg", "pitch_deg", "roll_deg"])
def test_without_rig_angles_there_is_no_truth(drawn: Callable[..., Any], missing: str) -> None:
    assert fit_truth_aided(replace(drawn(2).data, **{missing: None})).cause == Cause.NO_TRUTH


def test_few_poses_are_refused(drawn: Callable[..., Any]) -> None:
    data = rows_of(drawn(1).data, np.arange(72) < 5)
    assert fit_truth_aided(data).cause == Cause.TOO_FEW


@pytest.mark.parametrize("value", [1e8, 1e200, np.nan])
def test_a_reading_beyond_any_magnetometer_is_refused(
    drawn: Callable[..., Any], value: float
) -> None:
    data = drawn(1).data
    data.field_mg[3, 0] = value
    fit = fit_truth_aided(data)
    assert fit.cause == Cause.DEGENERATE
    assert "beyond" in fit.message


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_stuck_axis_is_refused_as_degenerate(drawn: Callable[..., Any], axis: int) -> None:
    data = drawn(1).data
    data.field_mg[:, axis] = 12.0
    fit = fit_truth_aided(data)
    assert fit.cause == Cause.DEGENERATE
    assert "magnetometer" in fit.message


def test_a_field_that_moved_during_more_than_one_pose_in_six_is_refused_as_disturbed(
    drawn: Callable[..., Any],
) -> None:
    data = drawn(1).data
    data.field_mg[30:50] += np.array([200.0, -150.0, 100.0])
    fit = fit_truth_aided(data)
    assert fit.cause == Cause.FIELD_DISTURBED
    assert "of 72 poses contradict the others" in fit.message


def test_a_field_that_moved_all_the_time_is_refused_for_its_residual(
    drawn: Callable[..., Any],
) -> None:
    data = drawn(1).data
    data.field_mg[:] += 100.0 * np.random.default_rng(1).normal(size=(72, 3))
    assert fit_truth_aided(data).cause == Cause.RESIDUAL_TOO_LARGE


@pytest.mark.parametrize("size_mg", [3.0, 20.0])
def test_forty_disturbed_poses_are_refused_where_the_noise_is_known(
    drawn: Callable[..., Any], size_mg: float
) -> None:
    data = drawn(1).data
    data.field_mg[::2] += size_mg * np.random.default_rng(1).normal(size=(36, 3))
    data.field_mg[1:9:2] += size_mg
    fit = fit_truth_aided(replace(data, noise_known=True))
    assert fit.cause in {Cause.RESIDUAL_TOO_LARGE, Cause.FIELD_DISTURBED}
    assert fit.message
    assert not fit_truth_aided(data).refused  # where it is a guess, the prediction grows


def test_a_good_unit_keeps_its_numbers_where_the_noise_is_known(drawn: Callable[..., Any]) -> None:
    for seed in range(20):
        data = drawn(seed).data
        known, guessed = (
            fit_truth_aided(replace(data, noise_known=flag)) for flag in (True, False)
        )
        assert known.matrix.tolist() == guessed.matrix.tolist()
        assert known.predicted_heading_rms_deg == guessed.predicted_heading_rms_deg


@pytest.mark.parametrize("size_mg", [5.0, 60.0])
def test_disturbed_poses_are_named_left_out_and_change_nothing_else(
    drawn: Callable[..., Any], size_mg: float
) -> None:
    data = drawn(3).data
    clean = fit_truth_aided(rows_of(data, ~np.isin(np.arange(72), [8, 30, 61])))
    data.field_mg[[8, 30]] += size_mg * np.array([[0.8, -0.6, 0.4], [-0.5, 0.9, 0.3]])
    data.accel_g[61] += 0.001 * size_mg
    fit = fit_truth_aided(data)
    assert fit.message.startswith("left out as disturbed: poses 8 by ")
    assert fit.extra["disturbed_poses"] == 3.0
    assert [name for name in fit.extra if name.endswith("sigmas")] == [
        f"disturbed_{pose}_sigmas" for pose in (8, 30, 61)
    ]
    assert fit.samples == 69
    assert fit.matrix == pytest.approx(clean.matrix, abs=1e-12)
    assert fit.predicted_heading_rms_deg == pytest.approx(clean.predicted_heading_rms_deg)


def test_an_undisturbed_run_names_no_pose_and_keeps_its_numbers(drawn: Callable[..., Any]) -> None:
    searched = 0
    for seed in range(30):
        data = drawn(seed).data
        poses = rig_poses(data.azimuth_deg, data.pitch_deg, data.roll_deg)
        start = started(poses, data)
        solution = solved(start, poses, data.rig_sd_deg)
        searched += outstanding(solution, poses, data.rig_sd_deg)
        fit = fit_truth_aided(data)
        assert fit.samples == 72
        assert "disturbed_poses" not in fit.extra
        assert fit.offset_mg.tolist() == solution.magnetometer.offset.tolist()
    assert searched < 6


def test_seventy_two_poses_take_less_than_50_ms(drawn: Callable[..., Any]) -> None:
    data = drawn(1).data
    fit_truth_aided(data)
    durations = []
    for _ in range(5):
        start = time.process_time()
        fit_truth_aided(data)
        durations.append(time.process_time() - start)
    assert min(durations) < 0.05


def test_field_magnitude_is_told_in_the_module_s_own_scale(drawn: Callable[..., Any]) -> None:
    truth = drawn(1, soft=0.0)
    data = replace(truth.data, field_mg=truth.data.field_mg * 1.05)
    assert fit_truth_aided(data).extra["field_magnitude_mg"] == pytest.approx(525.0, abs=0.5)
