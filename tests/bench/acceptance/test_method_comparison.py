"""Methods side by side: whose tilt they use, what each achieves, and how far the judged is behind.

The module that is compared on needs no correction, unless the test gives it an error.
"""

from __future__ import annotations

import numpy as np
import pytest

from bench.acceptance.method_comparison import (
    achieved_by,
    evaluate_comparison,
    evaluate_rank,
    ranking,
    study_of,
)
from bench.calibration.fit import Cause, Fit
from bench.calibration.tilt import ned_from_body
from bench.samples import readings_of

KEYS = {"level_rms_deg", "level_max_deg", "tilt_rms_deg", "tilt_max_deg"}
REFUSED = Fit(method="refused", cause=Cause.NO_TURN)


def fit_of(method, matrix=None, **changes):
    matrix = np.eye(3) if matrix is None else matrix
    return Fit(method=method, offset_mg=np.zeros(3), matrix=matrix, **changes)


def achieved(fits, readings, site):
    return achieved_by(fits, study_of(fits, readings, site))


@pytest.fixture
def readings_by(make_unit, poses_of_run):
    """Return what makes the verification's readings of a module with the errors given."""

    def make(**errors):
        perfect = {
            "gain": np.eye(3), "hard_iron_mg": np.zeros(3), "accel_gain": np.eye(3),
            "accel_bias_g": np.zeros(3), "noise_mg": 0.0, "repeatability_mg": 0.0,
        }  # fmt: skip
        return readings_of(make_unit(**perfect | errors).samples(poses_of_run["verify"]))

    return make


def test_the_error_of_perfect_coefficients_is_small_and_of_a_refused_fit_absent(readings_by, site):
    readings = readings_by()
    fits = {"identity": fit_of("identity"), "refused": REFUSED}

    both = achieved(fits, readings, site)

    assert set(both["identity"]) == KEYS
    assert both["identity"]["level_max_deg"] < 0.2
    assert both["refused"] == {}
    level_only = achieved(fits, readings[:24], site)["identity"]
    assert set(level_only) == {"level_rms_deg", "level_max_deg"}


def test_the_bench_judges_the_error_that_the_coefficients_leave(readings_by, site):
    fits = {"turned": fit_of("turned", ned_from_body(1.0, 0.0, 0.0))}

    found = evaluate_comparison("compare", "turned", fits, readings_by(), site)

    assert [m.name for m in found] == [
        "achieved_level_max", "achieved_level_rms", "achieved_tilt_max", "achieved_tilt_rms"
    ]  # fmt: skip
    assert {m.unit for m in found} == {"deg"}
    assert found[1].value == pytest.approx(1.0, abs=0.03)
    assert found[0].note.endswith("turned, tilt raw")
    assert (
        evaluate_comparison("compare", "refused", {"refused": REFUSED}, readings_by(), site) == []
    )


def test_level_poses_are_levelled_by_the_rig_where_no_fit_calibrates_the_accelerometer(
    readings_by, site
):
    """30 mg of raw bias are 3 deg at dip 60: they would hide what the methods differ in."""
    readings = readings_by(accel_bias_g=np.array([0.03, -0.03, 0.0]))
    magnetometer = {"min_max": fit_of("min_max")}
    tilt = fit_of(
        "accelerometer", accel_matrix=np.eye(3), accel_offset_g=np.array([0.03, -0.03, 0])
    )

    level = study_of(magnetometer, readings[:24], site)
    tilted = study_of(magnetometer, readings, site)
    borrowed = study_of({**magnetometer, "accelerometer": tilt}, readings, site)

    assert level.tilt_from["min_max"] == "given"
    assert level.orders["min_max"]["body"].level_max_deg < 0.05
    assert tilted.tilt_from["min_max"] == "raw"
    assert tilted.orders["min_max"]["body"].level_max_deg > 2.0
    assert borrowed.tilt_from["min_max"] == "accelerometer"
    assert borrowed.orders["min_max"]["body"].level_max_deg < 0.2
    assert study_of({}, readings[:24], site).raw.level_max_deg > 2.0
    both = {**magnetometer, "accelerometer": tilt}
    judged = evaluate_comparison("compare", "min_max", both, readings, site)
    assert judged[0].value == pytest.approx(borrowed.orders["min_max"]["body"].level_max_deg)
    assert judged[0].note.endswith("tilt accelerometer")


def test_ranking_is_by_the_worse_maximum_and_refused_come_last():
    errors = {
        "refused": {},
        "level_only_good": {"level_max_deg": 0.1, "tilt_max_deg": 9.0},
        "both_fair": {"level_max_deg": 0.5, "tilt_max_deg": 0.4},
    }

    assert ranking(errors) == ["both_fair", "level_only_good", "refused"]


def test_how_far_the_judged_method_is_behind_the_best_is_told():
    errors = {"a": {"level_max_deg": 0.2, "tilt_max_deg": 0.5}, "b": {"tilt_max_deg": 0.9}, "c": {}}

    (behind,) = evaluate_rank("verify", "b", errors)
    (first,) = evaluate_rank("verify", "a", errors)

    assert (behind.name, behind.unit, behind.note) == ("behind_best", "deg", "best: a")
    assert behind.value == pytest.approx(0.4)
    assert first.value == 0.0
    assert evaluate_rank("verify", "c", errors) == []
