from __future__ import annotations

import numpy as np
import pytest

from bench.calibration import deviation
from bench.calibration.deviation import (
    CAUSES,
    exact_deviation,
    exact_deviation_batch,
    exact_deviation_deg,
    linear_deviation,
)
from bench.calibration.fit import Cause

EVERY_15 = np.arange(0.0, 360.0, 15.0)


def compass_deg(
    iron: tuple[float, float], soft: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
) -> np.ndarray:
    """Heading of a level compass with P, Q (in H) and a, b, d, e, from the field's components."""
    z = np.deg2rad(EVERY_15)
    x, y = np.cos(z), -np.sin(z)
    a, b, d, e = soft
    return np.rad2deg(np.arctan2(-(y + d * x + e * y + iron[1]), x + a * x + b * y + iron[0]))


def test_the_handbook_s_example_is_reproduced() -> None:
    """NGA, article 501: deviations N 10.5 ... NW -6.8."""
    magnetic = np.arange(0.0, 360.0, 45.0)
    told = np.array([10.5, 20.0, 11.5, -1.2, -5.5, -8.0, -12.5, -6.8])
    fitted = linear_deviation(magnetic - told, magnetic)
    assert fitted.coefficients_deg == pytest.approx((1.0, 12.0, 8.0, 5.0, 1.5), abs=0.07)
    assert fitted.residual_rms_deg < 0.07


def test_exact_coefficients_are_those_of_archibald_smith() -> None:
    a, b, d, e = 0.08, 0.03, -0.05, -0.06
    p, q = 0.3, -0.2
    fitted = exact_deviation(compass_deg((p, q), (a, b, d, e)), EVERY_15)
    l_smith = 1.0 + (a + e) / 2.0
    expected = np.rad2deg([d - b, 2 * p, 2 * q, a - e, d + b]) / (2.0 * l_smith)
    assert fitted.coefficients_deg == pytest.approx(tuple(expected), abs=1e-9)
    assert fitted.residual_rms_deg < 1e-9


def test_standard_errors_match_the_scatter_of_many_swings() -> None:
    rng = np.random.default_rng(1)
    clean = compass_deg((0.1, 0.05))
    swings = exact_deviation_batch(clean + rng.normal(0, 0.2, (4000, 24)), EVERY_15)
    assert not swings.cause.any()
    told = np.sqrt(np.mean(swings.sd_deg**2, axis=0))
    assert told == pytest.approx(swings.coefficients_deg.std(axis=0), rel=0.05)
    assert told[0] == pytest.approx(0.2 / np.sqrt(24), rel=0.15)


@pytest.mark.parametrize("iron", [(0.0, 0.0), (0.4, -0.3), (0.6, 0.5)])
def test_intervals_of_the_standard_errors_hold_the_truth_as_often_as_they_say(
    iron: tuple[float, float],
) -> None:
    """95 % by Student's t of 19 degrees of freedom, of each coefficient, also under large iron."""
    rng = np.random.default_rng(2)
    clean = compass_deg(iron, (0.02, 0.01, -0.02, 0.0))
    truth = np.array(exact_deviation(clean, EVERY_15).coefficients_deg)
    swings = exact_deviation_batch(clean + rng.normal(0, 0.1, (3000, 24)), EVERY_15)
    inside = np.abs(swings.coefficients_deg - truth) < 2.093 * swings.sd_deg
    assert inside.mean(axis=0) == pytest.approx(np.full(5, 0.95), abs=0.02)


