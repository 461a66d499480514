"""How large residuals may be, and what is made of those that are a little larger."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.consistency import ALLOWANCE, growth, largest_chi2


@pytest.mark.parametrize("dof", [1, 5, 60, 400])
def test_noise_of_the_allowed_variance_stays_below_the_largest_sum_of_squares(dof: int) -> None:
    squares = ALLOWANCE * np.random.default_rng(dof).chisquare(dof, 20_000)
    assert squares.max() / dof < largest_chi2(dof)
    assert dof * largest_chi2(dof) < ALLOWANCE * (dof + 5.0 * np.sqrt(2.0 * dof) + 30.0)


def test_without_degrees_of_freedom_nothing_contradicts() -> None:
    assert largest_chi2(0) == largest_chi2(-3) == float("inf")
    assert growth(np.array([0.0]), 0).tolist() == [1.0]


def test_noise_grows_as_its_square_by_chance_and_more_beyond() -> None:
    found = growth(np.random.default_rng(1).chisquare(60, 10_000) / 60.0, 60)
    assert (found > 2.0).mean() < 0.002
    assert growth(np.array([0.5, 1.3, 2.0]), 60).tolist() == pytest.approx([1.0, 1.3, 10.0])
