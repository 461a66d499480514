"""What a reversal says of the station's file, in E_n numbers and words."""

from __future__ import annotations

import math

import pytest

from bench.acceptance.reversal_evaluation import (
    CHANGES,
    StationValue,
    change_over_u,
    doubts_of,
    evaluate_reversal,
    former_values,
    found_values,
)
from bench.calibration.reversal import Reversal, ReversalCause
from bench.station import load_station

U = {
    "index": 0.015, "pitch": 0.02, "roll": 0.03, "iron_x": 0.1, "iron_y": 0.1, "iron_z": 0.4,
    "field_azimuth": 0.025, "dip": 0.016,
}  # fmt: skip


@pytest.fixture(scope="module")
def station():
    return load_station("default")


def found_with(u=U, **values):
    return Reversal(
        **({"dip_deg": 60.0} | values), u=dict(u), seating_deg=(0.004, 0.006), residual_rms_mg=0.5
    )


def by_name(found, station):
    return {one.name: one for one in evaluate_reversal("r", found, former_values(station))}


def test_an_unchanged_bench_has_no_change_over_1(station):
    measured = by_name(found_with(index_deg=0.02, iron_mg=(0.05, -0.08, 0.3)), station)

    assert set(measured) == {*CHANGES, "fit_accepted", "fit_residual", "seating"}
    assert all(measured[name].value < 1.0 for name in CHANGES)
    assert measured["seating"].value == 0.006


def test_a_change_is_counted_in_the_uncertainties_of_both_and_told_in_words(station):
    measured = by_name(found_with(index_deg=0.5, iron_mg=(0.0, -2.0, 0.0)), station)

    assert measured["seat_index_change"].value == pytest.approx(0.5 / math.hypot(0.02, 0.015))
    assert measured["seat_index_change"].note == "index +0.500 deg (U 0.015), file +0.000 (U 0.020)"
    assert measured["fixture_iron_change"].note.startswith("iron y -2.00 mG (U 0.10)")


def test_an_azimuth_across_north_is_no_turn(station):
    before = StationValue(value=359.99, u=0.05, unit="deg")
    now = StationValue(value=-0.01, u=0.0, unit="deg", told=True)

    assert change_over_u(before, now) == pytest.approx(0.0, abs=1e-6)


def test_what_was_not_told_keeps_value_and_u_and_is_not_judged(station):
    told = {name: u for name, u in U.items() if name not in ("index", "iron_z")}
    found = found_with(told, index_deg=5.0, iron_mg=(0.0, 0.0, 9.0))
    former = former_values(station)

    values = found_values(found, former)

    assert "seat_index_change" not in by_name(found, station)
    assert by_name(found, station)["fixture_iron_change"].value == 0.0
    assert values["index"] == former["index"]
    assert values["iron_z"] == former["iron_z"]
    assert values["iron_x"].told


def test_a_refused_reversal_says_only_why(station):
    refused = Reversal(cause=ReversalCause.WRONG_MOUNTING, message="the unit must sit turned")

    (only,) = evaluate_reversal("r", refused, former_values(station))

    assert (only.name, only.value) == ("fit_accepted", 0.0)
    assert only.note == "reversal: wrong_mounting: the unit must sit turned"


def test_a_reversal_doubts_what_the_station_does_at_one_standard_deviation(station):
    doubts = doubts_of(station, 0.02)

    for name in (
        "one_cycle_deg", "two_cycle_deg", "fine_deg", "squareness_deg", "drift_mg", "gradient_mg",
    ):  # fmt: skip
        stated = getattr(station.surroundings, f"u_{name}")
        assert stated > 0.0
        assert getattr(doubts, name) == pytest.approx(stated / 2.0), name
    assert doubts.seating_deg == pytest.approx(0.01)
    assert doubts.strength == pytest.approx(1.0 / 250.0 / 2.0)
