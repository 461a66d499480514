"""Headings: what is judged equals the error that was put in."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bench.acceptance.heading_evaluation import (
    bench_heading_deg,
    evaluate_agreement,
    evaluate_field_strength,
    evaluate_raw_heading,
    evaluate_returns,
    evaluate_temperature,
    evaluate_verification,
)
from bench.acceptance.site import (
    expected_field_mg,
    expected_force_g,
    field_rig_mg,
    is_level,
    reference_heading_deg,
    total_field_mg,
)
from bench.calibration.crossed_field import with_cross_axis
from bench.calibration.fixture import SeatFound
from bench.samples import readings_of
from protocols.angles import wrap_360_deg
from protocols.uds import DEFAULT_COEFFICIENTS


def values(measurements):
    return {m.name: m.value for m in measurements}


@pytest.fixture
def perfect(make_unit):
    """A unit whose raw readings need no correction."""
    return make_unit(
        gain=np.eye(3), hard_iron_mg=np.zeros(3), accel_gain=np.eye(3), accel_bias_g=np.zeros(3),
        noise_mg=0.0, repeatability_mg=0.0,
    )  # fmt: skip


def with_errors(unit, poses, site, error_deg):
    samples = unit.samples(poses)
    readings = readings_of(samples)
    readings["heading_deg"] = wrap_360_deg(reference_heading_deg(readings, site) + error_deg)
    return samples, readings


def test_the_reference_is_the_rig_azimuth_less_the_field_azimuth(perfect, site, poses_of_run):
    readings = readings_of(perfect.samples(poses_of_run["verify"]))

    assert reference_heading_deg(readings, site)[0] == pytest.approx(7.0 - 1.25)
    # and a perfect module sends it, level and tilted, but for noise of the accelerometer
    difference = readings["heading_deg"] - reference_heading_deg(readings, site)
    assert np.abs(difference[is_level(readings)]).max() < 0.2


def test_the_field_in_the_body_keeps_its_length_at_any_attitude(perfect, site, poses_of_run):
    readings = readings_of(perfect.samples(poses_of_run["verify"]))

    lengths_mg = np.linalg.norm(expected_field_mg(readings, site), axis=1)

    assert lengths_mg == pytest.approx(np.full(len(readings), total_field_mg(site)))
    assert np.linalg.norm(field_rig_mg(site)) == pytest.approx(total_field_mg(site))
    assert total_field_mg(site) == pytest.approx(500.0)


def test_the_expected_force_of_nose_up_is_positive_forward(perfect, poses_of_run):
    readings = readings_of(perfect.samples(poses_of_run["tilted_poses"]))
    nose_up = readings["rig_pitch_deg"] == 30.0

    assert expected_force_g(readings)[nose_up][:, 0] == pytest.approx(np.full(6, 0.5))


def test_maxima_and_rms_are_those_of_the_errors_level_and_tilted(perfect, site, poses_of_run):
    poses = poses_of_run["verify"]
    error_deg = np.where(np.arange(48) < 24, 0.1, -0.3)
    error_deg[5], error_deg[30] = -0.45, 0.7
    samples, readings = with_errors(perfect, poses, site, error_deg)

    found = evaluate_verification("verify", readings, samples, DEFAULT_COEFFICIENTS, site)

    by_name = values(found)
    assert by_name["level_max"] == pytest.approx(0.45)
    assert by_name["tilt_max"] == pytest.approx(0.7)
    assert by_name["level_rms"] == pytest.approx(np.sqrt((23 * 0.01 + 0.2025) / 24))
    assert by_name["tilt_rms"] == pytest.approx(np.sqrt((23 * 0.09 + 0.49) / 24))
    assert found[0].note == f"-0.450 deg at position {poses[5].position}"


def test_errors_near_north_do_not_wrap(perfect, poses_of_run):
    site = SimpleNamespace(
        horizontal_mg=250.0, dip_deg=60.0, field_azimuth_deg=7.0, seat=SeatFound()
    )
    samples, readings = with_errors(perfect, poses_of_run["verify"], site, np.full(48, -0.2))

    found = values(evaluate_verification("v", readings, samples, DEFAULT_COEFFICIENTS, site))

    assert found["level_max"] == pytest.approx(0.2)


def test_bench_and_module_agree_within_the_frame_resolution(unit, poses_of_run):
    samples = unit.samples(poses_of_run["verify"])

    (agreement,) = evaluate_agreement("verify", samples, unit.coefficients)

    assert 0.0 < agreement.value <= 360.0 / 65536.0 / 2.0 + 1e-9


def test_a_module_with_other_coefficients_disagrees(unit, make_unit, poses_of_run):
    samples = unit.samples(poses_of_run["verify"])
    samples["heading_deg"][100] += 0.05

    (agreement,) = evaluate_agreement("verify", samples, unit.coefficients)

    assert agreement.value == pytest.approx(0.05, abs=0.003)
    position, group = samples["position"][100], samples["group"][100]
    assert agreement.note == f"position {position}, group {group}"


def test_incomplete_and_moving_samples_are_not_compared(unit, poses_of_run):
    samples = unit.samples(poses_of_run["verify"])
    samples["heading_deg"][7] += 20.0
    samples["complete"][7] = 0b0111
    samples["heading_deg"][8] += 20.0
    samples["position"][8] = -1

    (agreement,) = evaluate_agreement("verify", samples, unit.coefficients)

    assert agreement.value < 0.003
    assert evaluate_agreement("verify", samples[:0], unit.coefficients) == []


def test_bench_heading_follows_the_wire_formula(perfect, poses_of_run):
    samples = perfect.samples(poses_of_run["verify"][:1])
    samples["set_mg"], samples["reset_mg"] = [0.0, -200.0, 400.0], [0.0, 200.0, -400.0]
    samples["accel_g"] = [0.0, 0.0, -1.0]

    # The field points to the left: north is to the left, so the module looks east.
    assert bench_heading_deg(samples, DEFAULT_COEFFICIENTS) == pytest.approx(np.full(50, 90.0))


def test_repeatability_pools_the_visits_and_not_the_headings(perfect, site, poses_of_run):
    poses = poses_of_run["returns"]
    of_heading = np.tile([0.3, -0.2, 0.1, 0.0], 4)
    of_visit = np.repeat([0.05, -0.05, 0.05, -0.05], 4)
    _, readings = with_errors(perfect, poses, site, of_heading + of_visit)

    found = values(evaluate_returns("returns", readings, poses, site))

    assert found["repeatability"] == pytest.approx(np.sqrt(4 * 4 * 0.05**2 / 12))
    assert found["closing_error"] == pytest.approx(0.0, abs=1e-9)


def test_closing_error_sees_a_shift_between_the_halves(perfect, site, poses_of_run):
    poses = poses_of_run["returns"]
    _, readings = with_errors(perfect, poses, site, np.repeat([0.0, 0.0, 0.12, 0.12], 4))

    assert values(evaluate_returns("r", readings, poses, site))["closing_error"] == pytest.approx(
        0.12
    )


def test_single_visits_give_nothing(perfect, site, poses_of_run):
    poses = poses_of_run["returns"][:4]
    readings = readings_of(perfect.samples(poses))

    assert evaluate_returns("r", readings, poses, site) == []


def test_closing_error_of_good_units_stays_within_its_standard_deviation(
    site, make_unit, poses_of_run
):
    """Repeatability of 0.32 mG at 250 mG is 0.073 deg: halves of 4 x 4 visits have 0.037."""
    poses = poses_of_run["returns"]
    found = []
    for seed in range(12):
        unit = make_unit(
            gain=np.eye(3), hard_iron_mg=np.zeros(3), repeatability_mg=0.32, seed=seed,
            accel_gain=np.eye(3), accel_bias_g=np.zeros(3),
        )  # fmt: skip
        readings = readings_of(unit.samples(poses))
        found.append(values(evaluate_returns("r", readings, poses, site)))

    assert np.median([f["repeatability"] for f in found]) == pytest.approx(0.073, rel=0.35)
    assert np.sqrt(np.mean([f["closing_error"] ** 2 for f in found])) < 2.0 * 0.037


def test_temperature_change_is_the_difference_of_the_means(perfect, poses_of_run):
    before = readings_of(perfect.samples(poses_of_run["sweep"]))
    after = before.copy()
    after["temperature_c"] += 0.4

    (change,) = evaluate_temperature("verify", before, after)

    assert (change.name, change.unit) == ("temperature_change", "deg C")
    assert change.value == pytest.approx(0.4)


def test_the_strength_of_the_corrected_field_is_held_against_the_stations(
    make_unit, site, poses_of_run
):
    unit = make_unit(gain=1.01 * np.eye(3), hard_iron_mg=np.zeros(3), repeatability_mg=0.0)
    readings = readings_of(unit.samples(poses_of_run["verify"]))
    scaled = replace(DEFAULT_COEFFICIENTS, mag_matrix=tuple(np.eye(3).ravel() / 1.01))

    raw = values(evaluate_field_strength("v", readings, DEFAULT_COEFFICIENTS, site))
    corrected = values(evaluate_field_strength("v", readings, scaled, site))

    assert raw["field_magnitude_difference"] == pytest.approx(1.0, abs=0.01)
    assert corrected["field_magnitude_difference"] == pytest.approx(0.0, abs=0.01)


def test_the_raw_heading_error_is_that_of_the_hard_iron_and_level(make_unit, site, poses_of_run):
    iron_mg = 250.0 * np.sin(np.deg2rad(20.0))
    unit = make_unit(
        gain=np.eye(3), hard_iron_mg=np.array([iron_mg, 0.0, 0.0]), accel_gain=np.eye(3),
        accel_bias_g=np.zeros(3), repeatability_mg=0.0,
    )  # fmt: skip

    level = values(
        evaluate_raw_heading("s", readings_of(unit.samples(poses_of_run["sweep"])), site)
    )
    tilted = evaluate_raw_heading(
        "s", readings_of(unit.samples(poses_of_run["tilted_poses"])), site
    )

    assert level["raw_max"] == pytest.approx(20.0, abs=0.5)
    assert tilted == []


def test_the_bench_takes_the_cross_axis_term_out_as_the_coefficients_say(
    perfect, site, poses_of_run
):
    samples = perfect.samples(poses_of_run["verify"])
    knowing = replace(DEFAULT_COEFFICIENTS, hk_mg=(8000.0, 7600.0, 8300.0))
    field_mg = (samples["set_mg"] - samples["reset_mg"]) / 2.0
    bent_mg = with_cross_axis(field_mg, knowing.hk_mg)
    bent = samples.copy()
    bent["set_mg"], bent["reset_mg"] = bent_mg, -bent_mg

    plain_deg = bench_heading_deg(samples, DEFAULT_COEFFICIENTS)

    assert bench_heading_deg(bent, knowing) == pytest.approx(plain_deg, abs=1e-9)
    assert np.abs(bench_heading_deg(bent, DEFAULT_COEFFICIENTS) - plain_deg).max() > 0.005
