from __future__ import annotations

import numpy as np
import pytest

from bench.converter_resolution import COUNTS_MAX, find_resolution, printed_decimals


@pytest.mark.parametrize(
    ("step", "decimals"), [(1.0 / 1090.0, 6), (2.0**-12, 6), (0.15, 2), (1.0 / 1370.0, 5)]
)
@pytest.mark.parametrize("offset_counts", [0, 400])
def test_the_converters_step_is_found_from_rounded_values(
    rng: np.random.Generator, step: float, decimals: int, offset_counts: int
) -> None:
    counts = rng.integers(-1500, 1500, (400, 3)) + offset_counts
    values = np.round(counts * step, decimals)

    found = find_resolution(values, decimals)

    assert found.step == pytest.approx(step, rel=1e-4)
    assert np.array_equal(found.counts(values), counts)
    assert found.rounding <= 0.53 * 10.0**-decimals


def test_a_step_is_found_although_no_value_is_near_zero(rng: np.random.Generator) -> None:
    counts = rng.integers(900, 1300, (500, 3))

    found = find_resolution(np.round(counts / 1090.0, 6), 6)

    assert np.array_equal(found.counts(np.round(counts / 1090.0, 6)), counts)


def test_integers_are_their_own_counts(rng: np.random.Generator) -> None:
    values = rng.integers(-7000, 7000, (300, 3)).astype(float)

    found = find_resolution(values, 0)

    assert (found.step, found.rounding) == (1.0, 0.0)


def test_values_off_any_step_are_rounded_so_that_the_largest_fits(
    rng: np.random.Generator,
) -> None:
    values = np.round(rng.uniform(-60.0, 60.0, (300, 3)), 4)

    found = find_resolution(values, 4)

    assert found.step == 0.002
    assert np.max(np.abs(found.counts(values))) <= COUNTS_MAX
    assert 0.0 < found.rounding <= 0.001 * (1.0 + 1e-9)


def test_the_last_printed_decimal_serves_where_it_fits(rng: np.random.Generator) -> None:
    values = np.round(rng.uniform(-2.0, 2.0, (300, 3)), 4)

    found = find_resolution(values, 4)

    assert found.step == pytest.approx(1e-4)
    assert found.rounding < 1e-15


@pytest.mark.parametrize("values", [np.zeros((5, 3)), np.full((5, 3), 1.25)])
def test_constant_values_have_a_resolution_too(values: np.ndarray) -> None:
    found = find_resolution(values, 2)

    assert found.step == 0.01
    assert found.rounding < 1e-15


@pytest.mark.parametrize(
    ("step", "decimals"), [(0.05, 2), (0.02, 2), (2.0, 0), (1.0 / 1.09, 4), (2.0**-12, 8)]
)
def test_counts_can_be_told_from_the_printed_decimals(step: float, decimals: int) -> None:
    assert printed_decimals(step) == decimals
    counts = np.arange(-32767, 32768)
    printed = np.round(counts * step, decimals)
    assert np.array_equal(np.rint(printed / step), counts)
