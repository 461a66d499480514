"""Conformity probabilities against closed forms and against a plain simulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from bench.uncertainty.conformity import probability_within, simulated_rms_deg


def test_one_error_has_the_normal_distributions_probability():
    for error_deg in (0.0, 0.3, 0.45, 0.6):
        expected = norm.cdf((0.5 - error_deg) / 0.05) - norm.cdf((-0.5 - error_deg) / 0.05)
        assert probability_within([error_deg], np.array([[0.05]]), 0.5) == pytest.approx(expected)


def test_one_shared_quantity_decides_as_one_error_however_many_poses_there_are():
    shared = np.full((24, 1), 0.05)

    found = probability_within(np.full(24, 0.45), shared, 0.5)

    assert found == pytest.approx(norm.cdf(1.0), abs=2e-3)


def test_independent_errors_multiply():
    found = probability_within(np.full(24, 0.45), 0.05 * np.eye(24), 0.5)

    assert found == pytest.approx(norm.cdf(1.0) ** 24, rel=1e-9)


def test_a_mixture_of_shared_and_own_draws_is_that_of_a_simulation():
    rng = np.random.default_rng(2)
    columns = np.concatenate([rng.normal(0.0, 0.02, (12, 5)), 0.03 * np.eye(12)], axis=1)
    errors = rng.normal(0.0, 0.2, 12)
    true = errors - rng.standard_normal((400_000, columns.shape[1])) @ columns.T
    for limit_deg in (np.abs(errors).max() - 0.03, np.abs(errors).max() + 0.05):
        simulated = np.mean(np.abs(true).max(axis=1) <= limit_deg)

        found = probability_within(errors, columns, float(limit_deg))
        assert found == pytest.approx(simulated, abs=4.0 * 0.5 / np.sqrt(400_000) + 1e-3)


def test_leading_axes_are_units_of_one_bench():
    rng = np.random.default_rng(3)
    columns, errors = rng.normal(0.0, 0.03, (6, 4)), rng.normal(0.0, 0.2, (2, 3, 6))

    found = probability_within(errors, columns, 0.4)

    assert found.shape == (2, 3)
    assert found[1, 2] == probability_within(errors[1, 2], columns, 0.4)


def test_the_same_numbers_give_the_same_probability_to_the_last_bit():
    rng = np.random.default_rng(4)
    columns, errors = rng.normal(0.0, 0.03, (24, 9)), rng.normal(0.0, 0.2, 24)

    assert probability_within(errors, columns, 0.4) == probability_within(errors, columns, 0.4)


def test_a_bench_without_doubt_knows_for_certain():
    assert probability_within([0.1, 0.49], np.zeros((2, 1)), 0.5) == 1.0
    assert probability_within([0.1, 0.51], np.zeros((2, 1)), 0.5) == 0.0


def test_the_rms_of_true_errors_scatters_as_a_simulation_does():
    rng = np.random.default_rng(6)
    columns = np.concatenate([np.full((24, 1), 0.03), 0.02 * np.eye(24)], axis=1)
    errors = rng.normal(0.0, 0.1, 24)
    true = errors - rng.standard_normal((100_000, 25)) @ columns.T
    simulated = np.sqrt(np.mean(true**2, axis=1))

    found = simulated_rms_deg(errors, columns)

    assert found.mean() == pytest.approx(simulated.mean(), rel=2e-3)
    assert found.std() == pytest.approx(simulated.std(), rel=0.03)
