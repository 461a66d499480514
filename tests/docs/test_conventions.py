"""docs/conventions.md says what the code does."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from bench.calibration.compensation import Order
from bench.calibration.tilt import ned_from_body, tilt_compensated_heading_deg
from bench.record.document import FieldWatchSection, StudySection
from protocols.compass import FLAG_TWO_AXIS, PART_TWO_AXIS
from protocols.reference_field import REFERENCE_ADDRESS, REFERENCE_MG_PER_COUNT

DOCS = Path(__file__).resolve().parents[2] / "docs"
FIELD_NED_MG = np.array([250.0, 0.0, 433.0])
FORCE_NED_G = np.array([0.0, 0.0, -1.0])


def worked_by_hand() -> list[tuple[tuple[float, ...], ...]]:
    """Return the rows of the table: attitude, body field and force, three numbers each."""
    text = (DOCS / "conventions.md").read_text().partition("**Worked by hand.**")[2]
    cells = re.findall(r"^\| (-?\d[^|]*) \| ([^|]*) \| ([^|]*) \|$", text, re.MULTILINE)
    return [tuple(tuple(map(float, cell.split(","))) for cell in row) for row in cells]


def test_the_table_is_found() -> None:
    assert len(worked_by_hand()) == 4


@pytest.mark.parametrize("row", worked_by_hand(), ids=lambda row: str(row[0]))
def test_field_and_force_of_an_attitude(row: tuple[tuple[float, ...], ...]) -> None:
    attitude, field_mg, force_g = row

    body_from_ned = ned_from_body(*attitude).T

    assert np.allclose(body_from_ned @ FIELD_NED_MG, field_mg, atol=1e-9)
    assert np.allclose(body_from_ned @ FORCE_NED_G, force_g, atol=1e-12)


@pytest.mark.parametrize("row", worked_by_hand()[:2], ids=lambda row: str(row[0]))
def test_the_heading_is_the_level_attitudes_azimuth(row: tuple[tuple[float, ...], ...]) -> None:
    attitude, field_mg, force_g = row

    heading_deg = tilt_compensated_heading_deg(np.array([field_mg]), np.array([force_g]))

    assert heading_deg[0] == pytest.approx(attitude[0], abs=1e-9)


def test_orders_study_and_two_axes_have_the_names_of_the_code() -> None:
    text = (DOCS / "conventions.md").read_text()

    assert f"part {PART_TWO_AXIS}, status flag {FLAG_TWO_AXIS:X}h" in text
    assert all(f"`{order}`" in text for order in Order)
    assert all(f"\n| `{name}` |" in text for name in StudySection.model_fields)


def test_the_field_watch_has_the_names_of_the_record_and_of_the_wire() -> None:
    text = (DOCS / "conventions.md").read_text()

    assert all(f"\n| `{name}` |" in text for name in FieldWatchSection.model_fields)
    assert f"source address {REFERENCE_ADDRESS:X}h, frame `RefField`" in text
    assert f"{REFERENCE_MG_PER_COUNT} mG a count" in text


def test_each_decision_has_context_decision_and_consequences() -> None:
    decisions = sorted((DOCS / "decisions").glob("[0-9]*.md"))

    assert [path.name[:4] for path in decisions] == [f"{i:04d}" for i in range(len(decisions))]
    for path in decisions:
        headings = re.findall(r"^## (.*)$", path.read_text(), re.MULTILINE)
        assert headings == ["Context", "Decision", "Consequences"], path
