"""report.html: one file, everything said, nothing fetched."""

from __future__ import annotations

import re
import shutil
from xml.etree import ElementTree as ET

import pytest

from bench.record.charts import Band, heading_error_chart, limit_bar, xy_chart
from bench.record.document import read_record
from bench.record.heading_axes import tick_step
from bench.record.report import (
    distance,
    limits_text,
    number,
    report_of,
    rewrite_report,
    rounded,
    spoken,
    value_text,
)
from bench.record.swing import HeadingPoint, swing_of


def text_of(html):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html))


def test_a_report_needs_no_network_and_runs_no_script(good_run):
    html = (good_run / "report.html").read_text()

    assert not re.search(r"""(src|href|url\()\s*=?\s*["']?(https?:)?//""", html)
    assert "<script" not in html
    assert "@import" not in html
    assert "prefers-color-scheme: dark" in html
    assert "@media print" in html


def test_every_chart_is_well_formed_and_none_is_missing(good_run):
    charts = re.findall(r"<svg.*?</svg>", (good_run / "report.html").read_text(), re.DOTALL)

    for chart in charts:
        ET.fromstring(chart)
    panels = 1 + len(read_record(good_run)["ranking"])
    assert sum('class="chart"' in chart for chart in charts) == 3 + panels
    assert sum('class="dots two"' in chart for chart in charts) == panels
    assert sum('class="bar"' in chart for chart in charts) >= 30


def test_verdict_numbers_and_method_are_said(good_run):
    text = text_of((good_run / "report.html").read_text())

    for said in (
        "PASS",
        "SN0001",
        "Next: Release the unit.",
        "truth aided written",
        "own claim expected achieved",
    ):
        assert said in text
    assert "What needs attention" not in text
    assert "nan" not in text.lower().split()


def test_the_failed_limit_comes_first_with_limit_distance_and_action(bad_run):
    text = text_of((bad_run / "report.html").read_text())
    attention = text[text.index("What needs attention") : text.index("Heading error")]

    assert "1 of 39 judged" in attention
    assert "0.702 deg ≤ 0.5 deg 0.202 deg outside" in attention
    assert "Look at level_max in the fault guide." in attention


def test_no_peak_is_averaged_away(bad_run):
    """Each of the 48 verification poses and 49 raw ones is a mark of its own."""
    record = read_record(bad_run)

    swing = swing_of(bad_run, record)

    assert (len(swing.raw), len(swing.compensated)) == (49, 48)
    largest = max(abs(point.error_deg) for point in swing.compensated if point.level)
    recorded = next(m["value"] for m in record["measurements"] if m["name"] == "level_max")
    assert largest == pytest.approx(recorded, abs=1e-12)


def test_text_from_outside_is_escaped(good_run):
    record = read_record(good_run)
    record["run"]["serial"] = "<img src=x>"
    record["measurements"][0]["note"] = "<b>&</b>"

    html = report_of(good_run, record)

    assert "<img" not in html
    assert "&lt;b&gt;&amp;&lt;/b&gt;" in html


def test_a_run_without_samples_or_end_still_has_a_report(good_run, tmp_path):
    run = shutil.copytree(good_run, tmp_path / "run")
    (run / "samples.parquet").unlink()
    record = read_record(run)
    record.update(verdict=None, poses=[], fits=[], deviation={}, coefficients={}, station={})

    text = text_of(report_of(run, record))

    assert "ERROR" in text
    assert "run did not end" in text


def test_a_report_can_be_written_again(good_run, tmp_path):
    run = shutil.copytree(good_run, tmp_path / "run")
    before = (run / "report.html").read_text()
    (run / "report.html").unlink()

    assert rewrite_report(run).read_text() == before


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (0.0, "0"), (12345.6, "12346"), (-0.5, "−0.500"), (1e-6, "1e−06")],
)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [(0.09681, 0.08, "0.097"), (2.7e-5, 0.5, "0.00"), (578.117, 2.0, "578.1"), (1.0, 0.0, "1"),
     (-0.001, 0.5, "0.00"), (-20.04, 0.5, "−20.04")],
)  # fmt: skip
def test_values_are_rounded_to_the_second_digit_of_their_uncertainty(value, uncertainty, text):
    assert rounded(value, uncertainty) == text


def entry(value, low=None, high=None, **more):
    base = {"name": "a", "unit": "deg", "uncertainty": 0.01, "guard_band": 0.0, "outcome": "PASS"}
    return {**base, "value": value, "low": low, "high": high, **more}


def test_checks_say_yes_or_no():
    row = entry(1.0, low=1.0, name="serial_match", unit="", uncertainty=0.0)

    assert (value_text(row), limits_text(row), distance(row)) == ("yes", "yes", "")
    assert value_text({**row, "value": 0.0}) == "no"
    assert value_text({**row, "value": None}) == "not measured"
    assert value_text(entry(0.25, high=0.5)) == "0.250 deg"


def test_limits_and_distances_are_words():
    assert limits_text(entry(0.0, -1.0, 1.0)) == "−1 … 1 deg"
    assert limits_text(entry(0.0, 4.0)) == "≥ 4 deg"
    assert distance(entry(0.7, high=0.5)) == "0.200 deg outside"
    assert distance(entry(0.9, -1.0, 1.0)) == "0.100 deg inside"
    assert distance(entry(None, high=0.5)) == ""
    assert spoken("tilt_max is above") == "Tilt max is above"


@pytest.mark.parametrize(
    "row",
    [
        entry(0.2, high=0.5),
        entry(90.0, high=0.5, outcome="FAIL"),
        entry(-9.0, low=-1.0, high=1.0, outcome="FAIL"),
        entry(0.0, high=0.0),
        entry(-0.99, low=0.7),
        entry(-5.0, high=-2.0, low=None),
        entry(1.0, low=1.0, high=1.0),
    ],
)
def test_a_bar_stays_inside_its_picture(row):
    chart = ET.fromstring(str(limit_bar(row)))

    places = [float(e.get(k)) for e in chart for k in ("x", "x1", "x2", "cx") if e.get(k)]
    assert all(0.0 <= place <= 170.0 for place in places)


def test_what_has_no_limit_or_value_has_no_bar():
    assert limit_bar(entry(1.0)) == ""
    assert limit_bar(entry(None, high=1.0)) == ""


def test_the_scale_of_an_error_chart_holds_the_largest_error_and_the_limit():
    points = [
        HeadingPoint(heading_deg=h, error_deg=e, level=True, direction=0)
        for h, e in ((0.0, 0.1), (90.0, -0.93), (359.0, 0.2))
    ]
    band = Band(limit_deg=0.5, guard_deg=0.05, name="level")

    chart = ET.fromstring(str(heading_error_chart(points, [band], "t")))

    heights = [float(mark.get("cy")) for mark in chart.iter("circle")]
    assert len(heights) == 3
    assert all(12.0 <= height <= 216.0 for height in heights)


def test_ticks_are_round():
    assert [tick_step(span) for span in (0.9, 3.0, 40.0, 1000.0)] == [0.2, 1.0, 10.0, 200.0]


def test_the_turn_is_drawn_with_north_up_and_east_right():
    chart = ET.fromstring(str(xy_chart([(100.0, 0.0), (0.0, 100.0)], [], 250.0, "t")))

    north, east = [c for c in chart.iter("circle") if "mark" in c.get("class")]
    assert float(north.get("cy")) < 125.0 == float(north.get("cx"))
    assert float(east.get("cx")) > 125.0 == float(east.get("cy"))
