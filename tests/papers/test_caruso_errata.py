"""Caruso's arithmetic and his 45 deg, each beside what the product uses.

| paper | printed | used |
|---|---|---|
| Table 1, noise | below 0.01 deg | 0.024 deg |
| Table 1, total | 0.49 mG, 0.14 deg | 0.502 mG, 0.144 deg |
| (4) | 12.163 bits | the same |
| soft iron | rotate by 45 deg | the ellipse's own axes |
"""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData
from bench.calibration.methods import fit_named
from bench.reproduction.caruso_acceleration import RATE_ONE_BANK_DEG
from bench.reproduction.caruso_budget import LIMIT_MG, across_deg, root_sum_square
from bench.reproduction.caruso_iron import ellipse
from bench.reproduction.caruso_table_1 import expected_swing_deg
from bench.reproduction.caruso_temperature import SHARE_DEG
from bench.reproduction.printed_formulas import forty_five_soft_iron
from protocols.angles import wrap_180_deg

HEADINGS = np.arange(0.0, 360.0, 1.0)
AT_DIP_60 = np.array([1.0, 0.0, 3.0**0.5])


def turned(axis_deg: float) -> np.ndarray:
    """A level turn in 200 mG inside soft iron of 4:3."""
    heading = np.deg2rad(HEADINGS)
    level = 200.0 * np.column_stack([np.cos(heading), -np.sin(heading), np.zeros(360)])
    return level @ np.reshape(ellipse(axis_deg), (3, 3)).T


def worst_deg(plane: np.ndarray) -> float:
    found = np.rad2deg(np.arctan2(-plane[:, 1], plane[:, 0]))
    return float(np.abs(wrap_180_deg(found - HEADINGS)).max())


def test_noise_of_table_1_is_more_than_twice_what_is_printed() -> None:
    assert across_deg(0.085) == pytest.approx(0.0244, abs=5e-5)
    assert across_deg(0.085) > 2.0 * 0.01


def test_table_1_adds_up_to_more_than_it_says() -> None:
    full_scale_mg = 400.0
    rows = (0.085, 0.0005 * full_scale_mg, 0.0008 * full_scale_mg, 0.0008 * full_scale_mg)
    assert tuple(LIMIT_MG.values()) == pytest.approx(rows)
    total_mg = root_sum_square(rows)
    assert total_mg == pytest.approx(0.502, abs=5e-4)
    assert round(total_mg, 2) != 0.49
    assert across_deg(total_mg) == pytest.approx(0.144, abs=5e-4)


@pytest.mark.parametrize(
    ("row", "printed_deg"), [("linearity", 0.06), ("hysteresis", 0.09), ("repeatability", 0.09)]
)
def test_other_rows_of_table_1_are_right_to_their_digits(row: str, printed_deg: float) -> None:
    assert round(across_deg(LIMIT_MG[row]), 2) == printed_deg


def test_hysteresis_and_linearity_do_less_to_a_heading_than_table_1_allows() -> None:
    swing = expected_swing_deg()
    heading = np.deg2rad(HEADINGS)
    lag = 0.16 * (np.abs(np.sin(heading)) + np.abs(np.cos(heading)))
    assert swing["hysteresis"] == pytest.approx(
        np.rad2deg(np.sqrt((lag**2).mean()) / 200.0), rel=1e-4
    )
    cubic = 0.2 / (2.0 / 27.0**0.5) / 400.0**3
    x, y = 200.0 * np.cos(heading), -200.0 * np.sin(heading)
    bent = np.column_stack([x + cubic * x**3, y + cubic * y**3])
    error = wrap_180_deg(np.rad2deg(np.arctan2(-bent[:, 1], bent[:, 0])) - HEADINGS)
    assert swing["linearity"] == pytest.approx(float(np.sqrt((error**2).mean())), rel=0.01)
    assert swing["all"] < across_deg(root_sum_square(LIMIT_MG.values()))


def test_equation_4_is_right_as_printed() -> None:
    field_mg = 200.0 * np.tan(np.deg2rad(0.1))
    assert 200.0 / field_mg == pytest.approx(573.0, abs=0.05)
    assert np.log2(1600.0 / field_mg) == pytest.approx(12.163, abs=1e-3)
    count_mg = 1600.0 / 2**12
    assert count_mg == pytest.approx(0.39, abs=0.001)
    assert across_deg(count_mg) == pytest.approx(0.112, abs=5e-4)


def test_029_deg_over_50_deg_is_half_a_percent_of_the_field() -> None:
    half_percent_mg = 0.0001 * 50.0 * 200.0
    assert across_deg(half_percent_mg) == pytest.approx(SHARE_DEG)
    assert across_deg(half_percent_mg) == pytest.approx(0.29, abs=0.004)


def test_forty_five_deg_is_right_for_axes_at_45_and_leaves_6_9_of_8_2_at_20() -> None:
    for axis_deg, left_deg in ((45.0, 0.0), (135.0, 0.0), (20.0, 6.9), (110.0, 6.9)):
        field_mg = turned(axis_deg)
        assert worst_deg(field_mg) == pytest.approx(8.2, abs=0.05)
        recipe = forty_five_soft_iron(field_mg[:, :2])
        plane = (field_mg[:, :2] - recipe.offset_mg) @ recipe.matrix.T
        assert worst_deg(plane) == pytest.approx(left_deg, abs=0.05)
        fit = fit_named("soft_iron", CalibrationData(field_mg=field_mg, azimuth_deg=HEADINGS))
        assert worst_deg(fit.corrected_mg(field_mg)) < 1e-6


def in_a_turn_deg(azimuth_deg: np.ndarray, bank_deg: float) -> np.ndarray:
    """Heading of a banked compass whose accelerometer, in a coordinated turn, reads level."""
    roll = np.deg2rad(bank_deg)
    x, right = np.cos(np.deg2rad(azimuth_deg)), -np.sin(np.deg2rad(azimuth_deg))
    y = right * np.cos(roll) + AT_DIP_60[2] * np.sin(roll)
    return np.rad2deg(np.arctan2(-y, x))


def test_a_rate_one_turn_at_100_knots_errs_by_28_deg_at_dip_60() -> None:
    errors = wrap_180_deg(in_a_turn_deg(HEADINGS, RATE_ONE_BANK_DEG) - HEADINGS)
    assert np.tan(np.deg2rad(15.36)) == pytest.approx(51.44 * np.deg2rad(3.0) / 9.80665, rel=1e-3)
    assert pytest.approx(15.36, abs=0.01) == RATE_ONE_BANK_DEG
    assert np.abs(errors).max() == pytest.approx(28.5, abs=0.05)
    assert errors[0] < 0.0 < errors[180]  # turning right it lags at north and leads at south


@pytest.mark.parametrize(("bank_deg", "goes_round"), [(29.0, True), (31.0, False)])
def test_banked_beyond_90_less_the_dip_it_goes_backwards_about_east(
    bank_deg: float, goes_round: bool
) -> None:
    before, after = in_a_turn_deg(np.array([89.0, 91.0]), bank_deg)
    assert (wrap_180_deg(after - before) > 0.0) == goes_round
    north = in_a_turn_deg(np.array([-1.0, 1.0]), bank_deg)
    assert north[1] > north[0]
