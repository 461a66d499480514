"""Caruso's numbers: the page's beside the paper's and physics', and what breaks them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.cli.laboratory import open_laboratory
from bench.reproduction.caruso_acceleration import RATE_ONE_BANK_DEG
from bench.reproduction.caruso_motions import measure_motions
from bench.reproduction.caruso_transfer import reproduce_transfer
from bench.reproduction.caruso_variation import reproduce_variation
from bench.reproduction.setup import Setup
from bench.reproduction.turns import headings

if TYPE_CHECKING:
    from bench.reproduction.result import Reproduction

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "papers" / "results.json"


def failing(reproduction: Reproduction) -> list[str]:
    return [f"{one.where}: {one.quantity}" for one in reproduction.numbers if not one.holds]


def number(where: str, quantity: str) -> dict[str, Any]:
    """One number of the page in docs, which `test_reproductions` holds to what the code gives."""
    papers = json.loads(RESULTS.read_text(encoding="utf-8"))["papers"]
    numbers = next(paper["numbers"] for paper in papers if paper["paper"] == "caruso")
    (found,) = (one for one in numbers if one["where"] == where and quantity in one["quantity"])
    return dict(found)


def other_unit(**changes: Any) -> Any:
    """A laboratory whose unit or site is not what the experiment asked for."""
    return lambda setup: open_laboratory(replace(setup, **changes))


@pytest.mark.parametrize(
    ("where", "quantity", "printed", "ours", "within"),
    [
        ("Fig. 4", "pitch of 10 deg", None, 8.53, 0.02),
        ("Fig. 4", "pitch of 30 deg", None, 29.85, 0.02),
        ("(4)", "Xh/Yh", 573.0, 573.0, 2.0),
        ("(4)", "bits needed over 200 mG", 9.0, 9.163, 0.005),
        ("(4)", "bits needed over +-800 mG", 12.163, 12.163, 0.005),
        ("(4)", "one count", 0.39, 0.390625, 1e-6),
        ("(4)", "heading step", 0.1, 0.112, 0.003),
        ("Table 1", "noise: standard", 0.085, 0.085, 0.003),
        ("Table 1", "noise: heading from set", 0.01, 0.024, 0.002),
        ("Table 1", "linearity: largest", 0.2, 0.2, 0.02),
        ("Table 1", "hysteresis: largest", 0.32, 0.32, 0.025),
        ("Table 1", "repeatability: RMS", 0.32, 0.32, 0.05),
        ("Table 1", "total: root", 0.49, 0.502, 0.03),
        ("Table 1", "total: the measured", 0.14, 0.144, 0.01),
        ("Fig. 6", "output", -3.0, -3.0, 0.005),
        ("Fig. 7, (7)", "Vset", 2.0, 2.0, 0.001),
        ("Temperature effects", ": an offset", 0.29, 0.29, 0.01),
        ("Temperature effects", ": a mismatch", 0.29, 0.143, 0.01),
        ("Fig. 11", "cycles", 1.0, 1.0, 0.0),
        ("Fig. 13", "cycles", 2.0, 2.0, 0.0),
        ("Soft iron", "45 deg, axis at 20", 0.0, 6.9, 0.05),
        ("Fig. 14", "dip 59", 0.5, 0.5, 0.01),
        ("Variation of the Earth's field", "printed rule, 25 deg e", 0.0, 50.0, 0.02),
        ("Variation of the Earth's field", "pole", 11.5, 9.2, 0.05),
        ("Acceleration effects", "coordinated turn", None, 28.4, 0.05),
        ("Acceleration effects", "braking with 0.1 g", None, 9.93, 0.05),
    ],
)
def test_numbers_are_those_of_the_paper_and_of_physics(
    where: str, quantity: str, printed: float | None, ours: float, within: float
) -> None:
    one = number(where, quantity)
    assert one["published"] == printed
    assert one["ours"] == pytest.approx(ours, abs=within)


@pytest.mark.parametrize(
    ("section", "changes", "broken"),
    [
        (reproduce_variation, {"hard_iron_mg": (2.0, 0.0, 0.0)}, 4),
        (reproduce_transfer, {"sensitivity": (1.01, 1.0, 1.0), "offset_mg": (0.0, 0.0, 0.0)}, 2),
    ],
)
def test_another_unit_breaks_the_numbers(section: Any, changes: Any, broken: int) -> None:
    assert len(failing(section(other_unit(**changes)))) >= broken


def test_the_same_seed_gives_the_same_numbers() -> None:
    first, second = (reproduce_variation(open_laboratory).numbers for _ in range(2))
    assert first == second


def test_motions_pay_off_in_the_paper_s_order() -> None:
    achieved = {one.method: one for one in measure_motions(open_laboratory)}
    order = ("raw", "three_headings", "min_max", "soft_iron")
    level = [achieved[method].level_rms_deg for method in order]
    assert level == sorted(level, reverse=True)
    circle, whole = achieved["soft_iron"], achieved["ellipsoid"]
    assert circle.level_rms_deg < 0.3
    assert circle.tilt_rms_deg > 5.0 * whole.tilt_rms_deg
    assert achieved["three_headings"].rig_s < circle.rig_s < whole.rig_s


def test_a_coordinated_turn_reads_level() -> None:
    inwards_g = math.tan(math.radians(RATE_ONE_BANK_DEG))
    setup = Setup(horizontal_mg=200.0, acceleration_level_g=(0.0, inwards_g, 0.0))
    with open_laboratory(setup) as laboratory:
        pose = replace(headings([90.0])[0], roll_deg=RATE_ONE_BANK_DEG)
        force = laboratory.measure([pose])[0]["accel_g"]
    assert force[:2] == pytest.approx([0.0, 0.0], abs=1e-4)
    assert force[2] == pytest.approx(-1.0 / math.cos(math.radians(RATE_ONE_BANK_DEG)), abs=1e-4)


def test_hard_stops_shake_hysteresis_out_and_gentle_ones_leave_it() -> None:
    gaps_mg = []
    for acceleration_dps2 in (180.0, 9.0):
        setup = Setup(
            horizontal_mg=200.0, hysteresis_mg=0.16, azimuth_acceleration_dps2=acceleration_dps2
        )
        with open_laboratory(setup) as laboratory:
            rising = laboratory.measure(headings([120.0, 90.0]), direction=-1)
            laboratory.measure(headings([60.0]))
            falling = laboratory.measure(headings([90.0]), direction=1)
        gaps_mg.append(float(rising["field_mg"][1, 0] - falling["field_mg"][0, 0]))
    hard_mg, gentle_mg = np.abs(gaps_mg)
    assert gentle_mg == pytest.approx(0.32, abs=0.03)
    assert hard_mg < 0.25
