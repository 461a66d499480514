"""The main job, in one process, over a Wire."""

from __future__ import annotations

import signal
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.acceptance.outcome import Outcome
from bench.acceptance.site import is_level
from bench.procedure_loader import load_procedure
from bench.record.recorded_fits import recorded_fits

if TYPE_CHECKING:
    from bench.acceptance.measurement import Measurement
    from bench.progress import RunState


class Interruption:
    """Raises signals in this process when the run has reached given positions."""

    def __init__(self, positions: tuple[int, ...], number: int) -> None:
        self.positions = positions
        self.number = number

    def position_reached(self, state: RunState) -> None:
        if state.position in self.positions:
            signal.raise_signal(self.number)

    def step_started(self, state: RunState) -> None: ...

    def measured(self, measurement: Measurement) -> None: ...

    def step_ended(self, state: RunState, outcome: Outcome) -> None: ...


def parked(run) -> bool:
    attitude = run.context.rig.attitude
    angles = (attitude.azimuth_deg, attitude.pitch_deg, attitude.roll_deg)
    return all(abs(angle) < 0.1 for angle in angles)


@pytest.fixture(scope="module")
def good_run(prepare):
    run = prepare()
    run.verdict = run.execute()
    return run


@pytest.fixture
def released():
    """Return what makes the main procedure for another released firmware version."""

    def make(version: str):
        procedure = load_procedure("eol_three_axis")
        steps = [
            step.model_copy(update={"firmware": (version,)}) if step.kind == "identify" else step
            for step in procedure.steps
        ]
        return procedure.model_copy(update={"steps": steps})

    return make


def test_the_expected_errors_hold_what_the_accelerometers_zero_moves_until_the_verification(
    good_run,
):
    study = good_run.context.recorder.sections["study"]
    fits = recorded_fits({"study": study})
    readings = good_run.context.readings_at(good_run.context.verification_positions)
    with_fits = replace(fits, by_method=good_run.context.fits)
    found = with_fits.expected_errors(readings, good_run.context.station)["truth_aided"]
    rms_deg = np.sqrt(np.mean((found.mean_deg**2 + found.sd_deg**2)[is_level(readings)]))

    # 0.3 mg in 100 s, and two minutes between the middles of both
    assert 0.0002 < study["expected_zero_change_g"] < 0.0004
    assert fits.zero_change_g == study["expected_zero_change_g"]
    assert rms_deg == pytest.approx(study["expected"]["truth_aided"]["level_rms_deg"])


def test_a_good_unit_passes_and_its_rig_is_parked(good_run):
    assert good_run.verdict.outcome is Outcome.PASS, good_run.verdict.reason
    assert good_run.verdict.first_failure is None
    assert parked(good_run)


def test_a_good_unit_has_an_error_that_is_small_and_not_zero(good_run):
    assert 0.01 < good_run.value("level_max") < 0.5
    assert 0.01 < good_run.value("tilt_max") < 0.8
    assert 0.0 < good_run.value("bench_against_module") < 0.02


def test_the_weights_of_the_fit_are_those_of_a_good_unit_and_foretell_its_error(good_run):
    """The prediction is the coefficients' part; a reading adds 0.32 mG at 250 mG and its tilt."""
    fit = good_run.context.fits["truth_aided"]
    achieved = good_run.recorder.achieved["truth_aided"]
    reading_deg = np.hypot(np.rad2deg(0.32 / 250.0), np.rad2deg(0.0004 * np.sqrt(3.0)))

    assert 0.5 < fit.chi2_reduced < 1.5
    assert fit.predicted_heading_rms_deg < 0.05
    expected_deg = np.hypot(fit.predicted_heading_rms_deg, reading_deg)
    assert 0.6 < achieved["level_rms_deg"] / expected_deg < 1.6
    assert 0.6 < achieved["tilt_rms_deg"] / expected_deg < 1.7


