"""What a verification says of the uncertainty of its heading errors."""

from __future__ import annotations

import numpy as np
import pytest

from bench.acceptance.heading_evaluation import evaluate_verification
from bench.acceptance.heading_uncertainty import uncertainty_section, verification_budget
from bench.acceptance.measurement import Limit
from bench.samples import readings_of
from bench.station import load_station
from bench.uncertainty.unit_data import UnitData
from protocols.uds import DEFAULT_COEFFICIENTS

PART = UnitData(repeatability_mg=0.32, hysteresis_mg=0.16)
LIMIT = {
    name: Limit(name=name, unit="deg", high=high, guard_factor=1.0)
    for name, high in (("level_max", 0.5), ("level_rms", 0.3), ("tilt_max", 0.8))
}


@pytest.fixture
def verification(make_unit, poses_of_run):
    """Samples and readings of a perfect module on the verification poses."""
    unit = make_unit(
        gain=np.eye(3), hard_iron_mg=np.zeros(3), accel_gain=np.eye(3), accel_bias_g=np.zeros(3)
    )
    samples = unit.samples(poses_of_run["verify"])
    return samples, readings_of(samples)


@pytest.fixture
def station():
    return load_station("default")


def judged_with(budget, verification, site):
    samples, readings = verification
    found = evaluate_verification(
        "verify", readings, samples, DEFAULT_COEFFICIENTS, site, budget=budget
    )
    return [one.judged(LIMIT.get(one.name)) for one in found]


def test_the_numbers_carry_the_uncertainty_of_the_test_alone(verification, station, site):
    budget = verification_budget(verification[1], DEFAULT_COEFFICIENTS, station, PART)

    by_name = {one.name: one for one in judged_with(budget, verification, site)}

    level = np.arange(48) < 24
    assert budget.u_test_deg[level].min() <= by_name["level_max"].uncertainty
    assert by_name["level_max"].uncertainty <= budget.u_test_deg[level].max()
    assert 0.0 < by_name["level_rms"].uncertainty < by_name["level_max"].uncertainty
    assert by_name["tilt_max"].uncertainty > by_name["level_max"].uncertainty
    assert by_name["bench_against_module"].uncertainty is None


def test_without_data_of_the_part_no_uncertainty_is_computed(verification, station, site):
    assert verification_budget(verification[1], DEFAULT_COEFFICIENTS, station, None) is None
    assert all(one.uncertainty is None for one in judged_with(None, verification, site))


def test_the_section_repeats_what_was_judged_and_lists_the_budget(verification, station, site):
    readings = verification[1]
    budget = verification_budget(readings, DEFAULT_COEFFICIENTS, station, PART)
    judged = judged_with(budget, verification, site)

    section = uncertainty_section(readings, budget, judged, site)

    by_name = {one.name: one for one in judged}
    assert section["level"] == {
        "u_max_deg": by_name["level_max"].uncertainty,
        "u_rms_deg": by_name["level_rms"].uncertainty,
        "tur": by_name["level_max"].tur,
        "conformity": by_name["level_max"].conformity,
    }
    assert section["tilt"]["u_rms_deg"] == by_name["tilt_rms"].uncertainty  # it has no limit
    errors = [row["error_deg"] for row in section["headings"][:24]]
    assert max(map(abs, errors)) == by_name["level_max"].value
    assert [row["u_deg"] for row in section["headings"]] == budget.u_deg.tolist()
    squares = sum(row["level_deg"] ** 2 for row in section["budget"])
    assert np.sqrt(squares) == pytest.approx(np.sqrt(np.mean(budget.u_deg[:24] ** 2)) / 2.0)


def test_level_poses_alone_leave_the_tilted_part_empty(make_unit, poses_of_run, station, site):
    samples = make_unit().samples(poses_of_run["verify"][:24])
    readings = readings_of(samples)
    budget = verification_budget(readings, DEFAULT_COEFFICIENTS, station, PART)
    judged = judged_with(budget, (samples, readings), site)

    section = uncertainty_section(readings, budget, judged, site)

    assert set(section["tilt"].values()) == {None}
    assert all(line["tilt_deg"] is None for line in section["budget"])
