"""Cho & Park's Theorems 1 and 3: the third axis from the dip, the dip from tilts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bench.calibration.fit import Cause
from bench.calibration.tilt import ned_from_body
from bench.calibration.two_axis import (
    CAUSES,
    _identity,
    estimated_z_mg,
    extended_dip_batch,
)
from bench.reproduction.printed_formulas import printed_extended_dip_deg

DIP_DEG = 48.72


def unit_field(
    azimuth_deg: np.ndarray, pitch_deg: np.ndarray, roll_deg: np.ndarray, dip_deg: float = DIP_DEG
) -> np.ndarray:
    """Field in the body over its horizontal part, by the rotation matrix alone."""
    ned = np.array([1.0, 0.0, np.tan(np.deg2rad(dip_deg))])
    return np.einsum("...ji,j->...i", ned_from_body(azimuth_deg, pitch_deg, roll_deg), ned)


def size_of_d(azimuth_deg: Any, pitch_deg: float, roll_deg: float) -> np.ndarray:
    psi, th, ph = (np.deg2rad(angle_deg) for angle_deg in (azimuth_deg, pitch_deg, roll_deg))
    return np.abs(_identity(0.0, 0.0, th, ph, psi)[0])


def drawn_attitudes(count: int, largest_deg: float = 60.0) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(1)
    azimuth_deg = rng.uniform(0.0, 360.0, count)
    return azimuth_deg, *rng.uniform(-largest_deg, largest_deg, (2, count))


@pytest.mark.parametrize("dip_deg", [-60.0, 0.0, 48.72, 85.0])
def test_z_follows_from_x_y_attitude_and_dip(dip_deg: float) -> None:
    attitude = drawn_attitudes(500)
    field = unit_field(*attitude, dip_deg)
    z = estimated_z_mg(field, *attitude[1:], horizontal_mg=1.0, dip_deg=dip_deg)
    assert z == pytest.approx(field[:, 2], abs=1e-12)


def test_the_identity_holds_at_every_attitude() -> None:
    """sin(l) d = cos(l) n, written out apart from the product."""
    azimuth_deg, pitch_deg, roll_deg = drawn_attitudes(2000, 85.0)
    x, y, _ = unit_field(azimuth_deg, pitch_deg, roll_deg).T
    psi, th, ph = np.deg2rad([azimuth_deg, pitch_deg, roll_deg])
    d = np.sin(th) * np.cos(ph) * np.sin(psi) - np.sin(ph) * np.cos(psi)
    n = x * (np.sin(th) * np.sin(ph) * np.cos(psi) - np.cos(ph) * np.sin(psi))
    n -= y * np.cos(th) * np.cos(psi)
    dip = np.deg2rad(DIP_DEG)
    assert np.sin(dip) * d == pytest.approx(np.cos(dip) * n, abs=1e-12)
    assert size_of_d(azimuth_deg, pitch_deg, roll_deg) == pytest.approx(np.abs(d))


@pytest.mark.parametrize("dip_deg", [-70.0, 0.0, 48.72, 80.0])
def test_exact_data_give_the_dip_of_each_unit(dip_deg: float) -> None:
    attitude = np.array(drawn_attitudes(60)).reshape(3, 5, 12)
    field = unit_field(*attitude, dip_deg)
    found = extended_dip_batch(field[..., 0], field[..., 1], *attitude[1:], attitude[0])
    assert found.dip_deg == pytest.approx(np.full(5, dip_deg), abs=1e-9)
    assert not found.cause.any()
    one = extended_dip_batch(field[3, :, 0], field[3, :, 1], *attitude[1:, 3], attitude[0, 3])
    assert one.dip_sd_deg == found.dip_sd_deg[3]


def test_printed_26_is_ours_sample_by_sample_away_from_90_and_270() -> None:
    azimuth_deg, pitch_deg, roll_deg = drawn_attitudes(50)
    x, y, _ = unit_field(azimuth_deg, pitch_deg, roll_deg).T
    printed = printed_extended_dip_deg(x, y, pitch_deg, roll_deg, azimuth_deg)
    assert printed == pytest.approx(np.full(50, DIP_DEG), abs=1e-6)


def test_printed_26_is_far_off_at_a_blind_azimuth_where_ours_refuses() -> None:
    x, y, _ = unit_field(90.0, 0.0, 30.0)  # a roll at 90 deg: blind
    noisy = x + 1e-3
    assert abs(float(printed_extended_dip_deg(noisy, y, 0.0, 30.0, 90.0)) - DIP_DEG) > 40.0
    refused = extended_dip_batch([noisy, noisy], [y, y], 0.0, 30.0, 90.0)
    assert CAUSES[int(refused.cause)] is Cause.BLIND_AZIMUTH
    assert refused.dip_deg == refused.dip_sd_deg == 0.0


@pytest.mark.parametrize(
    ("azimuth_deg", "pitch_deg", "roll_deg"),
    [(0.0, 30.0, 0.0), (180.0, 30.0, 0.0), (90.0, 0.0, 30.0), (270.0, 0.0, -40.0), (49.1, 30, 30)],
)
def test_blind_azimuths_are_where_tan_psi_is_tan_roll_over_sin_pitch(
    azimuth_deg: float, pitch_deg: float, roll_deg: float
) -> None:
    assert size_of_d(azimuth_deg, pitch_deg, roll_deg) < 1e-3
    x, y, _ = unit_field(azimuth_deg, pitch_deg, roll_deg)
    found = extended_dip_batch([x] * 4, [y] * 4, pitch_deg, roll_deg, azimuth_deg)
    assert CAUSES[int(found.cause)] is Cause.BLIND_AZIMUTH
    sighted = azimuth_deg + 90.0
    x, y, _ = unit_field(sighted, pitch_deg, roll_deg)
    found = extended_dip_batch([x] * 4, [y] * 4, pitch_deg, roll_deg, sighted)
    assert found.dip_deg == pytest.approx(DIP_DEG)


def test_d_is_the_sine_of_the_tilt_times_that_of_the_distance_from_the_blind_azimuth() -> None:
    azimuth_deg = np.arange(0.0, 360.0, 1.0)
    d = size_of_d(azimuth_deg, 30.0, 20.0)
    tilt = np.arccos(np.cos(np.deg2rad(30.0)) * np.cos(np.deg2rad(20.0)))
    blind = np.arctan2(np.tan(np.deg2rad(20.0)), np.sin(np.deg2rad(30.0)))
    assert d == pytest.approx(np.sin(tilt) * np.abs(np.sin(np.deg2rad(azimuth_deg) - blind)))


def test_too_few_rows_and_too_little_tilt_are_told_apart() -> None:
    level = extended_dip_batch(np.ones((3, 8)), np.zeros((3, 8)), 4.0, 0.0, 90.0)
    assert [CAUSES[code] for code in level.cause] == [Cause.TILT_TOO_SMALL] * 3
    one = extended_dip_batch([1.0], [0.0], 30.0, 0.0, 90.0)
    assert CAUSES[int(one.cause)] is Cause.TOO_FEW
    assert np.isfinite([level.dip_deg, level.dip_sd_deg, level.chi2_reduced]).all()
    none = extended_dip_batch(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))
    assert CAUSES[int(none.cause)] is Cause.TOO_FEW


@pytest.mark.parametrize(
    ("pitch_deg", "median_deg", "high_deg"),
    [(10.0, 1.31, 12.1), (20.0, 0.62, 5.5), (30.0, 0.38, 3.4), (45.0, 0.24, 2.3)],
)
def test_half_a_degree_of_azimuth_error_costs_what_is_known_of_it(
    pitch_deg: float, median_deg: float, high_deg: float
) -> None:
    """Median and 95th percentile of one sample's error over all azimuths; within a seventh."""
    rng = np.random.default_rng(2)
    azimuth_deg = rng.uniform(0.0, 360.0, (40000, 1))
    field = unit_field(azimuth_deg, pitch_deg, 0.0)
    told_deg = azimuth_deg + rng.normal(0.0, 0.5, azimuth_deg.shape)
    printed = printed_extended_dip_deg(field[..., 0], field[..., 1], pitch_deg, 0.0, told_deg)
    error = np.abs(printed - DIP_DEG)
    assert np.median(error) == pytest.approx(median_deg, rel=0.14)
    assert np.percentile(error, 95) == pytest.approx(high_deg, rel=0.14)
    ours = extended_dip_batch(
        field[..., 0], field[..., 1], pitch_deg, 0.0, told_deg, azimuth_sd_deg=0.5, smallest=1
    )
    worst = np.abs(ours.dip_deg - DIP_DEG)[ours.cause == 0].max()
    assert worst < error.max() / 2.0


