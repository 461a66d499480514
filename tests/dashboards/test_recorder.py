from __future__ import annotations

import shutil
import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.samples import COMPLETE
from dashboards.recorder import write_recording
from dashboards.run_view import RunView
from dashboards.viewer import executable

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Recorded

SERIES = (
    "heading_deg/raw",
    "heading_deg/module",
    "heading_deg/compensated",
    "heading_deg/reference",
    "heading_error_deg/samples",
    "heading_error_deg/verified_level",
    "heading_error_deg/verified_tilt",
    "raw_heading_error_deg/raw",
    "magnetometer_mg/raw",
    "rig/azimuth_deg",
    "can/load_percent",
)


@pytest.mark.parametrize("path", SERIES)
def test_every_series_is_there_and_holds_no_value_that_is_not_finite(
    recorded: Recorded, path: str
) -> None:
    values = recorded.scalars(path)

    assert len(values) > 0
    assert np.isfinite(values).all()


def test_verified_errors_shown_are_the_ones_judged(recorded: Recorded) -> None:
    level = recorded.scalars("heading_error_deg/verified_level")
    tilt = recorded.scalars("heading_error_deg/verified_tilt")

    assert len(level) == 24
    assert len(tilt) == 24
    assert np.abs(level).max() == pytest.approx(recorded.value("level_max"), abs=1e-9)
    assert np.abs(tilt).max() == pytest.approx(recorded.value("tilt_max"), abs=1e-9)


def test_limit_band_is_as_wide_as_the_limit(recorded: Recorded) -> None:
    limit = next(m["high"] for m in recorded.record["measurements"] if m["name"] == "level_max")
    (variances,) = [
        batch.column("Measurements:variances").flatten().to_numpy(zero_copy_only=False)
        for batch in recorded.chunks("heading_error_deg/limit")
        if "Measurements:variances" in batch.schema.names
    ]

    assert np.sqrt(variances) == pytest.approx([limit, limit])


def test_compensation_shown_beats_the_raw_heading_by_far(recorded: Recorded) -> None:
    raw = recorded.scalars("raw_heading_error_deg/raw")
    compensated = recorded.scalars("heading_error_deg/samples")

    assert np.sqrt(np.mean(compensated**2)) < 0.05 * np.sqrt(np.mean(raw**2))


def test_every_complete_sample_has_its_heading(recorded: Recorded) -> None:
    blocks = list(RunView(recorded.folder).blocks())
    rows = sum(int((block.samples["complete"] == COMPLETE).sum()) for block in blocks)

    assert len(recorded.scalars("heading_deg/module")) == rows


def test_no_line_averages_its_peaks_away(recorded: Recorded) -> None:
    lines = [
        batch
        for batch in recorded.chunks("**")
        if "SeriesLines:aggregation_policy" in batch.schema.names
    ]

    assert lines
    for batch in lines:
        policy = batch.column("SeriesLines:aggregation_policy").flatten().to_pylist()
        assert policy == [1]  # rerun's AggregationPolicy.Off


def test_two_recordings_of_one_run_are_equal(recorded: Recorded, again: Path) -> None:
    original = recorded.folder / "run.rrd"
    compared = subprocess.run(
        [executable(), "rrd", "compare", "--unordered", original, again],
        capture_output=True,
        check=False,
    )

    assert compared.returncode == 0, compared.stderr.decode()


def test_recording_has_its_footer(again: Path) -> None:
    verified = subprocess.run(
        [executable(), "rrd", "verify", again], capture_output=True, check=False
    )

    assert verified.returncode == 0, verified.stderr.decode()
    assert not again.with_name("run.rrd.part").exists()


def test_failed_run_without_a_fit_has_a_recording_with_its_verdict(failed: Recorded) -> None:
    entities = failed.entities()

    assert "/acceptance/verdict" in entities
    assert "/heading_deg/raw" in entities
    assert not [
        batch
        for batch in failed.chunks("heading_deg/compensated")
        if "Scalars:scalars" in batch.schema.names
    ]


def test_recording_without_a_rig_shows_fields_and_headings_and_claims_no_error(
    replayed: Recorded,
) -> None:
    drawn = ("magnetometer_mg/raw", "heading_deg/raw", "heading_deg/compensated")

    for path in drawn:
        assert np.isfinite(replayed.scalars(path)).all()
    assert not [
        batch
        for path in ("heading_deg/reference", "raw_heading_error_deg/**", "rig/**", "methods/**")
        for batch in replayed.chunks(path)
        if "Scalars:scalars" in batch.schema.names
    ]


def test_run_that_never_measured_has_a_recording_too(recorded: Recorded, tmp_path: Path) -> None:
    shutil.copy(recorded.folder / "record.json", tmp_path)

    write_recording(tmp_path / "run.rrd", {"run": {"id": "x", "serial": "SN0001"}})

    assert (tmp_path / "run.rrd").stat().st_size > 0