def test_a_batch_gives_what_each_unit_gives_alone() -> None:
    rng = np.random.default_rng(3)
    irons = [(0.3, 0.1), (1.3, 0.0), (0.0, 0.0), (0.2, -0.7)]
    swings = np.array([compass_deg(iron) for iron in irons]) + rng.normal(0, 0.3, (4, 24))
    batch = exact_deviation_batch(swings.reshape(2, 2, 24), EVERY_15)
    for index, swing in enumerate(swings):
        alone = exact_deviation(swing, EVERY_15)
        unit = batch.unit((index // 2, index % 2))
        assert unit.coefficients_deg == pytest.approx(alone.coefficients_deg, abs=1e-6)
        assert unit.sd_deg == pytest.approx(alone.sd_deg, abs=1e-6)
        assert (unit.cause, unit.words) == (alone.cause, alone.words)
    assert CAUSES[batch.cause[0, 1]] is Cause.HARD_IRON_TOO_LARGE


def test_the_sum_of_squares_never_grows_from_the_linear_start() -> None:
    rng = np.random.default_rng(5)
    magnetic = np.deg2rad(np.tile(EVERY_15, (300, 1)))
    scatter = rng.uniform(0.0, 1.5, (300, 1)) * rng.normal(0.0, 1.0, (300, 24))
    start = rng.normal(0.0, 0.5, (300, 5))
    before, _ = deviation._exact_residual(start, magnetic, scatter)
    found, _ = deviation._descended(start, magnetic, scatter)
    after, _ = deviation._exact_residual(found, magnetic, scatter)
    assert np.all((after**2).sum(axis=-1) <= (before**2).sum(axis=-1))


def test_whatever_the_headings_no_number_is_nan() -> None:
    rng = np.random.default_rng(4)
    wild = exact_deviation_batch(rng.uniform(0.0, 360.0, (500, 24)), EVERY_15)
    for values in (wild.coefficients_deg, wild.sd_deg, wild.residual_rms_deg, wild.third_deg):
        assert np.isfinite(values).all()
    assert {CAUSES[code] for code in wild.cause} >= {Cause.HARD_IRON_TOO_LARGE}
    strong = np.array([compass_deg((p, 0.0)) for p in np.linspace(0.0, 0.99, 100)])
    found = exact_deviation_batch(strong, EVERY_15)
    assert found.residual_rms_deg.max() < 1e-6
    assert not found.cause.any()


def test_a_hard_iron_that_reverses_the_field_is_refused() -> None:
    fitted = exact_deviation(compass_deg((1.2, 0.0)), EVERY_15)
    assert fitted.cause == Cause.HARD_IRON_TOO_LARGE
    assert "degauss" in fitted.words[0]


@pytest.mark.parametrize("iron", [0.5, 0.8, 0.95])
def test_a_large_hard_iron_below_the_field_is_fitted(iron: float) -> None:
    fitted = exact_deviation(compass_deg((0.6 * iron, -0.8 * iron)), EVERY_15)
    assert np.deg2rad(fitted.coefficients_deg[1:3]) == pytest.approx([0.6 * iron, -0.8 * iron])


def test_words_name_the_largest_error_first() -> None:
    assert exact_deviation(compass_deg((0.2, 0.0)), EVERY_15).words[0].startswith("hard iron")
    soft = exact_deviation(compass_deg((0.0, 0.0), (0.2, 0.0, 0.0, -0.2)), EVERY_15)
    assert soft.words[0].startswith("soft iron")
    constant = exact_deviation(EVERY_15 - 3.0, EVERY_15)
    assert constant.words == (
        "constant error (lubber line, mounting azimuth or declination): 3.00 deg",
    )
    assert exact_deviation(EVERY_15, EVERY_15).words == ("no error of 0.1 deg or more",)


def test_a_fourth_harmonic_is_told_as_non_linearity() -> None:
    compass = EVERY_15 - 0.7 * np.sin(np.deg2rad(4 * EVERY_15))
    fitted = exact_deviation(compass, EVERY_15)
    assert fitted.fourth_deg == pytest.approx(0.7, abs=0.01)
    assert fitted.third_deg < 0.01
    assert "non-linearity" in fitted.words[0]


def test_a_fourth_harmonic_at_8_headings_is_not_told_twice_as_large() -> None:
    headings = EVERY_15[::3]
    compass = headings - 0.7 * np.cos(np.deg2rad(4.0 * headings))
    assert exact_deviation(compass, headings).fourth_deg == pytest.approx(0.7, abs=0.01)


@pytest.mark.parametrize(
    ("headings", "cause", "words"),
    [
        (EVERY_15[:7], Cause.TOO_FEW, "at least 8 headings"),
        (EVERY_15[:0], Cause.TOO_FEW, "at least 8 headings"),
        (EVERY_15[:12], Cause.NO_TURN, "gap of more than 90 deg"),
        (np.zeros(24), Cause.NO_TURN, "gap of more than 90 deg"),
        (np.repeat([0.0, 90.0, 180.0, 270.0], 3), Cause.TOO_FEW, "at 5 places"),
        (np.repeat([0.0, 90.0, 180.0, 270.0], 2) + [0.0, 1e-3] * 4, Cause.TOO_FEW, "at 5 places"),
    ],
)
def test_few_headings_or_a_part_of_a_turn_are_refused(
    headings: np.ndarray, cause: Cause, words: str
) -> None:
    for fitted in (exact_deviation(headings, headings), linear_deviation(headings, headings)):
        assert fitted.cause == cause
        assert words in fitted.words[0]
        assert fitted.coefficients_deg == fitted.sd_deg == (0.0,) * 5


def test_headings_that_wrap_do_not_make_an_error() -> None:
    assert exact_deviation(EVERY_15 + 720.5, EVERY_15).coefficients_deg[0] == pytest.approx(
        -0.5, abs=1e-4
    )


def test_unusable_headings_are_named() -> None:
    with pytest.raises(ValueError, match="one shape"):
        exact_deviation(EVERY_15, EVERY_15[:5])
    with pytest.raises(ValueError, match="match in n"):
        exact_deviation_batch(np.zeros((3, 24)), np.zeros(23))
    with pytest.raises(ValueError, match="finite"):
        linear_deviation(np.full(24, np.nan), EVERY_15)


def test_exact_form_is_evaluated_as_it_is_fitted() -> None:
    compass = compass_deg((0.3, 0.1), (0.05, 0.02, 0.01, -0.03))
    coefficients = exact_deviation(compass, EVERY_15).coefficients_deg
    back = np.mod(EVERY_15 - exact_deviation_deg(coefficients, EVERY_15) - compass + 180, 360)
    assert back == pytest.approx(np.full(24, 180.0))
