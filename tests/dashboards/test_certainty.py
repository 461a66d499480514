from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dashboards.certainty_views import certainty_tab
from dashboards.recorder import write_recording
from dashboards.run_view import RunView
from dashboards.verdict_text import certainty_markdown

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Recorded


@pytest.mark.parametrize("kind", ["level", "tilt"])
def test_u_and_u_of_the_test_stand_about_the_errors_that_were_judged(
    recorded: Recorded, kind: str
) -> None:
    level = {
        entry["position"]: entry
        for entry in recorded.record["uncertainty"]["headings"]
        if (max(abs(entry["pitch_deg"]), abs(entry["roll_deg"])) < 1.0) == (kind == "level")
    }

    shown = recorded.scalars(f"certainty/{kind}/verified")

    assert len(shown) == len(level) == 24
    assert np.abs(shown).max() == pytest.approx(recorded.value(f"{kind}_max"), abs=1e-9)
    for name in ("u", "u_test"):
        path = f"certainty/{kind}/{name}"
        assert recorded.measured(path, "values") == pytest.approx(shown)
        half_deg = np.sqrt(recorded.measured(path, "variances"))
        assert half_deg == pytest.approx([entry[f"{name}_deg"] for entry in level.values()])


def test_acceptance_limit_lies_inside_the_limit_by_the_guard_band(recorded: Recorded) -> None:
    entry = next(m for m in recorded.record["measurements"] if m["name"] == "level_max")

    lines = recorded.scalars("heading_error_deg/accepted")

    accept_deg = entry["high"] - entry["guard_band"]
    assert entry["guard_band"] > 0.0
    assert lines.reshape(2, 2) == pytest.approx(np.array([[accept_deg, -accept_deg]] * 2))
    assert recorded.scalars("certainty/level/accepted") == pytest.approx(lines)


def test_errors_of_the_whole_run_have_u_where_they_were_verified(recorded: Recorded) -> None:
    half_deg = np.sqrt(recorded.measured("heading_error_deg/u", "variances"))

    told = [entry["u_deg"] for entry in recorded.record["uncertainty"]["headings"]]
    assert sorted(half_deg) == pytest.approx(sorted(told))


def test_budget_is_told_the_largest_contribution_first(recorded: Recorded) -> None:
    text = certainty_markdown(recorded.record)

    ranked = sorted(
        recorded.record["uncertainty"]["budget"],
        key=lambda line: -np.hypot(line["level_deg"], line["tilt_deg"]),
    )
    places = [text.index(f"| {line['name']} |") for line in ranked[:4]]
    assert places == sorted(places)
    assert "Most of the uncertainty is the" in text
    assert "No run on this seat can see" in text


def test_record_of_before_the_budget_is_drawn_without_it(
    recorded: Recorded, tmp_path: Path
) -> None:
    old = {key: value for key, value in recorded.record.items() if key != "uncertainty"}
    (tmp_path / "samples.parquet").write_bytes((recorded.folder / "samples.parquet").read_bytes())

    write_recording(tmp_path / "run.rrd", old)

    assert (tmp_path / "run.rrd").stat().st_size > 0
    assert certainty_tab(RunView(tmp_path, old)) is None
    assert "no uncertainty" in certainty_markdown(old)


def test_run_that_failed_before_its_verification_has_no_such_tab(failed: Recorded) -> None:
    assert certainty_tab(RunView(failed.folder, failed.record)) is None
    assert not [path for path in failed.entities() if path.startswith("/certainty/")]
