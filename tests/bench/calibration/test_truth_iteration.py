"""The common iteration of many units: one that runs away is known, and disturbs no other."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.truth_iteration import model_of, perfect_unit, settled_units
from bench.calibration.truth_model import rig_poses
from bench.calibration.truth_rows import truth_rows

STATION_MG = np.array([250.0, 0.0, 433.0])
TILTS = ((0.0, 0.0), (30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -30.0))
POSES = np.array([(60.0 * k, pitch, roll) for pitch, roll in TILTS for k in range(6)])


@pytest.fixture(scope="module")
def model():
    return model_of(
        rig_poses(*POSES.T), STATION_MG, field_sd_mg=0.35, accel_sd_g=4e-4, rig_sd_deg=0.02
    )


@pytest.fixture(scope="module")
def nonsense():
    """Readings of 400 units that have nothing to do with their poses."""
    rng = np.random.default_rng(1)
    field_mg = rng.normal(0.0, 300.0, (400, len(POSES), 3))
    return np.concatenate([field_mg, rng.normal(0.0, 1.0, field_mg.shape)], axis=2)


def test_a_unit_that_runs_away_did_not_converge_though_it_goes_on_with_perfect_readings(
    model, nonsense
):
    found = settled_units(model, nonsense, STATION_MG)

    went_on = ~found.degenerate
    assert went_on.sum() > 20
    assert not found.converged[went_on].any()
    assert np.isfinite(found.parameters).all()


def test_a_good_unit_among_them_ends_where_it_ends_alone(model, nonsense):
    perfect = perfect_unit(model, STATION_MG)
    good = truth_rows(model, perfect[None]).modelled

    found = settled_units(model, np.concatenate([nonsense[:50], good]), STATION_MG)

    assert found.converged[-1]
    assert found.parameters[-1] == pytest.approx(perfect, abs=1e-9)
