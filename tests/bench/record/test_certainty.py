"""How sure the verified headings are: budget, words, drawings."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree as ET

import pytest

from bench.record.certainty import (
    budget_rows,
    certainty,
    dominant_words,
    left_out_words,
    unseen_words,
    verified_poses,
)
from bench.record.certainty_charts import verified_chart
from bench.record.charts import Band
from bench.record.document import read_record
from bench.record.report import report_of

BAND = Band(limit_deg=0.5, guard_deg=0.08, name="level")


def line(name, level_deg, tilt_deg, group="unit", **changes):
    return {
        "name": name, "source": "B", "distribution": "normal, U/2", "group": group,
        "shared": group == "bench", "value": 0.3, "unit": "mG", "level_deg": level_deg,
        "tilt_deg": tilt_deg, **changes,
    }  # fmt: skip


def heading(position, azimuth_deg, error_deg, pitch_deg=0.0, u_deg=0.2):
    return {
        "position": position, "azimuth_deg": azimuth_deg, "pitch_deg": pitch_deg, "roll_deg": 0.0,
        "error_deg": error_deg, "u_deg": u_deg, "u_test_deg": 0.08,
    }  # fmt: skip


@pytest.fixture
def section():
    return {
        "coverage_factor": 2.0,
        "rule": "guarded, w = 1 U",
        "headings": [
            heading(86, 7.5, 0.1), heading(87, 352.5, -0.21), heading(88, 22.5, 0.3, pitch_deg=30.0)
        ],
        "budget": [
            line("seat index", 0.02, 0.02, "bench"),
            line("repeatability", 0.08, 0.09),
            line("nonlinearity", 0.0, 0.0, value=0.0, distribution="part of the unit's own error"),
        ],
        "level": {"u_max_deg": 0.08, "u_rms_deg": 0.03, "tur": 6.2, "conformity": 0.9876},
        "tilt": {"u_max_deg": 0.08, "u_rms_deg": 0.03, "tur": 9.8, "conformity": 1.0},
    }  # fmt: skip


@pytest.fixture
def record(section):
    station = {"field_azimuth_deg": 2.5, "seat": {"u_index_deg": 0.04, "u_iron_mg": 0.05}}
    return {"uncertainty": section, "station": station}


def test_a_record_of_before_the_budget_has_no_section():
    assert certainty({}, {}) is None
    assert certainty({"uncertainty": {"headings": [], "budget": []}}, {}) is None


def test_the_largest_contribution_stands_first_with_its_part_of_the_variance(record):
    first, second = budget_rows(record)

    assert (first.name, second.name) == ("repeatability", "seat index")
    assert first.share == pytest.approx(100.0 * 0.08**2 / (0.08**2 + 0.02**2))
    assert first.share + second.share == pytest.approx(100.0)


def test_sums_are_quadratic_and_u_is_k_times_the_whole(record):
    found = certainty(record, {"level": BAND})

    unit, bench, whole, expanded = (row["level_deg"] for row in found["sums"])
    assert (unit, bench) == (0.08, 0.02)
    assert whole == pytest.approx(math.hypot(unit, bench))
    assert expanded == pytest.approx(2.0 * whole)


def test_one_sentence_says_what_dominates_and_what_the_bench_adds(record):
    text = dominant_words(budget_rows(record))

    assert text.startswith("Most of the uncertainty is the repeatability (94 % of the variance)")
    assert "then the seat index (6 %); the bench adds 6 %." in text
    assert dominant_words([]) == ""


def test_what_costs_nothing_is_named_apart_with_its_reason(record):
    assert left_out_words(record) == (
        " Not in U: nonlinearity (part of the unit's own error)."
    )  # fmt: skip


def test_what_the_run_cannot_see_is_said_with_the_day_of_its_reversal(record):
    never = unseen_words(record)
    record["station"]["seat"].update(verified="2026-11-20", golden="GOLD-1")

    since = unseen_words(record)

    assert "index (U 0.04 deg) or iron in the fixture (U 0.05 mG)" in never
    assert "never verified by reversal" in never
    assert since.endswith("The reversal of 2026-11-20 with GOLD-1 found them.")
    assert "never verified" in unseen_words({})


def test_poses_stand_by_their_magnetic_heading_level_and_tilted_apart(record):
    poses = verified_poses(record)

    assert [pose.heading_deg for pose in poses["level"]] == [5.0, 350.0]
    assert [pose.position for pose in poses["tilted"]] == [88]


def test_every_error_has_its_two_intervals_between_the_limits(record):
    poses = verified_poses(record)["level"]

    drawing = ET.fromstring(str(verified_chart(poses, BAND, "level", "t")))

    whiskers = [e for e in drawing.findall("line") if "whisker" in e.get("class")]
    thick = [e for e in whiskers if "test" in e.get("class")]
    assert (len(drawing.findall("circle")), len(thick), len(whiskers)) == (2, 2, 8)
    limits = [float(e.get("y1")) for e in drawing.findall("line[@class='limit']")]
    accepted = [float(e.get("y1")) for e in drawing.findall("line[@class='accept']")]
    assert min(limits) < min(accepted) < max(accepted) < max(limits)
    heights = [float(e.get(end)) for e in whiskers for end in ("y1", "y2")]
    assert min(heights) >= 12.0
    assert max(heights) <= 216.0


def test_an_interval_beyond_the_limit_stays_inside_the_drawing(record):
    record["uncertainty"]["headings"] = [heading(1, 10.0, 1.4, u_deg=0.9)]
    poses = verified_poses(record)["level"]

    drawing = ET.fromstring(str(verified_chart(poses, None, "level", "t")))

    heights = [float(e.get(end)) for e in drawing.iter("line") for end in ("y1", "y2")]
    assert 12.0 <= min(heights) <= max(heights) <= 216.1


def test_the_report_tells_how_sure_it_is(good_run, section):
    record = read_record(good_run)
    record["uncertainty"] = section

    html = report_of(good_run, record)
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html))

    part = text[text.index("How sure") : text.index("Deviation")]
    assert "Level: largest error 0.21 deg, U 0.20 deg; conforming to 0.5 deg" in part
    assert "98.8 %" in part
    assert "6.2 : 1" in part
    assert part.index("repeatability") < part.index("seat index")
    assert "Decision rule: guarded, w = 1 U." in part
    for chart in re.findall(r"<svg.*?</svg>", html, re.DOTALL):
        ET.fromstring(chart)


def test_a_report_of_an_older_record_does_not_mention_it(good_run):
    record = read_record(good_run)
    record.pop("uncertainty", None)

    assert "How sure" not in report_of(good_run, record)


def test_ratio_and_conformity_stand_at_their_measurement(good_run):
    record = read_record(good_run)
    entry = next(m for m in record["measurements"] if m["name"] == "level_max")
    entry.update(tur=6.25, conformity=0.998, uncertainty=0.08)

    html = report_of(good_run, record)

    assert "6.2 : 1" in html
    assert "99.8 %" in html