def test_the_tilt_aided_fit_is_ranked_beside_it_and_as_good_as_it_foretells(good_run):
    fit = good_run.context.fits["tilt_aided"]
    achieved = good_run.recorder.achieved["tilt_aided"]
    reading_deg = np.hypot(np.rad2deg(0.32 / 250.0), np.rad2deg(0.0004 * np.sqrt(3.0)))

    assert "tilt_aided" in good_run.recorder.sections["ranking"][:2]
    assert fit.accel_from == "accelerometer"
    assert (fit.extra["disturbed_poses"], fit.extra["drift_deg"]) == (0.0, 0.0)
    assert 0.5 < fit.chi2_reduced < 1.5
    expected_deg = np.hypot(fit.predicted_heading_rms_deg, reading_deg)
    assert 0.6 < achieved["level_rms_deg"] / expected_deg < 1.6
    assert 0.6 < achieved["tilt_rms_deg"] / expected_deg < 1.7


def test_every_declared_measurement_is_judged_in_the_order_of_the_steps(good_run):
    procedure = good_run.context.procedure
    names = [measurement.name for measurement in good_run.context.measurements]

    assert set(procedure.measured()) <= set(names)
    order = [step.name for step in procedure.walk()]
    steps = [order.index(measurement.step) for measurement in good_run.context.measurements]
    assert steps == sorted(steps)


def test_acceptance_shares_no_pose_with_the_calibration(good_run):
    context = good_run.context
    attitude = {pose.position: pose.attitude for pose in context.poses}

    calibration = {attitude[position] for position in context.calibration_positions}
    verification = {attitude[position] for position in context.verification_positions}

    assert not calibration & verification
    assert len(verification) == 48
    assert len([a for a in verification if a.pitch_deg == a.roll_deg == 0.0]) == 24


def test_the_written_coefficients_are_what_the_module_holds_after_the_run(good_run):
    coefficients = good_run.recorder.sections["coefficients"]
    held = good_run.context.module.diagnostics.read_coefficients()

    assert coefficients["read_back_equal"] is True
    assert held == coefficients["written"]


def test_the_cross_axis_term_is_found_taken_out_by_all_methods_and_written(good_run):
    written_mg = good_run.context.written.hk_mg

    # 8 G of films, in the reading across of bridges whose sensitivities differ by 1.5 %
    assert written_mg == pytest.approx((8000.0,) * 3, rel=0.15)
    accepted = [fit for fit in good_run.context.fits.values() if fit.matrix is not None]
    assert len(accepted) >= 10
    for fit in accepted:
        assert fit.hk_mg == pytest.approx(written_mg, rel=1e-6), fit.method
    assert good_run.context.fits["truth_aided"].residual_rms_mg < 0.38


def test_what_the_run_saw_of_temperature_is_written_down_and_not_corrected(good_run):
    terms = good_run.recorder.sections["bridge_terms"]

    assert set(terms) == {
        "offset_tempco_mg_per_c", "sensitivity_tempco_per_c", "accel_drift_mg_per_c",
    }  # fmt: skip
    assert not any(term.corrected for term in terms.values())
    (gain,), (sd,) = terms["sensitivity_tempco_per_c"].value, terms["sensitivity_tempco_per_c"].sd
    assert gain == pytest.approx(-0.003, abs=3.0 * sd)
    assert 0.0 < sd < 0.01


def test_the_truth_aided_method_is_the_best_or_behind_it_by_less_than_its_uncertainty(good_run):
    """Tilt-aided is as good on these poses: which of the two has the smaller maximum is chance."""
    assert "truth_aided" in good_run.recorder.sections["ranking"][:2]
    assert 0.0 <= good_run.value("behind_best") < 0.05
    assert not good_run.recorder.events("better_method")


def test_the_plan_foretells_the_time_of_the_run_within_a_tenth(good_run):
    elapsed_s = good_run.context.bus.now_s

    assert elapsed_s == pytest.approx(good_run.context.expected_s, rel=0.1)


@pytest.mark.parametrize(
    ("fault", "first"),
    [
        ("dead_strap_y", "set_reset_amplitude_y"),
        ("stuck_axis_z", "set_reset_amplitude_z"),
        ("inverted_axis_x", "axis_sense_x"),
        ("swapped_axes", "axis_sense_x"),
        ("saturated_axis", "peak_reading"),
        ("accel_sign_z", "accel_sense_z"),
    ],
)
def test_a_broken_sensor_fails_before_coefficients_are_written(prepare, fault, first):
    run = prepare(faults=(fault,))

    verdict = run.execute()

    assert verdict.outcome is Outcome.FAIL
    assert verdict.first_failure == first
    assert "coefficients" not in run.recorder.sections
    assert parked(run)


