"""Accelerometers of many units are fitted as one by one, and refused one by one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.accelerometer import fit_accelerometer
from bench.calibration.accelerometer_batch import CAUSES, accelerometer_batch
from bench.calibration.fit import Cause
from bench.calibration.truth_model import rig_poses
from bench.calibration.truth_solver import solved, started

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

NOISE = {"accel_sd_g": 0.0005, "rig_sd_deg": 0.02}


def test_every_unit_has_the_numbers_of_its_single_fit(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    truths = [drawn(seed, north_deg=0.1, east_deg=-0.2) for seed in range(140)]
    station_mg = truths[0].data.station_field_mg
    force_g = np.stack([truth.data.accel_g for truth in truths])
    fits = accelerometer_batch(eol_deg, force_g, station_field_mg=station_mg, **NOISE)
    assert (fits.cause == 0).all()
    for unit in (0, 127, 128, 139):
        fit = fit_accelerometer(truths[unit].data)
        if "disturbed_poses" in fit.extra:
            continue
        assert np.linalg.inv(fits.gain[unit]) == pytest.approx(fit.accel_matrix, abs=1e-9)
        assert fits.offset_g[unit] == pytest.approx(fit.accel_offset_g, abs=1e-9)
        assert fits.covariance[unit] == pytest.approx(fit.covariance, rel=1e-6, abs=1e-15)
        assert fits.base_level_east_deg[unit] == pytest.approx(
            fit.extra["base_level_east_deg"], abs=1e-9
        )
        assert fits.predicted_rms_deg[unit] == pytest.approx(fit.predicted_heading_rms_deg)
        assert fits.chi2_reduced[unit] == pytest.approx(fit.chi2_reduced)


def test_the_solution_is_that_of_the_solver_for_one_unit(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    data = drawn(3, north_deg=0.2).data
    poses = rig_poses(*eol_deg.T)
    start = started(poses, data, with_magnetometer=False)
    other = solved(start, poses, data.rig_sd_deg)
    fits = accelerometer_batch(eol_deg, data.accel_g, **NOISE)
    assert fits.gain == pytest.approx(other.accelerometer.gain, abs=1e-8)
    assert fits.offset_g == pytest.approx(other.accelerometer.offset, abs=1e-8)
    assert np.diag(fits.covariance)[:12] / max(fits.chi2_reduced, 1.0) == pytest.approx(
        np.diag(other.covariance)[:12], rel=1e-5
    )


def test_errors_match_the_covariance_over_many_draws(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    truths = [drawn(seed) for seed in range(200)]
    fits = accelerometer_batch(eol_deg, np.stack([one.data.accel_g for one in truths]), **NOISE)
    true = [np.concatenate([one.accel_gain.ravel(), one.accel_offset_g]) for one in truths]
    error = np.concatenate([fits.gain.reshape(-1, 9), fits.offset_g], axis=1) - true
    own = fits.covariance[:, :12, :12]
    distance = np.einsum("bi,bij,bj->b", error, np.linalg.inv(own), error) / 12.0
    assert distance.mean() == pytest.approx(1.0, abs=0.1)
    assert fits.chi2_reduced.mean() == pytest.approx(1.0, abs=0.05)


def test_each_unit_is_refused_with_its_own_cause(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    good = drawn(1).data.accel_g
    stuck = good * [1.0, 0.0, 1.0]
    shaken = good + 0.005 * np.random.default_rng(1).normal(size=good.shape)
    beyond = 1e9 * good
    both = np.stack([good, stuck, shaken, beyond])
    fits = accelerometer_batch(eol_deg, both, **NOISE)
    assert [CAUSES[code] for code in fits.cause] == [
        None,
        Cause.DEGENERATE,
        Cause.RESIDUAL_TOO_LARGE,
        Cause.DEGENERATE,
    ]
    assert (fits.gain[1:] == np.eye(3)).all()
    assert all(np.isfinite(getattr(fits, name)).all() for name in fits.__slots__)
    guessed = accelerometer_batch(eol_deg, both, noise_known=False, **NOISE)
    assert guessed.cause[2] == 0
    level = ~eol_deg[:, 1:].any(axis=1)
    flat = accelerometer_batch(eol_deg[level], both[:, level], **NOISE)
    assert {CAUSES[code] for code in flat.cause} == {Cause.NOT_OBSERVABLE}
    few = accelerometer_batch(eol_deg[:4], both[:, :4], **NOISE)
    assert {CAUSES[code] for code in few.cause} == {Cause.TOO_FEW}


def test_a_shaken_pose_is_named_and_left_out(drawn: Callable[..., Any]) -> None:
    data = drawn(1).data
    clean = fit_accelerometer(data)
    data.accel_g[55] += [0.02, -0.01, 0.015]
    fit = fit_accelerometer(replace(data, noise_known=True))
    assert "left out as disturbed: poses 55 by " in fit.message
    assert fit.extra["disturbed_poses"] == 1.0
    assert fit.samples == 71
    assert fit.accel_matrix == pytest.approx(clean.accel_matrix, abs=1e-3)


def test_shapes_that_do_not_match_are_errors(eol_deg: NDArray[np.float64]) -> None:
    with pytest.raises(ValueError, match="attitudes_deg must have the shape"):
        accelerometer_batch(eol_deg, np.zeros((5, 3)), **NOISE)
    with pytest.raises(ValueError, match="accel_g must be finite"):
        accelerometer_batch(eol_deg[:5], np.full((5, 3), np.nan), **NOISE)