def test_weights_use_every_tilt_better_than_a_cut_at_30_degrees() -> None:
    rng = np.random.default_rng(3)
    pitch_deg = np.linspace(-45.0, 45.0, 60)
    field = unit_field(45.0, pitch_deg, 0.0)[..., :2] + rng.normal(0.0, 2e-3, (800, 60, 2))
    x, y = field[..., 0], field[..., 1]
    ours = extended_dip_batch(x, y, pitch_deg, 0.0, 45.0, field_sd=2e-3)
    steep = np.abs(pitch_deg) > 30.0
    papers = printed_extended_dip_deg(x, y, pitch_deg, 0.0, 45.0)[:, steep].mean(axis=-1)
    assert ours.dip_deg.std() < 0.95 * papers.std()


@pytest.mark.parametrize(
    "noise",
    [
        {"field_sd": 5e-3, "azimuth_sd_deg": 1e-4, "tilt_sd_deg": 1e-4},
        {"field_sd": 1e-5, "azimuth_sd_deg": 0.5, "tilt_sd_deg": 1e-4},
        {"field_sd": 1e-5, "azimuth_sd_deg": 1e-4, "tilt_sd_deg": 0.5},
    ],
    ids=["field", "azimuth", "tilt"],
)
def test_the_scatter_of_many_units_is_the_standard_deviation_told(noise: dict[str, float]) -> None:
    rng = np.random.default_rng(4)
    azimuth_deg, pitch_deg, roll_deg = drawn_attitudes(20, 40.0)
    shape = (3000, 20)
    azimuth_sd_deg, tilt_sd_deg = noise["azimuth_sd_deg"], noise["tilt_sd_deg"]
    actual = (
        azimuth_deg + rng.normal(0.0, azimuth_sd_deg, shape),
        pitch_deg + rng.normal(0.0, tilt_sd_deg, shape),
        roll_deg + rng.normal(0.0, tilt_sd_deg, shape),
    )
    field = unit_field(*actual)[..., :2] + rng.normal(0.0, noise["field_sd"], (*shape, 2))
    found = extended_dip_batch(
        field[..., 0], field[..., 1], pitch_deg, roll_deg, azimuth_deg, **noise
    )
    pulls = (found.dip_deg - DIP_DEG) / found.dip_sd_deg
    assert pulls.std() == pytest.approx(1.0, abs=0.05)
    assert abs(pulls.mean()) < 0.15
    assert found.chi2_reduced.mean() == pytest.approx(1.0, abs=0.03)
    assert np.mean(np.abs(pulls) < 2.0) == pytest.approx(0.954, abs=0.02)


