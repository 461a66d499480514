from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import stdtrit

from bench.calibration.consistency import growth
from bench.calibration.fit import CalibrationData
from bench.calibration.heading_claim import (
    STATED_DOF,
    claim_of,
    largest_error_deg,
    pooled_variance,
)
from bench.calibration.planned_poses import perfect_data
from bench.calibration.pose_plan import bench_conditions, optimal_poses
from bench.calibration.prediction import grid_attitudes_deg
from bench.calibration.tilt import ned_from_body, tilt_compensated_heading_deg
from bench.calibration.truth_aided import fit_truth_aided
from bench.pose import Attitude
from protocols.angles import wrap_180_deg

CONDITIONS = bench_conditions()
LIKE = CalibrationData(
    field_mg=np.zeros((0, 3)),
    accel_g=np.zeros((0, 3)),
    field_sd_mg=CONDITIONS.field_sd_mg,
    accel_sd_g=CONDITIONS.accel_sd_g,
    rig_sd_deg=CONDITIONS.rig_sd_deg,
    noise_known=True,
)


@pytest.fixture(scope="module")
def perfect():
    plan = optimal_poses(9, 30.0, CONDITIONS)
    return perfect_data([Attitude(**pose) for pose in _poses(plan)], LIKE)


def _poses(plan):
    names = ("azimuth_deg", "pitch_deg", "roll_deg")
    return [dict(zip(names, pose, strict=True)) for pose in plan.attitudes_deg.tolist()]


def read(data, rng, scale=1.0):
    """Return readings with the noise that the weights assume, times a scale."""
    angles_deg = np.stack([data.azimuth_deg, data.pitch_deg, data.roll_deg], axis=1)
    actual_deg = angles_deg + scale * rng.normal(0.0, data.rig_sd_deg, angles_deg.shape)
    axes = ned_from_body(*actual_deg.T)
    shape = angles_deg.shape
    field_mg = np.einsum("nji,j->ni", axes, data.station_field_mg)
    return replace(
        data,
        field_mg=field_mg + scale * rng.normal(0.0, data.field_sd_mg, shape),
        accel_g=-axes[:, 2] + scale * rng.normal(0.0, data.accel_sd_g, shape),
    )


def largest_heading_error_deg(fit, station_mg):
    axes = ned_from_body(*grid_attitudes_deg().T)
    field_mg = fit.corrected_mg(np.einsum("nji,j->ni", axes, station_mg))
    heading_deg = tilt_compensated_heading_deg(field_mg, fit.corrected_g(-axes[:, 2]))
    return np.abs(wrap_180_deg(heading_deg - grid_attitudes_deg()[:, 0])).max()


@pytest.mark.parametrize("dof", [5.0, 30.0, 1000.0])
def test_the_claim_of_one_attitude_is_students_interval(dof):
    claimed = largest_error_deg(np.array([[3.0]]), np.array([[0.25]]), dof)

    assert float(claimed) == pytest.approx(1.5 * stdtrit(dof, 0.975), rel=0.02)


def test_the_claim_of_independent_attitudes_is_that_of_their_largest_error():
    claimed = largest_error_deg(np.eye(10), np.eye(10), 1e6)

    single = 0.95 ** (1.0 / 10.0)
    assert float(claimed) == pytest.approx(stdtrit(1e6, 0.5 + single / 2.0), rel=0.02)


def test_nine_poses_hold_their_claim_in_95_of_100_units(perfect):
    rng = np.random.default_rng(7)

    held = []
    for _ in range(300):
        fit = fit_truth_aided(read(perfect, rng))
        error_deg = largest_heading_error_deg(fit, perfect.station_field_mg)
        held.append(error_deg <= claim_of(fit).largest_deg)

    assert np.mean(held) == pytest.approx(0.95, abs=2.5 * np.sqrt(0.95 * 0.05 / 300))


@pytest.mark.parametrize("chi2", [0.5, 1.0, 1.5, 3.0])
def test_readings_that_scatter_more_are_claimed_to_be_worth_less(perfect, chi2):
    """The covariance of a fit is that of its chi-square; what is stated stays the same."""
    fit = fit_truth_aided(perfect)
    assert fit.chi2_reduced < 1e-9
    grown = float(growth(np.array(chi2), fit.dof))

    claim = claim_of(replace(fit, chi2_reduced=chi2, covariance=grown * fit.covariance))

    systematic = chi2 == 3.0
    pooled = (STATED_DOF + fit.dof * chi2) / (STATED_DOF + fit.dof)
    assert claim.stated_deg == pytest.approx(claim_of(fit).stated_deg, rel=1e-9)
    assert claim.sigma**2 == pytest.approx(19.0 if systematic else pooled)
    assert claim.largest_deg == pytest.approx(claim.sigma * claim.stated_deg)


def test_few_lucky_residuals_do_not_make_a_small_claim():
    variance, dof = pooled_variance(np.array(0.0), 20)

    assert float(variance) == STATED_DOF / (STATED_DOF + 20) > 0.8
    assert dof == STATED_DOF + 20


def test_a_refused_fit_claims_nothing():
    fit = fit_truth_aided(CalibrationData(field_mg=np.zeros((8, 3))))

    with pytest.raises(ValueError, match="must have both sensors and a covariance"):
        claim_of(fit)
