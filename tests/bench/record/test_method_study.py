"""The comparison of methods in the record, in the table and in the curves."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from bench.acceptance.site import heading_error_deg, is_level
from bench.calibration.ranking import RAW
from bench.record.document import read_record
from bench.record.method_charts import error_dots, method_panel, order_dots, panel_top_deg
from bench.record.method_study import MethodRow, method_rows, no_model, order_rows
from bench.record.recorded_fits import (
    VERIFIED_KINDS,
    fit_of,
    judged_method,
    recorded_fits,
    step_positions,
    written_method,
)
from bench.record.report import report_of
from bench.record.swing import HeadingPoint, site_of, swing_of
from bench.sample_file import read_samples
from bench.samples import READING, readings_of

LIMITS = {"level": 0.5, "tilted": 0.8}


def entry(method, cause=None, **achieved):
    keys = ("level_rms_deg", "level_max_deg", "tilt_rms_deg", "tilt_max_deg")
    return {
        "method": method,
        "cause": cause,
        "message": "the rig must turn by 360 deg" if cause else "",
        "offset_mg": [90.0, -60.0, 40.0],
        "matrix": None if cause else np.eye(3).tolist(),
        "accel_offset_g": None,
        "accel_matrix": None,
        "achieved": {key: achieved.get(key) for key in keys},
    }


def orders(**tilt_max_deg):
    return {
        order: {"level_max_deg": 0.2, "tilt_max_deg": value}
        for order, value in tilt_max_deg.items()
    }


@pytest.fixture
def readings():
    rows = np.zeros(3, dtype=READING)
    rows["field_mg"] = [[340.0, -60.0, 473.0], [90.0, -310.0, 473.0], [300.0, -160.0, 300.0]]
    rows["accel_g"] = [0.0, 0.0, -1.0]
    rows["rig_pitch_deg"] = 10.0
    return rows


def text_of(html):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html))


def xml_of(drawing):
    return ET.fromstring(str(drawing))


def test_every_recorded_error_is_that_of_the_curve_that_is_drawn(good_run):
    record = read_record(good_run)
    rows = readings_of(read_samples(good_run / "samples.parquet"))
    rows = rows[np.isin(rows["position"], step_positions(record, VERIFIED_KINDS))]
    level = is_level(rows)
    recorded = {fit["method"]: fit["achieved"] for fit in record["fits"] if not fit["cause"]}
    recorded[RAW] = record["study"]["raw"]

    headings = recorded_fits(record).headings_deg(rows)

    assert headings.keys() == recorded.keys()
    for method, heading_deg in headings.items():
        error_deg = np.abs(heading_error_deg(heading_deg, rows, site_of(record)))
        assert error_deg[level].max() == pytest.approx(recorded[method]["level_max_deg"], abs=1e-9)
        assert error_deg[~level].max() == pytest.approx(recorded[method]["tilt_max_deg"], abs=1e-9)


def test_report_ranks_raw_and_all_methods_and_marks_the_written_one(good_run):
    html = (good_run / "report.html").read_text()
    table = html[html.index("Methods on the same readings") : html.index("Order of compensation")]

    names = re.findall(r"<td>([^<]+?)\s*</td>|<td>([^<]+) <span", table)

    rows = method_rows(read_record(good_run))
    assert [row.name for row in rows][:2] == ["raw readings", "truth aided"]
    assert [plain or marked for plain, marked in names] == [row.name for row in rows]
    assert [marked for _, marked in names if marked] == ["truth aided"]
    assert table.count('<span class="soft">written</span>') == 1


def test_order_of_compensation_is_shown_with_its_reason(good_run):
    record = read_record(good_run)
    text = text_of((good_run / "report.html").read_text())
    section = text[text.index("Order of compensation") : text.index("All measurements")]

    (best, *_) = order_rows(record)

    body, *others = best.effects
    assert [e.order for e in best.effects] == ["body", "soft_first", "tilt_first", "tilt_reversed"]
    assert max(other.tilt_max_deg for other in others) > 10.0 * body.tilt_max_deg
    assert "tilt, hard iron, soft iron" in section
    assert "turn with the module" in section


def test_a_record_of_before_the_study_has_a_report_without_raw_and_orders(good_run):
    record = read_record(good_run)
    del record["study"]

    text = text_of(report_of(good_run, record))

    assert "Methods on the same readings" in text
    assert "Order of compensation" not in text
    assert method_rows(record)[0].key == "truth_aided"


def test_refused_methods_stand_last_with_their_sentence(good_run):
    record = read_record(good_run)
    fit = next(f for f in record["fits"] if f["method"] == "ellipsoid")
    fit.update(cause="not_observable", message="tilt the module further", matrix=None)

    text = text_of(report_of(good_run, record))

    assert method_rows(record)[-1].name == "ellipsoid"
    assert "Refused, not observable: tilt the module further" in text
    assert "ellipsoid" not in swing_of(good_run, record).methods


def test_who_lends_the_tilt_is_told_in_words():
    record = {
        "fits": [entry("min_max"), entry("soft_iron")],
        "study": {"tilt_from": {"min_max": "accelerometer", "soft_iron": "given"}},
    }

    assert [row.tilt_from for row in method_rows(record)] == ["accelerometer", "the rig"]
    record["study"]["raw"] = {"level_max_deg": 30.0}
    assert [row.tilt_from for row in method_rows(record)] == ["the rig", "accelerometer", "the rig"]
    assert method_rows({"fits": [entry("min_max")]})[0].tilt_from == "raw"


def test_methods_of_one_order_have_no_row_of_orders():
    record = {
        "fits": [entry("two_axis"), entry("min_max")],
        "study": {
            "orders": {"two_axis": orders(body=1.0), "min_max": orders(tilt_first=12.0, body=8.0)}
        },
    }

    (row,) = order_rows(record)

    assert row.key == "min_max"
    assert [(e.order, e.tilt_max_deg) for e in row.effects] == [("body", 8.0), ("tilt_first", 12.0)]


def test_fit_of_two_axes_comes_back_as_one():
    two = {**entry("two_axis"), "extended_dip_deg": 48.7, "extra": {"horizontal_mg": 301.0}}

    fit = fit_of(two)

    assert fit.two_axis
    assert fit.extra == {"horizontal_mg": 301.0}
    assert not fit_of(entry("min_max")).two_axis


def test_a_borrowed_tilt_levels_the_readings(readings):
    lender = {
        **entry("accelerometer"),
        "accel_offset_g": [0.1, 0.0, 0.0],
        "accel_matrix": np.eye(3).tolist(),
    }
    fits = [entry("min_max"), lender]
    borrowing = recorded_fits({"fits": fits, "study": {"tilt_from": {"min_max": "accelerometer"}}})
    without = recorded_fits({"fits": fits, "study": {"tilt_from": {"min_max": "raw"}}})

    borrowed_deg = borrowing.headings_deg(readings)["min_max"]

    assert borrowed_deg[2] != pytest.approx(without.headings_deg(readings)["min_max"][2], abs=1.0)
    own_deg = borrowing.headings_deg(readings)["accelerometer"]
    raw_deg = borrowing.headings_deg(readings)[RAW]
    assert np.abs(own_deg - raw_deg).max() > 1.0


def test_with_the_tilt_given_the_force_takes_no_part(readings):
    given = recorded_fits(
        {"fits": [entry("min_max")], "study": {"tilt_from": {"min_max": "given"}}}
    )
    before = given.headings_deg(readings)
    readings["accel_g"] = np.nan

    after = given.headings_deg(readings)

    assert after["min_max"] == pytest.approx(before["min_max"])
    assert after[RAW] == pytest.approx(before[RAW])


def test_judged_method_is_written_only_where_something_was_written():
    record = {
        "measurements": [{"name": "fit_accepted", "note": "min_max: too few: turn further"}],
        "coefficients": {},
    }

    assert judged_method(record) == "min_max"
    assert written_method(record) is None
    assert written_method({**record, "coefficients": {"written": {"version": 1}}}) == "min_max"


def test_only_the_last_attempt_of_a_step_counts():
    record = {
        "steps": [{"name": "verify", "kind": "verify"}, {"name": "sweep", "kind": "sweep"}],
        "poses": [
            {"step": "sweep", "position": 0, "attempt": 1},
            {"step": "verify", "position": 1, "attempt": 1},
            {"step": "verify", "position": 2, "attempt": 2},
        ],
    }

    assert step_positions(record, VERIFIED_KINDS) == [2]
    assert step_positions(record, ("sweep",)) == [0]


def test_what_was_expected_stands_beside_what_was_achieved_for_every_method(good_run):
    record = read_record(good_run)

    for row in method_rows(record):
        assert row.expected["level_rms_deg"] == pytest.approx(row.level_rms_deg, rel=0.6), row.key
        assert row.expected["tilt_max_deg"] == pytest.approx(row.tilt_max_deg, rel=0.6), row.key
    (best, *_) = [row for row in method_rows(record) if row.written]
    assert best.claimed_rms_deg < best.expected["level_rms_deg"] < best.expected["level_max_deg"]


def test_the_recorded_expectation_is_that_of_the_band_that_is_drawn(good_run):
    record = read_record(good_run)

    swing = swing_of(good_run, record)

    assert swing.expected.keys() == swing.methods.keys()
    for method, points in swing.expected.items():
        squares = [p.error_deg**2 + p.sd_deg**2 for p in points]
        recorded = record["study"]["expected"][method]["level_rms_deg"]
        assert np.sqrt(np.mean(squares)) == pytest.approx(recorded, abs=1e-9), method


def study_of_one(claim_deg, achieved_deg, *, without="", noise_deg=0.09):
    fit = entry("m", level_rms_deg=0.09, tilt_rms_deg=achieved_deg)
    fit["predicted_heading_rms_deg"] = claim_deg
    noise = {"level_deg": noise_deg, "tilt_deg": noise_deg}
    return {
        "fits": [fit],
        "study": {"expected_noise": noise, "claim_without": {"m": without}, "expected": {"m": {}}},
    }


@pytest.mark.parametrize(
    ("record", "marked"),
    [
        (study_of_one(0.03, 0.15), False),
        (study_of_one(0.03, 0.25), True),
        (study_of_one(0.20, 0.25), False),
        (study_of_one(0.03, 5.00, without="level only"), False),
        (study_of_one(0.03, 5.00, without="without rotation"), False),
        (study_of_one(None, 5.00), False),
        (study_of_one(0.03, 5.00, noise_deg=None), False),
    ],
)
def test_a_method_is_marked_where_it_is_wrong_without_saying_so(record, marked):
    (row,) = method_rows(record)

    assert row.unsaid is marked


def test_why_nothing_was_expected_is_said():
    refused = entry("truth_aided", cause="degenerate")

    assert no_model({"study": {"expected": {"raw": {}}}}) == ""
    assert "fitted no model" in no_model({"fits": [entry("min_max")]})
    assert "was refused" in no_model({"fits": [refused]})
    assert no_model({"fits": [entry("truth_aided")]}) == "the record has none"


def test_a_report_without_a_model_of_the_unit_says_so(good_run):
    record = read_record(good_run)
    record["study"]["expected"] = None

    text = text_of(report_of(good_run, record))

    assert "No expected error: the record has none." in text
    assert swing_of(good_run, record).expected == {}


def test_claim_expected_and_achieved_stand_on_one_scale():
    row = MethodRow(
        key="m", name="m", level_max_deg=2.0, claimed_max_deg=0.12, claim_without="level only",
        expected={"level_max_deg": 1.9}, unsaid=True, tilt_max_deg=8.0,
    )  # fmt: skip

    drawing = xml_of(error_dots(row, LIMITS))

    expected, achieved = drawing.findall("circle")
    (claim,) = [c for c in drawing.findall("line") if "claim" in c.get("class")]
    assert expected.get("class") == "mark level other"
    assert float(claim.get("x1")) < float(expected.get("cx")) < float(achieved.get("cx"))
    assert claim.get("class") == "claim unsaid"


def test_errors_stand_on_a_logarithmic_scale_held_to_its_ends():
    def place(deg):
        row = MethodRow(key="m", name="m", level_max_deg=deg)
        return float(xml_of(error_dots(row, LIMITS)).find("circle").get("cx"))

    assert place(1.0) - place(0.1) == pytest.approx(place(10.0) - place(1.0), abs=0.11)
    assert place(1e-6) == place(0.05) < place(60.0) == place(179.0)


def test_a_method_without_tilted_poses_has_no_tilted_mark():
    row = MethodRow(key="m", name="m", level_max_deg=0.3)

    drawing = xml_of(error_dots(row, LIMITS))

    assert drawing.find("path") is None
    assert len(drawing.findall("line[@class='limit level']")) == 1


def test_own_order_is_the_filled_one():
    record = {
        "fits": [entry("min_max")],
        "study": {"orders": {"min_max": orders(body=0.3, tilt_first=11.0)}},
    }

    drawing = xml_of(order_dots(order_rows(record)[0]))

    marks = {mark.find("title").text: mark.get("class") for mark in drawing.findall("path")}
    assert marks == {
        "hard iron, soft iron, tilt: tilted 0.3 deg": "mark tilted",
        "tilt, hard iron, soft iron: tilted 11 deg": "mark tilted other",
    }


def test_a_panel_holds_every_point_and_draws_raw_behind():
    def turn(amplitude_deg):
        return [
            HeadingPoint(
                heading_deg=h, error_deg=amplitude_deg * np.sin(h), level=True, direction=0
            )
            for h in np.arange(0.0, 360.0, 15.0)
        ]

    raw, points = turn(36.0), turn(0.2)
    top_deg = panel_top_deg([*raw, *points])

    drawing = xml_of(method_panel(points, raw, top_deg=top_deg, limit_deg=0.5, title="t"))

    assert top_deg == 60.0
    assert [c.get("class") for c in drawing.findall("polyline")] == ["curve before", "curve after"]
    heights = [float(c.get("cy")) for c in drawing.findall("circle")]
    assert len(heights) == 24
    assert min(heights) > 6.0
    assert max(heights) < 132.0
    assert len(drawing.findall("line[@class='limit']")) == 2
