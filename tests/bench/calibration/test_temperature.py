"""Temperature coefficients of a run that warms up: found, and honest about what else changes."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.crossed_field import CROSS_AXIS
from bench.calibration.temperature import (
    WANDER_G,
    accel_drift_g_per_c,
    offset_tempco_mg_per_c,
    sensitivity_tempco_per_c,
)

COUNT = 150
T_S = np.linspace(40.0, 340.0, COUNT)
TEMPERATURE_C = 25.0 + 0.4 * (1.0 - np.exp(-T_S / 500.0))


def readings_mg(rng):
    turn = np.deg2rad(np.arange(COUNT) * 15.0)
    field = np.column_stack([250.0 * np.cos(turn), -250.0 * np.sin(turn), 433.0 + 0.0 * turn])
    return field + [120.0, -80.0, 30.0] + rng.normal(0.0, 0.3, field.shape)


def test_an_offset_that_warms_is_told_beside_the_cross_axis_term(rng):
    field = readings_mg(rng)
    truth = np.array([0.5, -0.3, 0.1])
    half_sum = np.outer(TEMPERATURE_C - 25.0, truth) - field * field[:, CROSS_AXIS] / 8000.0 + 20.0

    found = offset_tempco_mg_per_c(field, half_sum, TEMPERATURE_C)

    assert found.per_c == pytest.approx(truth, abs=1e-6)
    assert (found.sd_per_c < 1e-5).all()


def test_a_coefficient_is_found_within_its_uncertainty(rng):
    sigmas = []
    for _ in range(200):
        strength = 1.0 - 0.003 * (TEMPERATURE_C - 25.0) + rng.normal(0.0, 7e-4, COUNT)
        found = sensitivity_tempco_per_c(strength, TEMPERATURE_C)
        sigmas.append((found.per_c[0] + 0.003) / found.sd_per_c[0])

    # four degrees of freedom, and room for slow noise
    assert np.mean(np.abs(sigmas) < 2.78) > 0.95


def test_a_drift_of_the_field_is_in_the_uncertainty_and_not_in_the_claim(rng):
    drift = 1e-4 * (T_S - T_S[0]) / np.ptp(T_S)
    strength = 1.0 + drift + rng.normal(0.0, 1e-6, COUNT)

    blind = sensitivity_tempco_per_c(strength, TEMPERATURE_C)
    aware = sensitivity_tempco_per_c(strength, TEMPERATURE_C, drift_sd=1e-4)

    assert abs(blind.per_c[0]) > 5.0 * blind.sd_per_c[0]
    assert abs(aware.per_c[0]) < 2.0 * aware.sd_per_c[0]


def test_a_wandering_zero_is_not_taken_for_a_drift(rng):
    steps_s = np.diff(T_S, prepend=T_S[0])
    sigmas = []
    for _ in range(60):
        walk = np.cumsum(rng.normal(0.0, 1.0, (COUNT, 3)), axis=0)
        walk *= WANDER_G * np.sqrt(steps_s.mean() / 100.0)
        found = accel_drift_g_per_c(walk + rng.normal(0.0, 3e-4, walk.shape), TEMPERATURE_C, T_S)
        sigmas.append(found.per_c / found.sd_per_c)

    assert np.mean(np.abs(sigmas) < 2.0) > 0.93


@pytest.mark.parametrize(
    ("rows", "warm"), [(slice(0, 10), 1.0), (slice(0, 0), 1.0), (slice(0, COUNT), 0.0)]
)
def test_too_few_readings_or_no_warmth_tell_nothing(rows, warm, rng):
    field = readings_mg(rng)[rows]
    temperature_c = 25.0 + warm * (TEMPERATURE_C[rows] - 25.0)

    offset = offset_tempco_mg_per_c(field, field, temperature_c)
    drift = accel_drift_g_per_c(field / 1e3, temperature_c, T_S[rows])
    gain = sensitivity_tempco_per_c(np.linalg.norm(field, axis=1), temperature_c)

    for found in (offset, drift, gain):
        assert np.isnan(found.per_c).all()
        assert np.isnan(found.sd_per_c).all()
