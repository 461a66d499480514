"""A module of two axes: its third axis is never read, only checked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.acceptance.heading_evaluation import (
    bench_heading_deg,
    evaluate_agreement,
    evaluate_field_strength,
)
from bench.acceptance.site import heading_error_deg, is_level
from bench.acceptance.two_axis_evaluation import evaluate_z_estimate, horizontal_mg
from bench.samples import readings_of
from protocols.uds import DEFAULT_COEFFICIENTS

TWO_AXIS = replace(DEFAULT_COEFFICIENTS, extended_dip_deg=60.0, horizontal_mg=250.0)


@pytest.fixture
def samples(make_unit, poses_of_run):
    """Samples of a module without error at level and tilted poses, at dip 60 deg."""
    unit = make_unit(
        gain=np.eye(3), hard_iron_mg=np.zeros(3), accel_gain=np.eye(3), accel_bias_g=np.zeros(3),
        noise_mg=0.0, repeatability_mg=0.0,
    )  # fmt: skip
    return unit.samples(poses_of_run["verify"])


def spoilt(samples, axis=2):
    """Return the samples with nonsense in one axis of field and force."""
    samples = samples.copy()
    samples["set_mg"][:, axis] = 123.0
    samples["accel_g"][:, axis] = 0.5
    return samples


def test_the_heading_is_right_at_every_tilt_and_does_not_read_z(samples, site):
    readings = readings_of(samples)
    heading_deg = bench_heading_deg(samples, TWO_AXIS)

    samples["heading_deg"] = heading_deg
    error_deg = heading_error_deg(readings_of(samples)["heading_deg"], readings, site)
    assert np.max(np.abs(error_deg)) < 0.2
    assert np.array_equal(bench_heading_deg(spoilt(samples), TWO_AXIS), heading_deg)
    assert not np.allclose(bench_heading_deg(spoilt(samples), DEFAULT_COEFFICIENTS), heading_deg)


def test_a_wrong_dip_shows_at_tilt_only(samples, site):
    samples["heading_deg"] = bench_heading_deg(samples, replace(TWO_AXIS, extended_dip_deg=62.0))
    readings = readings_of(samples)

    error_deg = np.abs(heading_error_deg(readings["heading_deg"], readings, site))

    level = is_level(readings)
    assert error_deg[level].max() < 0.2
    # H (tan 62 - tan 60) tan 30 across the horizontal field
    expected_deg = np.rad2deg(np.arctan((np.tan(np.deg2rad(62)) - 3**0.5) * np.tan(np.pi / 6)))
    assert error_deg[~level].max() == pytest.approx(expected_deg, abs=0.5)


def test_bench_and_module_are_held_against_each_other_by_the_two_axis_formula(samples):
    samples["heading_deg"] = bench_heading_deg(samples, TWO_AXIS)

    (same,) = evaluate_agreement("verify", samples, TWO_AXIS)
    (other,) = evaluate_agreement("verify", samples, replace(TWO_AXIS, extended_dip_deg=61.0))

    assert same.value == 0.0
    assert other.value > 0.5


def test_gain_and_offset_of_the_checking_axis_are_taken_out_of_the_estimates_check(samples):
    readings = readings_of(samples)
    scaled, crossed = readings.copy(), readings.copy()
    scaled["field_mg"][:, 2] = 0.9 * readings["field_mg"][:, 2] + 30.0
    crossed["field_mg"][:, 2] += 0.1 * readings["field_mg"][:, 1]

    same, of_scaled, of_crossed = (
        evaluate_z_estimate("verify", each, TWO_AXIS)[0] for each in (readings, scaled, crossed)
    )

    assert (same.name, same.unit) == ("z_estimate_difference", "mG")
    assert same.value < 0.5  # noise of the accelerometer in the attitude
    assert of_scaled.value == pytest.approx(same.value, rel=1e-6)
    assert of_crossed.value > 10.0
    assert evaluate_z_estimate("verify", readings[:24], TWO_AXIS) == []  # level: z stays the same


def test_the_field_strength_of_two_axes_is_the_horizontal_one(samples, site):
    readings = readings_of(samples)
    weaker = replace(TWO_AXIS, mag_matrix=tuple((0.99 * np.eye(3)).ravel()))

    (found,) = evaluate_field_strength("verify", readings, weaker, site)

    assert horizontal_mg(readings, TWO_AXIS) == pytest.approx(
        np.full(len(readings), 250.0), abs=1.0
    )
    assert found.note == "horizontal strength"
    level = readings[is_level(readings)]
    (of_level,) = evaluate_field_strength("verify", level, weaker, site)
    assert of_level.value == pytest.approx(1.0, abs=0.02)
