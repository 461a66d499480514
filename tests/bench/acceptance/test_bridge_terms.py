"""Terms of the bridges in a run: what is written down of them, and that it is what was applied."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bench.acceptance.bridge_terms import (
    CorrectedFits,
    calibration_terms,
    cross_axis_term,
    temperature_terms,
)
from bench.acceptance.site import calibration_data, expected_field_mg, expected_force_g
from bench.acceptance.two_axis_evaluation import fit_of
from bench.calibration.cross_axis import UNKNOWN_THEN, no_cross_axis
from bench.calibration.crossed_field import with_cross_axis
from bench.calibration.fixture import SeatFound
from bench.record.bridge_section import BridgeTermEntry
from bench.record.plain import plain
from bench.samples import readings_of
from protocols.uds import DEFAULT_COEFFICIENTS

CALIBRATION = ("sweep", "tilted_poses")


@pytest.fixture
def calibration(make_unit, poses_of_run, site):
    """Return the readings of a calibration of a unit whose film bends its readings, and poses."""
    unit = make_unit()
    poses = [pose for step in CALIBRATION for pose in poses_of_run[step]]
    readings = readings_of(unit.samples(poses))
    bent_mg = with_cross_axis(readings["field_mg"], np.full(3, unit.hk_mg))
    readings["field_mg"] = bent_mg
    return readings, poses


def entry_of(term):
    return BridgeTermEntry.model_validate(plain(term))


def test_every_method_fits_the_corrected_readings_and_is_applied_to_raw_ones(calibration, site):
    readings, _ = calibration
    data = calibration_data(readings, site)
    fits = CorrectedFits(data)

    truth = fits.fit("truth_aided")

    assert fits.cross.corrected
    for name in ("min_max", "tilt_aided", "set_reset", "truth_aided"):
        assert fits.fit(name).hk_mg == pytest.approx(fits.cross.hk_mg), name
    strength_mg = np.linalg.norm(truth.corrected_mg(data.field_mg), axis=1)
    assert strength_mg == pytest.approx(np.full(len(data), 500.0), abs=1.5)
    plain_fits = CorrectedFits(data, no_cross_axis(UNKNOWN_THEN))
    assert plain_fits.data is data
    assert plain_fits.fit("truth_aided").hk_mg is None
    assert truth.chi2_reduced < plain_fits.fit("truth_aided").chi2_reduced


def test_the_record_says_what_was_corrected_and_why_the_rest_was_not(calibration, site):
    readings, poses = calibration
    cross = CorrectedFits(calibration_data(readings, site)).cross

    terms = calibration_terms(readings, poses, cross)

    hk, play = entry_of(terms["hk_mg"]), entry_of(terms["hysteresis_mg"])
    assert hk.corrected
    assert hk.why_not == ""
    assert hk.value == pytest.approx([8000.0] * 3, rel=0.05)
    assert all(sd < 400.0 for sd in hk.sd)
    assert not play.corrected
    assert "estimate's own error" in play.why_not
    assert all(abs(value) < 3.0 * sd for value, sd in zip(play.value[:2], play.sd[:2], strict=True))


def test_an_axis_that_stays_is_named():
    seen = no_cross_axis(UNKNOWN_THEN)
    mixed = type(seen)(
        hk_mg=np.array([8000.0, 0.0, 0.0]),
        seen_mg=np.array([8000.0, np.nan, 1500.0]),
        sd_mg=np.array([10.0, np.nan, 20.0]),
        why_not=("", "not seen", "broken"),
    )

    term = cross_axis_term(mixed)

    assert term.corrected
    assert term.why_not == "y: not seen; z: broken"
    assert term.value == (8000.0, None, 1500.0)
    assert cross_axis_term(seen).why_not == UNKNOWN_THEN
    assert not cross_axis_term(seen).corrected


def test_temperature_is_told_of_a_run_that_warms_and_not_of_one_that_does_not(calibration, site):
    readings, _ = calibration
    fit = CorrectedFits(calibration_data(readings, site)).fit("truth_aided")
    warming = readings.copy()
    warming["t_s"] = np.linspace(0.0, 200.0, len(readings))
    warming["temperature_c"] = 25.0 + np.linspace(0.0, 0.2, len(readings))
    warming["offset_mg"] += np.outer(warming["temperature_c"] - 25.0, [5.0, 0.0, 0.0])

    warm = temperature_terms(warming, fit, site, drift_sd_mg=0.05)
    steady = temperature_terms(readings, fit, site)

    offset = entry_of(warm["offset_tempco_mg_per_c"])
    assert offset.value[0] == pytest.approx(5.0, abs=4.0 * offset.sd[0] + 0.01)
    assert not offset.corrected
    assert "cancels" in offset.why_not
    gain = entry_of(warm["sensitivity_tempco_per_c"])
    assert len(gain.value) == len(gain.sd) == 1
    assert abs(gain.value[0]) < 4.0 * gain.sd[0]
    assert len(entry_of(warm["accel_drift_mg_per_c"]).value) == 3
    assert all(entry_of(term).value[0] is None for term in steady.values())
    assert set(temperature_terms(warming, None, site)) == {"offset_tempco_mg_per_c"}


def test_seat_and_fixture_of_the_station_are_no_drift_of_the_accelerometer_or_the_gain(
    calibration, site
):
    """A run whose tilt and warming go together: what the seat turns must not look like a drift."""
    readings = calibration[0][-16:].copy()
    readings = np.concatenate([readings, readings])
    seat = SeatFound(index_deg=2.0, pitch_deg=1.0, roll_deg=-1.0, iron_mg=(4.0, 0.0, -6.0))
    seated = SimpleNamespace(**{**vars(site), "seat": seat})
    readings["field_mg"] = expected_field_mg(readings, seated)
    readings["accel_g"] = expected_force_g(readings, seat)
    readings["t_s"] = np.linspace(0.0, 200.0, len(readings))
    readings["temperature_c"] = 25.0 + 0.01 * readings["rig_pitch_deg"]
    perfect = fit_of(DEFAULT_COEFFICIENTS)

    terms = temperature_terms(readings, perfect, seated)

    assert terms["accel_drift_mg_per_c"].value == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert terms["sensitivity_tempco_per_c"].value == pytest.approx((0.0,), abs=1e-9)
