from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.record.recorded_fits import VERIFIED_KINDS, step_positions
from dashboards.method_views import methods_tab
from dashboards.recorder import write_recording
from dashboards.run_view import RunView

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Recorded


def test_heading_of_every_method_stands_beside_raw_one_value_a_dwell(recorded: Recorded) -> None:
    methods = ["raw", *recorded.record["ranking"]]

    rows = {method: recorded.scalars(f"methods/{method}/heading_deg") for method in methods}

    assert len(methods) > 4
    assert {len(values) for values in rows.values()} == {len(recorded.record["poses"])}
    assert all(np.isfinite(values).all() for values in rows.values())


@pytest.mark.parametrize("name", ["recorded", "two_axis"])
def test_errors_shown_are_those_that_rank_the_methods(
    name: str, request: pytest.FixtureRequest
) -> None:
    run: Recorded = request.getfixturevalue(name)
    achieved = {fit["method"]: fit["achieved"] for fit in run.record["fits"] if not fit["cause"]}
    achieved["raw"] = run.record["study"]["raw"]

    for method, errors in achieved.items():
        for kind in ("level", "tilt"):
            shown = run.scalars(f"methods/{method}/error_deg/{kind}")
            assert np.abs(shown).max() == pytest.approx(errors[f"{kind}_max_deg"], abs=1e-9)


def test_best_method_is_far_better_than_raw(recorded: Recorded) -> None:
    best = recorded.scalars(f"methods/{recorded.record['ranking'][0]}/error_deg/tilt")
    raw = recorded.scalars("methods/raw/error_deg/tilt")

    assert np.abs(best).max() < 0.05 * np.abs(raw).max()


def test_two_axes_are_drawn_by_their_own_heading(two_axis: Recorded) -> None:
    """The raw z, read as if calibrated, would be wrong by degrees where the module is tilted."""
    shown = two_axis.scalars("heading_error_deg/samples")
    module = two_axis.scalars("heading_error_deg/verified_tilt")

    assert np.abs(module).max() == pytest.approx(two_axis.value("tilt_max"), abs=1e-9)
    assert np.sqrt(np.mean(shown**2)) < 0.5


def test_estimated_z_stands_beside_the_measured_one(two_axis: Recorded) -> None:
    estimated = two_axis.scalars("field/z_estimated")
    measured = two_axis.scalars("field/z_measured")
    poses = [pose["position"] for pose in two_axis.record["poses"]]
    verified = np.isin(poses, step_positions(two_axis.record, VERIFIED_KINDS))

    difference = two_axis.scalars("field/z_difference")

    assert difference == pytest.approx(estimated - measured, abs=1e-9)
    rms_mg = np.sqrt(np.mean(difference[verified] ** 2))
    assert rms_mg == pytest.approx(two_axis.value("z_estimate_difference"), rel=1e-3)
    assert np.ptp(estimated[verified]) > 50.0 * rms_mg


def test_three_axes_have_no_estimated_z(recorded: Recorded) -> None:
    assert not [path for path in recorded.entities() if path.startswith("/field/")]


def test_run_without_a_write_shows_the_heading_that_was_judged(compared: Recorded) -> None:
    shown = compared.scalars("heading_error_deg/verified_level")

    assert np.abs(shown).max() == pytest.approx(compared.value("achieved_level_max"), abs=1e-9)


def test_record_of_before_the_study_is_drawn_without_it(recorded: Recorded, tmp_path: Path) -> None:
    old = {key: value for key, value in recorded.record.items() if key != "study"}
    (tmp_path / "samples.parquet").write_bytes((recorded.folder / "samples.parquet").read_bytes())

    write_recording(tmp_path / "run.rrd", old)

    assert (tmp_path / "run.rrd").stat().st_size > 0
    assert methods_tab(RunView(tmp_path, old)) is not None


def test_run_without_a_fit_has_no_tab_of_methods(failed: Recorded) -> None:
    assert methods_tab(RunView(failed.folder, failed.record)) is None
    assert not [path for path in failed.entities() if path.startswith("/methods/")]


def test_what_was_expected_is_a_band_about_every_methods_error(recorded: Recorded) -> None:
    expected = recorded.record["study"]["expected"]

    for method, errors in expected.items():
        for kind in ("level", "tilt"):
            path = f"methods/{method}/error_deg/expected_{kind}"
            middle_deg = recorded.measured(path, "values")
            sd_deg = np.sqrt(recorded.measured(path, "variances")) / 2.0
            rms_deg = np.sqrt(np.mean(middle_deg**2 + sd_deg**2))
            assert rms_deg == pytest.approx(errors[f"{kind}_rms_deg"], rel=1e-6), path


def test_two_axes_without_a_model_of_the_unit_have_no_band(two_axis: Recorded) -> None:
    assert two_axis.record["study"]["expected"] is None
    assert not [path for path in two_axis.entities() if "/expected_" in path]
