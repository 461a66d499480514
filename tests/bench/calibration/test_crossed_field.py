"""The cross-axis term of the readings, against the bridge's own formula."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.compensation import Order, compensated_heading_deg
from bench.calibration.crossed_field import CROSS_AXIS, with_cross_axis, without_cross_axis
from bench.calibration.fit import Fit

HK_MG = np.array([8000.0, 7600.0, 8300.0])


def bridge_readings_mg(field_mg):
    """Half the difference of V = H/(1 + C/Hk) and -H/(1 - C/Hk)."""
    ratio = field_mg[..., CROSS_AXIS] / HK_MG
    return (field_mg / (1.0 + ratio) + field_mg / (1.0 - ratio)) / 2.0


def test_the_readings_of_a_bridge_become_the_field_but_for_second_order(rng):
    field_mg = rng.uniform(-500.0, 500.0, (500, 3))
    reading_mg = bridge_readings_mg(field_mg)

    left_mg = without_cross_axis(reading_mg, HK_MG) - field_mg

    assert np.abs(reading_mg - field_mg).max() > 1.5
    assert np.abs(left_mg).max() < 0.02


def test_taking_out_undoes_putting_in(rng):
    field_mg = rng.uniform(-600.0, 600.0, (2, 40, 3))

    again_mg = without_cross_axis(with_cross_axis(field_mg, HK_MG), HK_MG)

    assert again_mg == pytest.approx(field_mg, abs=1e-9)


@pytest.mark.parametrize(("axis", "across"), [(0, 1), (1, 0), (2, 0)])
def test_each_bridge_feels_the_field_of_one_other_axis_and_of_no_third(axis, across):
    reading_mg = np.full(3, 100.0)
    reading_mg[across] = 400.0
    third = 3 - axis - across

    (left_mg,) = without_cross_axis(reading_mg[None], HK_MG)

    assert left_mg[axis] == pytest.approx(100.0 * (1.0 - (400.0 / HK_MG[axis]) ** 2))
    reading_mg[third] = 0.0
    assert without_cross_axis(reading_mg, HK_MG)[axis] == left_mg[axis]


def test_an_axis_without_an_anisotropy_field_stays_as_it_is(rng):
    field_mg = rng.uniform(-500.0, 500.0, (10, 3))

    corrected_mg = without_cross_axis(field_mg, (8000.0, 0.0, 0.0))

    assert (corrected_mg[:, 1:] == field_mg[:, 1:]).all()
    assert (corrected_mg[:, 0] != field_mg[:, 0]).all()
    assert (with_cross_axis(field_mg, np.zeros(3)) == field_mg).all()


@pytest.mark.parametrize("order", list(Order))
def test_in_every_order_of_compensation_the_term_goes_first(order, rng):
    field_mg = rng.uniform(-400.0, 400.0, (20, 3))
    plain = Fit(method="m", offset_mg=np.array([90.0, -60.0, 20.0]), matrix=np.eye(3) * 1.02)
    knowing = Fit(method="m", offset_mg=plain.offset_mg, matrix=plain.matrix, hk_mg=HK_MG)

    of_raw = compensated_heading_deg(
        knowing, with_cross_axis(field_mg, HK_MG), pitch_deg=20.0, roll_deg=-10.0, order=order
    )

    of_field = compensated_heading_deg(plain, field_mg, pitch_deg=20.0, roll_deg=-10.0, order=order)
    assert of_raw == pytest.approx(of_field, abs=1e-9)
