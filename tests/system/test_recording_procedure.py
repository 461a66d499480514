"""The procedure `recording`: a replayed file goes over CAN, is collected and fitted."""

from __future__ import annotations

import numpy as np
import pytest

from bench.acceptance.outcome import Outcome

RESOLUTION_MG = 0.5
PREAMBLE = f"""# mag_unit: mG
# mag_resolution_mg: {RESOLUTION_MG}
# rate_hz: 100
t_s,mx,my,mz
"""


def written(path, field_mg):
    rounded_mg = np.round(field_mg / RESOLUTION_MG) * RESOLUTION_MG
    rows = [
        f"{index * 0.01:.2f},{x:.1f},{y:.1f},{z:.1f}" for index, (x, y, z) in enumerate(rounded_mg)
    ]
    path.write_text(PREAMBLE + "\n".join(rows) + "\n", encoding="utf-8")
    return rounded_mg


@pytest.fixture
def directions():
    rng = np.random.default_rng(5)
    vectors = rng.standard_normal((600, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_a_sphere_with_an_offset_is_fitted_as_what_it_is(prepare, tmp_path, directions):
    offset_mg = np.array([40.0, -25.0, 60.0])
    written(tmp_path / "sphere.csv", 480.0 * directions + offset_mg)
    run = prepare("recording", replay=tmp_path / "sphere.csv")

    verdict = run.execute()

    assert verdict.outcome is Outcome.PASS, verdict.reason
    fit = run.context.judged_fit
    assert fit.method == "ellipsoid"
    assert fit.offset_mg == pytest.approx(offset_mg, abs=0.5)
    assert fit.coverage > 0.9
    assert run.context.identity.synthesised


def test_what_the_bench_collects_equals_the_file(prepare, tmp_path, directions):
    sent_mg = written(tmp_path / "sphere.csv", 480.0 * directions)
    run = prepare("recording", replay=tmp_path / "sphere.csv")

    run.execute()

    samples = run.context.recording
    received_mg = (samples["set_mg"] - samples["reset_mg"]) / 2.0
    received_mg = received_mg[np.isfinite(received_mg).all(axis=1)]
    assert np.array_equal(received_mg, sent_mg)


def test_a_recording_of_one_direction_fails_with_the_methods_reason(prepare, tmp_path):
    still_mg = np.tile([200.0, 50.0, 400.0], (300, 1))
    written(tmp_path / "still.csv", still_mg)
    run = prepare("recording", replay=tmp_path / "still.csv")

    verdict = run.execute()

    assert (verdict.outcome, verdict.first_failure) == (Outcome.FAIL, "fit_accepted")
    assert run.context.measurements[-1].note
