"""Konvalin's experiments on the virtual bench: what they show, and that their numbers can miss."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.compensation import Order
from bench.cli.laboratory import open_laboratory
from bench.reproduction import konvalin_numbers
from bench.reproduction.konvalin_iron import (
    FIG_9_DEG,
    HARD_IRON_MG,
    SITE,
    SKEWED,
    SoftIronStudy,
    ellipse,
    measured_circle,
    measured_ellipse,
    skew_deg,
    soft_iron_study,
    stages_mg,
)
from bench.reproduction.konvalin_tilt import (
    BANK,
    OrderStudy,
    changes_deg,
    measured_elevation,
    measured_orders,
)

if TYPE_CHECKING:
    from bench.reproduction.result import Published


TILTS_DEG = (-30.0, 0.0, 30.0)
AXES_DEG = (0.0, 90.0, 110.0)


@pytest.fixture(scope="module")
def orders() -> OrderStudy:
    return measured_orders(open_laboratory, TILTS_DEG)


@pytest.fixture(scope="module")
def study() -> SoftIronStudy:
    return soft_iron_study(open_laboratory, AXES_DEG)


def holding(numbers: list[Published]) -> list[bool]:
    return [number.holds for number in numbers]


def test_elevation_moves_the_raw_heading_as_the_vertical_field_says() -> None:
    """Held at 90 deg: tan(error) = tan(dip) sin(elevation), 53.0 deg at dip 60."""
    found = measured_elevation(open_laboratory)
    moved = changes_deg(found.raw_deg)
    expected = np.arctan(3.0**0.5 * np.sin(np.deg2rad(found.pitch_deg)))
    assert moved[1] == pytest.approx(np.rad2deg(expected), abs=0.02)
    assert moved[3] == pytest.approx(-np.rad2deg(expected), abs=0.02)
    assert np.abs(changes_deg(found.levelled_deg)).max() < 0.02
    assert all(holding(konvalin_numbers.tilt_numbers(found)))
    swapped = replace(found, levelled_deg=found.raw_deg, turn_raw_deg={0.0: found.turn_deg})
    assert not any(holding(konvalin_numbers.tilt_numbers(swapped)))


def test_circle_numbers_miss_on_other_iron() -> None:
    circle = measured_circle(open_laboratory, SITE)
    hard = measured_circle(open_laboratory, replace(SITE, hard_iron_mg=HARD_IRON_MG))
    assert all(holding(konvalin_numbers.circle_numbers(circle, hard)))
    assert not any(holding(konvalin_numbers.circle_numbers(hard, circle)))
    assert np.hypot(*hard.corrected_mg.T) == pytest.approx(np.full(36, 250.0), abs=0.05)


def test_ellipse_is_aligned_then_round_and_numbers_miss_on_another() -> None:
    straight = measured_ellipse(open_laboratory, ellipse(0.0))
    rotated = measured_ellipse(open_laboratory, ellipse(FIG_9_DEG))
    skewed = measured_ellipse(open_laboratory, replace(SITE, soft_iron=SKEWED))
    aligned, scaled, back = stages_mg(rotated)
    assert aligned[:, 0].max() == pytest.approx(4.0 / 3.0 * aligned[:, 1].max(), rel=0.01)
    assert np.abs((aligned**2 @ [1.0, (4.0 / 3.0) ** 2]) ** 0.5 / 285.714 - 1.0).max() < 3e-4
    for stage in (scaled, back):
        assert np.ptp(np.hypot(*stage.T)) < 0.1
    assert skew_deg(skewed)[1] < 0.01
    assert all(holding(konvalin_numbers.ellipse_numbers(straight, rotated, skewed)))
    turned = replace(rotated, corrected_mg=rotated.raw.field_mg, fit=skewed.fit)
    assert holding(konvalin_numbers.ellipse_numbers(rotated, turned, straight)) == [
        True,  # two cycles all the same
        False,
        False,
        False,
        False,
    ]


def test_soft_iron_as_printed_fails_and_corrected_holds(study: SoftIronStudy) -> None:
    numbers = konvalin_numbers.soft_iron_numbers(study)
    assert [number.holds for number in numbers if number.unit == "deg"] == [True] * 3
    assert study.failed[[AXES_DEG.index(0.0), AXES_DEG.index(90.0)]].max() == 0.0
    assert (study.largest_deg["printed"] > study.largest_deg["raw"] + 5.0).all()
    assert study.largest_deg["ours"].max() < 0.4


def test_soft_iron_numbers_miss_where_the_formulas_change_places(study: SoftIronStudy) -> None:
    named = study.largest_deg
    exchanged = {**named, "ours": named["raw"], "angle": named["ratio"], "ratio": named["angle"]}
    other = replace(study, largest_deg=exchanged, failed=np.zeros_like(study.failed))
    assert not any(holding(konvalin_numbers.soft_iron_numbers(other)))


def test_order_matters_at_tilt_only(orders: OrderStudy) -> None:
    level = TILTS_DEG.index(0.0)
    assert orders.mapped_deg[Order.BODY].max() < 0.02
    for way in (Order.TILT_FIRST, Order.TILT_REVERSED, BANK):
        errors = orders.mapped_deg[way]
        assert errors[level, level] < 0.02
        assert errors[0, 0] > 3.0
    for way in (Order.TILT_REVERSED, BANK):  # one tilt alone has no order
        assert orders.mapped_deg[way][level].max() < 0.02
        assert orders.mapped_deg[way][:, level].max() < 0.02
    assert orders.own_tilt_deg[0] < 0.02


def test_order_numbers_miss_where_the_orders_change_places(orders: OrderStudy) -> None:
    assert all(holding(konvalin_numbers.order_numbers(orders)))
    named = orders.named_deg
    exchanged = {
        Order.BODY: named[BANK],
        BANK: named[Order.BODY],
        Order.TILT_FIRST: named[Order.TILT_REVERSED],
        Order.TILT_REVERSED: named[Order.TILT_FIRST],
    }
    other = replace(orders, named_deg=exchanged, own_tilt_deg=(0.0, 0.0))
    assert not any(holding(konvalin_numbers.order_numbers(other)))
