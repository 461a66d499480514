"""The module's single-precision heading against a double-precision one written another way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from devices.firmware import Converters, HeadingFormula
from protocols.uds import DEFAULT_COEFFICIENTS, Coefficients

MG, G = Converters().mag_mg_per_count, Converters().accel_g_per_count


def ned_from_body(azimuth_deg, pitch_deg, roll_deg):
    a, p, r = np.radians((azimuth_deg, pitch_deg, roll_deg))
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_y = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    return about_z @ about_y @ about_x


def counts_at(azimuth_deg, pitch_deg, roll_deg):
    """Return (set - reset, force) in counts of an ideal module, field 250 mG and dip 60 deg."""
    body_from_ned = ned_from_body(azimuth_deg, pitch_deg, roll_deg).T
    field_mg = body_from_ned @ np.array([250.0, 0.0, 250.0 * math.tan(math.radians(60.0))])
    force_g = body_from_ned @ np.array([0.0, 0.0, -1.0])
    difference = tuple(int(value) for value in np.rint(2.0 * field_mg / MG))
    return difference, tuple(int(value) for value in np.rint(force_g / G))


def double_precision(difference, force, coefficients):
    """Return heading, pitch, roll by rotation matrices in float64 from the same counts."""
    field = np.reshape(coefficients.mag_matrix, (3, 3)) @ (
        np.array(difference) * MG / 2.0 - coefficients.mag_offset_mg
    )
    f = np.reshape(coefficients.accel_matrix, (3, 3)) @ (
        np.array(force) * G - coefficients.accel_offset_g
    )
    pitch = math.degrees(math.atan2(f[0], math.hypot(f[1], f[2])))
    roll = math.degrees(math.atan2(-f[1], -f[2]))
    level = ned_from_body(0.0, pitch, roll) @ field
    return math.degrees(math.atan2(-level[1], level[0])) % 360.0, pitch, roll


def wrapped(difference_deg):
    return (difference_deg + 180.0) % 360.0 - 180.0


@pytest.mark.parametrize("azimuth", [0, 45, 90, 135, 180, 225, 270, 315, 359])
@pytest.mark.parametrize(
    ("pitch", "roll"), [(0, 0), (30, 0), (-30, 0), (0, 30), (0, -30), (20, 25)]
)
def test_an_ideal_module_shows_the_attitude_it_is_held_at(azimuth, pitch, roll):
    formula = HeadingFormula(DEFAULT_COEFFICIENTS, Converters())

    solution = formula.solve(*counts_at(azimuth, pitch, roll))

    assert solution is not None
    assert wrapped(solution[0] - azimuth) == pytest.approx(0.0, abs=0.03)
    assert solution[1] == pytest.approx(pitch, abs=0.01)
    assert solution[2] == pytest.approx(roll, abs=0.01)


def test_single_precision_costs_less_than_a_thousandth_of_a_degree(rng):
    coefficients = Coefficients(
        version=1,
        mag_offset_mg=(120.0, -150.0, 60.0),
        mag_matrix=tuple((np.eye(3) + rng.normal(0.0, 0.1, (3, 3))).ravel().tolist()),
        accel_offset_g=(0.03, -0.03, 0.02),
        accel_matrix=tuple((np.eye(3) + rng.normal(0.0, 0.01, (3, 3))).ravel().tolist()),
    )
    formula = HeadingFormula(coefficients, Converters())
    worst = 0.0
    for _ in range(500):
        azimuth, pitch, roll = rng.uniform((0, -45, -45), (360, 45, 45))
        difference, force = counts_at(azimuth, pitch, roll)
        single = formula.solve(difference, force)
        double = double_precision(difference, force, coefficients)
        worst = max(worst, abs(wrapped(single[0] - double[0])), abs(single[1] - double[1]))

    assert 0.0 < worst < 1e-3


@pytest.mark.parametrize("force", [(0, 0, 0), (0, 0, -4000), (16384, 0, 0)])
def test_without_an_attitude_there_is_no_heading(force):
    formula = HeadingFormula(DEFAULT_COEFFICIENTS, Converters())

    assert formula.solve((2000, 0, 4000), force) is None


def test_the_heading_stays_below_360():
    formula = HeadingFormula(DEFAULT_COEFFICIENTS, Converters())
    for east in range(-3, 4):
        heading, _, _ = formula.solve((5000, east, 8000), (0, 0, -16384))
        assert 0.0 <= heading < 360.0
