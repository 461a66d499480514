"""Hk from a calibration's pairs: found, corrected where it is seen, and left alone where not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.calibration import cross_axis
from bench.calibration.cross_axis import corrected, cross_axis_of, knowing, no_cross_axis
from bench.calibration.crossed_field import CROSS_AXIS, with_cross_axis
from bench.calibration.fit import CalibrationData
from bench.calibration.methods import fit_named
from bench.calibration.tilt import ned_from_body

HK_MG = np.array([8000.0, 7700.0, 8400.0])
STATION_MG = np.array([250.0, 0.0, 433.0])
OFFSET_MG = np.array([30.0, -45.0, 12.0])
HARD_MG = np.array([150.0, -120.0, 40.0])


def attitudes_deg():
    level = [(azimuth, 0.0, 0.0) for azimuth in np.arange(0.0, 360.0, 15.0)]
    pitched = [(azimuth, pitch, 0.0) for azimuth in range(0, 360, 60) for pitch in (30.0, -30.0)]
    rolled = [(azimuth, 0.0, roll) for azimuth in range(30, 390, 60) for roll in (30.0, -30.0)]
    return np.array([*level, *pitched, *rolled])


def data_of(hk_mg=HK_MG, noise_mg=0.05, repeatability_mg=0.3, seed=1, poses=None):
    """Pairs of a bridge triad with hard iron at the poses of a calibration."""
    rng = np.random.default_rng(seed)
    azimuth, pitch, roll = (attitudes_deg() if poses is None else poses).T
    field_mg = STATION_MG @ ned_from_body(azimuth, pitch, roll) + HARD_MG
    along_mg = field_mg + rng.normal(0.0, repeatability_mg, field_mg.shape)
    ratio = field_mg[:, CROSS_AXIS] / hk_mg
    reading_mg = along_mg / (1.0 - ratio**2)
    noise = rng.normal(0.0, noise_mg, (2, *field_mg.shape))
    return CalibrationData(
        field_mg=reading_mg + noise[0],
        azimuth_deg=azimuth,
        pitch_deg=pitch,
        roll_deg=roll,
        field_sd_mg=0.35,
        offset_mg=OFFSET_MG - reading_mg * ratio + noise[1],
        station_field_mg=STATION_MG,
    )


def test_hk_is_found_to_a_percent_and_within_its_uncertainty():
    found = [cross_axis_of(data_of(seed=seed)) for seed in range(60)]

    seen_mg, sd_mg = (
        np.array([getattr(one, key) for one in found]) for key in ("seen_mg", "sd_mg")
    )
    assert np.abs(seen_mg / HK_MG - 1.0).max() < 0.01
    # counted in the reading across, which holds a cross-axis term of 0.1 to 0.4 % itself
    systematic = seen_mg.mean(axis=0) / HK_MG - 1.0
    assert (systematic > 0.0).all()
    assert (systematic < 0.004).all()
    assert seen_mg.std(axis=0) == pytest.approx(sd_mg.mean(axis=0), rel=0.3)
    assert all(one.corrected and one.why_not == ("", "", "") for one in found)


def test_what_is_corrected_is_the_field_along_the_bridges():
    data = data_of(noise_mg=0.0, repeatability_mg=0.0)
    field_mg = STATION_MG @ ned_from_body(*attitudes_deg().T) + HARD_MG

    left_mg = corrected(data, cross_axis_of(data)).field_mg - field_mg

    assert np.abs(data.field_mg - field_mg).max() > 1.0
    assert np.abs(left_mg).max() < 0.02


def test_the_residual_of_a_fit_is_smaller_without_the_term():
    data = data_of()
    cross = cross_axis_of(data)

    before, after = (fit_named("truth_aided", one) for one in (data, corrected(data, cross)))

    assert after.chi2_reduced < 0.9 * before.chi2_reduced
    assert after.residual_rms_mg < before.residual_rms_mg


def test_a_fit_that_knows_the_term_makes_the_field_of_raw_readings():
    data = data_of()
    cross = cross_axis_of(data)
    without = corrected(data, cross)
    fit = fit_named("truth_aided", without)

    raw_mg = knowing(fit, cross).corrected_mg(data.field_mg)

    assert raw_mg == pytest.approx(fit.corrected_mg(without.field_mg), abs=1e-12)
    refused = fit_named("truth_aided", replace(data, azimuth_deg=None))
    assert knowing(refused, cross).hk_mg is None


def test_a_film_that_shows_no_term_is_left_alone():
    seen = [cross_axis_of(data_of(hk_mg=np.full(3, 1e12), seed=seed)) for seed in range(300)]

    false = np.array([one.hk_mg > 0.0 for one in seen])
    assert false.mean() < 0.01
    assert {why for one in seen for why in one.why_not} <= {"", cross_axis.NOT_SEEN}
    assert np.isnan(seen[0].seen_mg).all()


def test_a_slope_of_the_wrong_sign_is_no_cross_axis_term():
    found = cross_axis_of(data_of(hk_mg=np.array([-8000.0, 8000.0, 8000.0])))

    assert found.hk_mg[0] == 0.0
    assert found.hk_mg[1] > 0.0
    assert found.why_not == (cross_axis.NOT_SEEN, "", "")


def test_a_broken_film_is_told_and_not_corrected():
    found = cross_axis_of(data_of(hk_mg=np.array([1500.0, 8000.0, 8000.0])))

    assert found.why_not[0] == cross_axis.BROKEN
    assert found.hk_mg[0] == 0.0
    assert found.seen_mg[0] == pytest.approx(1500.0, rel=0.05)


def test_single_readings_too_few_pairs_and_a_held_axis_are_not_corrected():
    data = data_of()
    held = replace(data, field_mg=np.minimum(data.field_mg, [250.0, 800.0, 800.0]))
    few = data_of(poses=attitudes_deg()[:3])
    dead = replace(data, field_mg=data.field_mg * [0.0, 1.0, 1.0])

    whys = [cross_axis_of(one).why_not[0] for one in (replace(data, offset_mg=None), few, held)]

    assert whys == [cross_axis.NO_PAIRS, cross_axis.TOO_FEW, cross_axis.NO_HEALTH]
    assert not cross_axis_of(dead).corrected
    assert corrected(held, cross_axis_of(held)) is held


def test_four_pairs_are_too_few_to_tell_chance_from_a_term():
    """Two degrees of freedom: chance makes slopes of ten standard deviations."""
    found = [
        cross_axis_of(data_of(hk_mg=np.full(3, 1e12), poses=attitudes_deg()[:24:6], seed=seed))
        for seed in range(300)
    ]

    assert np.mean([one.hk_mg > 0.0 for one in found]) < 0.01


def test_nothing_is_corrected_for_a_reason_that_all_axes_share():
    none = no_cross_axis(cross_axis.UNKNOWN_THEN)
    data = data_of()

    assert not none.corrected
    assert corrected(data, none) is data
    again = with_cross_axis(data.field_mg, none.hk_mg)
    assert (again == data.field_mg).all()
