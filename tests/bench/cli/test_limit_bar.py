from __future__ import annotations

import pytest

from bench.acceptance.measurement import Limit, Measurement
from bench.cli.limit_bar import limit_bar, limits_text


def measured(value: float, **limit: float | None) -> Measurement:
    measurement = Measurement(name="m", value=value, step="s", unit="deg")
    return measurement.judged(Limit(name="m", unit="deg", **limit)) if limit else measurement


def test_value_stands_at_its_share_of_the_span() -> None:
    assert limit_bar(measured(0.25, high=0.5), width=8) == " [----#---] "


@pytest.mark.parametrize(("value", "bar"), [(0.6, " [--------]>"), (-0.1, "<[--------] ")])
def test_value_outside_stands_behind_its_bracket(value: float, bar: str) -> None:
    assert limit_bar(measured(value, low=0.0, high=0.5), width=8) == bar


def test_a_value_that_could_not_be_measured_is_a_question() -> None:
    assert limit_bar(measured(float("nan"), high=0.5), width=8) == " [--------]?"


def test_value_on_the_limit_is_inside() -> None:
    assert limit_bar(measured(0.5, low=0.0, high=0.5), width=8) == " [-------#] "


def test_guard_band_is_drawn_at_the_limit_that_it_guards() -> None:
    assert limit_bar(measured(0.1, high=0.8, guard_band=0.2), width=8) == " [-#----~~] "


def test_lower_limit_alone_ends_at_twice_its_value() -> None:
    assert limit_bar(measured(6.0, low=4.0), width=8) == " [----#---] "
    assert limit_bar(measured(60.0, low=4.0), width=8) == " [-------#] "


def test_count_that_must_be_zero_has_no_span() -> None:
    assert limit_bar(measured(0.0, high=0.0), width=4).strip() == "="
    assert limit_bar(measured(1.0, high=0.0), width=4).strip() == "x"


def test_measurement_that_informs_has_no_bar() -> None:
    assert limit_bar(measured(1.0)).strip() == ""
    assert limits_text(measured(1.0)) == "deg"


@pytest.mark.parametrize(
    ("limit", "text"),
    [
        ({"high": 0.5}, "<= 0.5 deg"),
        ({"low": 4.0}, ">= 4 deg"),
        ({"low": 1.0, "high": 2.0}, "1 .. 2 deg"),
        ({"low": 1.0, "high": 1.0}, "= 1 deg"),
    ],
)
def test_limits_are_told_with_their_unit(limit: dict[str, float], text: str) -> None:
    assert limits_text(measured(1.0, **limit)) == text