def test_a_lost_write_fails_by_the_read_back_and_keeps_the_old_coefficients(prepare):
    run = prepare(faults=("lost_write",))

    verdict = run.execute()

    assert (verdict.outcome, verdict.first_failure) == (Outcome.FAIL, "read_back")
    held = run.context.module.diagnostics.read_coefficients()
    assert held == run.recorder.sections["coefficients"]["before"]


@pytest.mark.parametrize(
    ("fault", "first"),
    [("module_silent", "module_silent"), ("axis_stalled_pitch@5000", "rig_fault")],
)
def test_a_fault_of_the_bench_is_an_error_with_its_name(prepare, fault, first):
    run = prepare(faults=(fault,))

    verdict = run.execute()

    assert (verdict.outcome, verdict.first_failure) == (Outcome.ERROR, first)
    assert run.recorder.verdict == verdict


@pytest.mark.parametrize(
    ("wrong", "first"),
    [
        ({"field_azimuth_deg": 0.5}, "field_azimuth_difference"),
        ({"field_azimuth_deg": -0.5}, "field_azimuth_difference"),
        ({"dip_deg": 60.5}, "dip_difference"),
    ],
)
def test_half_a_degree_between_rig_and_station_is_an_error_and_seen_as_that(prepare, wrong, first):
    """A slipped azimuth index, or a station's record that no longer holds: never the unit."""
    run = prepare()
    run.context.station = replace(run.context.station, **wrong)

    verdict = run.execute()

    assert (verdict.outcome, verdict.first_failure) == (Outcome.ERROR, first)
    assert run.value(first) == pytest.approx(0.5, abs=0.08)
    assert run.context.written is None


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_parks_the_rig_and_closes_the_record(prepare, number):
    run = prepare()
    run.context.progress = Interruption((20,), number)
    before = signal.getsignal(number)

    verdict = run.execute()

    assert verdict.outcome is Outcome.ABORTED
    assert len(run.context.poses) == 20
    assert run.context.bus.cancel.signal_number == number
    assert parked(run)
    assert run.recorder.verdict == verdict
    assert signal.getsignal(number) is before


def test_a_signal_between_write_and_verdict_restores_the_coefficients(prepare):
    run = prepare()
    run.context.progress = Interruption((100,), signal.SIGTERM)

    verdict = run.execute()

    assert verdict.outcome is Outcome.ABORTED
    assert run.context.written is not None
    with run.context.bus.cancel.shielded():
        held = run.context.module.diagnostics.read_coefficients()
    assert held == run.context.before
    assert run.recorder.events("coefficients_restored")
    assert parked(run)


def test_another_serial_than_the_scanned_one_is_an_error_and_nothing_moves(prepare):
    run = prepare(scanned="SN0002")

    verdict = run.execute()

    assert (verdict.outcome, verdict.first_failure) == (Outcome.ERROR, "serial_match")
    assert run.context.poses == []


def test_another_firmware_than_the_released_one_fails_the_unit(prepare, released):
    run = prepare(released("9.9.9"))

    verdict = run.execute()

    assert (verdict.outcome, verdict.first_failure) == (Outcome.FAIL, "firmware_version")


def test_two_runs_with_one_seed_measure_the_same(prepare):
    values = []
    for _ in range(2):
        run = prepare("set_reset")
        assert run.execute().outcome is Outcome.PASS
        values.append([(m.name, m.value) for m in run.context.measurements])

    assert values[0] == values[1]


def test_another_serial_is_another_unit(prepare):
    first, second = prepare("set_reset"), prepare("set_reset", serial="SN0002")
    first.execute()
    second.execute()

    assert first.value("bridge_offset_x") != second.value("bridge_offset_x")


def test_an_uncalibrated_unit_fails_the_acceptance_swing_by_tens_of_degrees(prepare):
    run = prepare("acceptance_swing")

    verdict = run.execute()

    assert (verdict.outcome, verdict.first_failure) == (Outcome.FAIL, "level_max")
    assert run.value("level_max") > 10.0
    assert "temperature_change" not in {m.name for m in run.context.measurements}


def test_min_max_passes_a_good_unit_and_writes_nothing(prepare):
    run = prepare("min_max")

    assert run.execute().outcome is Outcome.PASS
    assert "coefficients" not in run.recorder.sections
    assert run.recorder.sections["deviation"]["raw"]["words"]
