"""Limit, uncertainty, TUR and conformity probability of one measurement."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from scipy.stats import norm

from bench.acceptance.measurement import Limit, Measurement
from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import sentence_of


@dataclass(frozen=True)
class KnownSpread:
    """What a computed uncertainty says of a value."""

    expanded: float
    probability: float

    def conformity(self, low, high):
        return self.probability if (low, high) == (None, 0.5) else None


def limit(**given):
    return Limit(name="level_max", unit="deg", **{"high": 0.5, **given})


def judged(value, held, **given):
    row = Measurement(name="level_max", value=value, step="verify", unit="deg", **given)
    return row.judged(held)


@pytest.mark.parametrize(
    ("value", "outcome"),
    [
        (0.41, Outcome.PASS),
        (0.4199, Outcome.PASS),
        (0.4201, Outcome.MARGINAL),
        (0.5, Outcome.MARGINAL),
        (0.5001, Outcome.FAIL),
    ],
)
def test_a_guard_factor_makes_the_guard_band_of_the_computed_uncertainty(value, outcome):
    one = judged(value, limit(guard_factor=1.0), spread=KnownSpread(0.08, 0.9))

    assert one.outcome is outcome
    assert (one.uncertainty, one.limit.uncertainty) == (0.08, 0.08)
    assert one.limit.guard_band == pytest.approx(0.08)
    assert (one.tur, one.conformity) == (pytest.approx(6.25), 0.9)
    assert one.rule == "guarded, w = 1 U"


def test_a_guard_factor_takes_the_stated_uncertainty_where_none_is_computed():
    one = judged(0.45, limit(guard_factor=0.5, uncertainty=0.06))

    assert one.limit.guard_band == pytest.approx(0.03)
    assert one.outcome is Outcome.PASS


def test_a_computed_uncertainty_leaves_a_stated_guard_band_as_it_is():
    one = judged(0.47, limit(guard_band=0.02), spread=KnownSpread(0.08, 0.7))

    assert (one.outcome, one.limit.guard_band) == (Outcome.PASS, 0.02)
    assert (one.uncertainty, one.rule) == (0.08, "guarded, w = 0.02 deg")


def test_the_conformity_of_a_stated_uncertainty_is_the_normal_distributions():
    above = judged(0.45, limit(uncertainty=0.1))
    both = judged(0.1, limit(low=0.0, uncertainty=0.1))
    below = judged(0.9, Limit(name="level_max", unit="deg", low=1.0, uncertainty=0.1))

    assert above.conformity == pytest.approx(norm.cdf(1.0))
    assert both.conformity == pytest.approx(norm.cdf(8.0) - norm.cdf(-2.0))
    assert below.conformity == pytest.approx(norm.cdf(-2.0))
    assert (above.tur, both.tur, below.tur) == (pytest.approx(5.0), pytest.approx(2.5), None)


def test_without_an_uncertainty_there_is_neither_ratio_nor_probability():
    one = judged(0.2, limit())

    assert (one.uncertainty, one.tur, one.conformity) == (None, None, None)
    assert one.rule == "simple acceptance, w = 0"


def test_a_measurement_that_only_informs_keeps_its_computed_uncertainty():
    one = judged(0.2, None, spread=KnownSpread(0.08, 0.9))

    assert (one.outcome, one.uncertainty, one.tur, one.rule) == (Outcome.PASS, 0.08, None, "")


def test_what_was_not_measured_has_no_probability():
    assert judged(float("nan"), limit(uncertainty=0.1)).conformity is None


@pytest.mark.parametrize(
    ("value", "held", "words"),
    [
        (
            0.47,
            limit(guard_factor=1.0),
            "level_max 0.47 deg is within the guard band w = 0.08 deg of its limit 0.5 deg "
            "(U = 0.08 deg)",
        ),
        (
            -0.47,
            limit(low=-0.5, guard_factor=1.0),
            "level_max -0.47 deg is within the guard band w = 0.08 deg of its limit -0.5 deg "
            "(U = 0.08 deg)",
        ),
    ],
)
def test_a_marginal_value_says_its_guard_band_and_its_uncertainty(value, held, words):
    assert sentence_of(judged(value, held, spread=KnownSpread(0.08, 0.7))) == words