def test_derivatives_by_x_and_y_are_those_of_the_result() -> None:
    azimuth_deg, pitch_deg, roll_deg = drawn_attitudes(12)
    x, y, _ = unit_field(azimuth_deg, pitch_deg, roll_deg).T

    def dip_deg(x: np.ndarray, y: np.ndarray) -> float:
        return float(extended_dip_batch(x, y, pitch_deg, roll_deg, azimuth_deg).dip_deg)

    told = extended_dip_batch(x, y, pitch_deg, roll_deg, azimuth_deg)
    for row in (0, 5, 11):
        step = 1e-6 * np.eye(12)[row]
        by_x = (dip_deg(x + step, y) - dip_deg(x - step, y)) / 2e-6
        by_y = (dip_deg(x, y + step) - dip_deg(x, y - step)) / 2e-6
        assert told.by_x_deg[row] == pytest.approx(by_x, rel=1e-3, abs=1e-6)
        assert told.by_y_deg[row] == pytest.approx(by_y, rel=1e-3, abs=1e-6)


def test_an_azimuth_from_true_north_gives_another_dip() -> None:
    x, y, _ = unit_field(65.0, 35.0, -15.0)
    west, east = (
        extended_dip_batch([x], [y], 35.0, -15.0, 65.0 + turned, smallest=1).dip_deg
        for turned in (9.0, -9.0)
    )
    assert {round(float(west), 1), round(float(east), 1)} == {43.0, 53.3}


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused(bad: float) -> None:
    for x, azimuth in ((bad, 45.0), (-0.25, bad)):
        with pytest.raises(ValueError, match="must be finite"):
            extended_dip_batch([x, -0.25], [-0.7, -0.7], 30.0, 0.0, [azimuth, 45.0])
