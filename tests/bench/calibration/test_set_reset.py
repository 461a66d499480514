from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.set_reset import (
    CROSS_AXIS,
    check_set_reset,
    field_and_offset_mg,
    fit_set_reset,
    set_reset_batch,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

OFFSETS = np.array([30.0, -45.0, 12.0])


def pairs_mg(
    hk_g: float = 8.0,
    noise_mg: float = 0.05,
    hard_mg: tuple[float, float, float] = (100.0, 80.0, 20.0),
    reset_gain: float = 1.0,
    tilted: bool = True,
    seed: int = 1,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Set and reset readings of an AMR bridge triad on a turn of 24 headings."""
    rng = np.random.default_rng(seed)
    turn = np.deg2rad(np.arange(0, 360, 15.0))
    down = 433.0 + (100.0 * np.sin(2.0 * turn + 0.4) if tilted else 0.0 * turn)
    field = np.column_stack([250.0 * np.cos(turn), -250.0 * np.sin(turn), down]) + hard_mg
    across = field[:, CROSS_AXIS] / (hk_g * 1000.0)
    noise = rng.normal(0.0, noise_mg, (2, 24, 3))
    return (
        field / (1.0 + across) + OFFSETS + noise[0],
        -reset_gain * field / (1.0 - across) + OFFSETS + noise[1],
    )


def test_half_difference_is_the_field_and_half_sum_the_offset() -> None:
    field, offset = field_and_offset_mg(np.array([[130.0, 0, -5]]), np.array([[-70.0, 20, 15]]))
    assert field.tolist() == [[100.0, -10.0, -10.0]]
    assert offset.tolist() == [[30.0, 10.0, 5.0]]


def test_bridge_offset_and_hk_are_recovered_within_their_uncertainty() -> None:
    check = check_set_reset(*pairs_mg())
    assert check.hk_observed.all()
    assert check.bridge_offset_mg == pytest.approx(OFFSETS, abs=0.15)
    assert check.hk_g == pytest.approx(np.full(3, 8.0), rel=0.05)
    assert (np.abs(check.hk_g - 8.0) < 4.0 * check.hk_sd_g + 0.02).all()
    assert check.symmetry == pytest.approx(np.ones(3), abs=0.01)


def test_the_plain_half_sum_is_wrong_by_the_cross_axis_term_and_the_regression_is_not() -> None:
    """Averaging over headings leaves bx by/Hk = 1.0 mG for 100 and 80 mG at 8 G."""
    set_mg, reset_mg = pairs_mg(noise_mg=0.0)
    plain = field_and_offset_mg(set_mg, reset_mg)[1].mean(axis=0) - OFFSETS
    assert plain[0] == pytest.approx(-1.0, abs=0.02)
    assert check_set_reset(set_mg, reset_mg).bridge_offset_mg[:2] == pytest.approx(
        OFFSETS[:2], abs=0.02
    )


def test_hk_of_24_headings_is_good_to_two_percent() -> None:
    values = [check_set_reset(*pairs_mg(seed=seed)).hk_g[:2] for seed in range(40)]
    assert np.std(values) / 8.0 < 0.02


def test_a_small_hk_is_seen() -> None:
    assert check_set_reset(*pairs_mg(hk_g=2.0)).hk_g[0] == pytest.approx(2.0, rel=0.1)


def test_without_cross_axis_term_a_finite_lower_bound_is_given() -> None:
    check = check_set_reset(*pairs_mg(hk_g=1e9))
    assert np.isfinite(check.hk_g).all()
    assert (check.hk_g > 50.0).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_dead_strap_has_no_symmetry_and_no_amplitude(axis: int) -> None:
    set_mg, reset_mg = pairs_mg()
    reset_mg[:, axis] = set_mg[:, axis] + np.random.default_rng(3).normal(0, 0.05, 24)
    check = check_set_reset(set_mg, reset_mg)
    assert check.symmetry[axis] == 0.0
    assert check.amplitude_mg[axis] < 1.0
    others = [other for other in range(3) if other != axis]
    assert check.symmetry[others] == pytest.approx(np.ones(2), abs=0.05)


def test_a_dead_strap_on_a_steady_axis_is_seen_too() -> None:
    set_mg, reset_mg = pairs_mg(tilted=False)
    assert check_set_reset(set_mg, reset_mg).symmetry[2] == pytest.approx(1.0)
    reset_mg[:, 2] = set_mg[:, 2]
    assert check_set_reset(set_mg, reset_mg).symmetry[2] == 0.0


def test_a_weak_reset_is_an_unequal_symmetry() -> None:
    check = check_set_reset(*pairs_mg(reset_gain=0.8))
    assert check.symmetry[:2] == pytest.approx(np.full(2, 1.25), abs=0.02)
    assert check.bridge_offset_mg == pytest.approx(OFFSETS, abs=1.0)


@pytest.mark.parametrize(
    ("set_mg", "reset_mg"),
    [
        (np.zeros((3, 3)), np.zeros((3, 3))),
        (np.zeros((9, 3)), np.zeros((8, 3))),
        (np.full((9, 3), np.nan), np.zeros((9, 3))),
    ],
)
def test_unusable_pairs_are_named(
    set_mg: NDArray[np.float64], reset_mg: NDArray[np.float64]
) -> None:
    with pytest.raises(ValueError, match="must be"):
        check_set_reset(set_mg, reset_mg)


def batch_of(count: int, noise_mg: float = 0.1, hk_g: float = 8.0) -> tuple[np.ndarray, np.ndarray]:
    """Half differences and half sums, each shape (count, 24, 3), of pairs of many seeds."""
    rng = np.random.default_rng(4)
    turn = np.deg2rad(np.arange(0, 360, 15.0))
    down = 433.0 + 100.0 * np.sin(2.0 * turn + 0.4)
    field = np.column_stack([250.0 * np.cos(turn), -250.0 * np.sin(turn), down])
    field = field + rng.normal(0.0, 80.0, (count, 1, 3))
    half_sum = OFFSETS - field * field[..., CROSS_AXIS] / (hk_g * 1000.0)
    return field, half_sum + rng.normal(0.0, noise_mg, field.shape)


def test_offset_and_hk_of_many_units_lie_within_their_uncertainty() -> None:
    fits = set_reset_batch(*batch_of(3000))
    assert not fits.cause.any()
    off = np.abs(fits.bridge_offset_mg - OFFSETS) / fits.bridge_offset_sd_mg
    off_hk = np.abs(fits.hk_g - 8.0) / fits.hk_sd_g
    for share in ((off < 2.0).mean(axis=0), (off_hk < 2.0).mean(axis=0)):
        assert (share > 0.92).all()
        assert (share < 0.98).all()


def test_units_in_a_batch_are_regressed_as_alone() -> None:
    field, half_sum = batch_of(6)
    field[1, :, 0] = 0.01
    field[2] = field[2, :1]
    field[3] = 1e300
    batch = set_reset_batch(field, half_sum)
    for unit in range(6):
        alone = set_reset_batch(field[unit], half_sum[unit])
        for entry in fields(alone):
            together = getattr(batch, entry.name)[unit]
            assert np.isfinite(together).all()
            np.testing.assert_allclose(together, getattr(alone, entry.name), rtol=1e-7, atol=1e-12)


def test_level_headings_give_the_vertical_offset_without_its_gain() -> None:
    """z hardly changes there: its gain would be made of noise, and the offset with it."""
    rng = np.random.default_rng(1)
    field, half_sum = batch_of(200)
    field[..., 2] = 433.0
    half_sum[..., 2] = OFFSETS[2] - 433.0 * field[..., 0] / 8000.0
    half_sum[..., 2] += rng.normal(0.0, 0.1, (200, 24))
    fits = set_reset_batch(field + rng.normal(0.0, 0.1, field.shape), half_sum)
    assert not fits.gain_fitted[:, 2].any()
    assert fits.bridge_offset_mg[:, 2] == pytest.approx(np.full(200, OFFSETS[2]), abs=0.3)
    assert fits.hk_g[:, 2] == pytest.approx(np.full(200, 8.0), rel=0.02)


def test_fit_leaves_the_field_as_it_is_and_reports_the_bridges() -> None:
    field, half_sum = batch_of(1)
    data = CalibrationData(field_mg=field[0], offset_mg=half_sum[0], field_sd_mg=0.1)
    fit = fit_set_reset(data)
    assert fit.corrected_mg(field[0]).tolist() == field[0].tolist()
    for axis, offset_mg in zip("xyz", OFFSETS, strict=True):
        name = f"bridge_offset_{axis}_mg"
        assert fit.extra[name] == pytest.approx(offset_mg, abs=4.0 * fit.extra[f"{name}_sd"])
        assert fit.extra[f"hk_{axis}_g"] == pytest.approx(
            8.0, abs=4.0 * fit.extra[f"hk_{axis}_g_sd"]
        )
    assert np.sqrt(np.diag(fit.covariance)).tolist() == [
        fit.extra[f"bridge_offset_{axis}_mg_sd"] for axis in "xyz"
    ]
    assert fit.chi2_reduced == pytest.approx(1.0, abs=0.5)
    assert fit.predicted_heading_rms_deg is None


def test_an_hk_too_large_to_be_seen_is_reported_as_a_lower_bound() -> None:
    field, half_sum = batch_of(1, hk_g=1e6)
    fit = fit_set_reset(CalibrationData(field_mg=field[0], offset_mg=half_sum[0]))
    bounds = [name for name in fit.extra if name.endswith("_g_min")]
    assert bounds
    assert all(fit.extra[name] > 20.0 for name in bounds)


def test_what_is_no_pair_of_a_sound_sensor_is_refused() -> None:
    field, half_sum = batch_of(1)
    data = CalibrationData(field_mg=field[0], offset_mg=half_sum[0])
    assert fit_set_reset(replace(data, offset_mg=None)).cause == Cause.NO_SET_RESET
    few = replace(data, field_mg=field[0, :3], offset_mg=half_sum[0, :3])
    assert fit_set_reset(few).cause == Cause.TOO_FEW
    held = replace(data, field_mg=np.minimum(field[0], [150.0, 1e3, 1e3]))
    assert fit_set_reset(held).cause == Cause.SATURATED
    dead = fit_set_reset(replace(data, field_mg=field[0] * [1.0, 1e-4, 1.0]))
    assert dead.cause == Cause.DEGENERATE
    assert "does not follow the field on y" in dead.message
