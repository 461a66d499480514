from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter

from bench.calibration.methods import METHODS, fit_named
from bench.calibration.planned_poses import perfect_data
from bench.errors import ConfigError
from bench.plan import (
    LEVEL_ONLY,
    calibration_attitudes,
    expected_load_percent,
    plan_of,
    predictions,
    require_load,
    require_observable,
)
from bench.procedure import Procedure
from bench.procedure_loader import load_procedure
from bench.station import load_station
from bench.travel import SETTLE_S


def procedure_of(*steps):
    return TypeAdapter(Procedure).validate_python(
        {"name": "p", "version": "1.0", "title": "t", "limits": "eol_three_axis", "steps": steps}
    )


def test_a_clockwise_and_counter_clockwise_sweep_winds_one_turn_and_back():
    sweep = {"kind": "sweep", "name": "s", "headings": {"count": 4}}

    plan = plan_of(procedure_of(sweep))

    wound = [move.azimuth_wound_deg for move in plan.moves]
    assert wound == [0.0, 90.0, 180.0, 270.0, 360.0, 270.0, 180.0, 90.0, 0.0]
    assert (plan.wound_low_deg, plan.wound_high_deg) == (0.0, 360.0)
    assert plan.samples == 9 * 50


def test_a_counter_clockwise_sweep_alone_starts_and_ends_at_the_first_heading():
    sweep = {
        "kind": "sweep", "name": "s", "headings": {"count": 4, "first": "45 deg"},
        "directions": ["counter_clockwise"],
    }  # fmt: skip

    poses = procedure_of(sweep).steps[0].poses()

    assert [pose.attitude.azimuth_deg for pose in poses] == [45.0, 315.0, 225.0, 135.0, 45.0]
    assert {pose.direction for pose in poses} == {-1}


def test_the_time_of_a_move_and_a_dwell_is_that_of_a_trapezoid_with_settling():
    poses = {"kind": "poses", "name": "s", "rings": [{"count": 1, "first": "90 deg"}]}

    (move,) = plan_of(procedure_of(poses)).moves

    # 90 deg at 90 deg/s and 180 deg/s2: 1.5 s; then settling.
    assert move.travel_s == pytest.approx(1.5 + SETTLE_S)
    assert move.dwell_s == 0.5


def test_a_repeat_is_planned_with_all_its_rounds():
    poses = {"kind": "poses", "name": "s", "rings": [{"count": 3}]}
    repeat = {"kind": "repeat", "name": "r", "times": 4, "steps": [poses]}

    plan = plan_of(procedure_of(repeat))

    assert len(plan.moves) == 12
    assert [step.name for step in plan.steps] == ["s"] * 4


def test_a_tilt_beyond_the_rig_is_refused_with_the_steps_name():
    poses = {"kind": "poses", "name": "steep", "rings": [{"count": 1, "pitch": "120 deg"}]}

    with pytest.raises(ConfigError, match="step steep: pitch must be between -90 and 90 deg"):
        plan_of(procedure_of(poses))


def test_the_main_procedure_stays_inside_the_cables_wrap_and_under_seven_minutes():
    plan = plan_of(load_procedure("eol_three_axis"))

    assert -540.0 <= plan.wound_low_deg < plan.wound_high_deg <= 540.0
    assert 240.0 < plan.duration_s < 375.0


def test_the_main_procedure_can_see_everything_that_it_writes():
    found = {
        prediction.method: prediction
        for prediction in predictions(load_procedure("eol_three_axis"), load_station("default"))
    }

    written = found["truth_aided"]
    assert written.cause is None
    assert written.condition < 100.0
    assert 0.0 < written.predicted_heading_max_deg < 0.2


def test_level_poses_alone_are_foretold_to_be_too_few():
    sweep = {"kind": "sweep", "name": "s", "headings": {"count": 24}}
    fit = {"kind": "fit", "name": "f", "methods": ["truth_aided"], "judged": ["truth_aided"]}

    (prediction,) = predictions(procedure_of(sweep, fit), load_station("default"))

    assert prediction.cause is not None
    assert prediction.message


def tilts_for_the_dip(*rings):
    """Return a level turn, tilts at named azimuths, and the fit of two axes."""
    sweep = {"kind": "sweep", "name": "turn", "headings": {"count": 24}}
    tilts = {"kind": "poses", "name": "tilts", "rings": list(rings)}
    both = ["two_axis_aided", "two_axis"]
    return procedure_of(sweep, tilts, {"kind": "fit", "name": "f", "methods": both, "judged": both})


def test_tilts_at_blind_azimuths_alone_are_refused_with_the_reason():
    pitched = {"count": 2, "first": "0 deg", "pitch": "30 deg"}
    rolled = {"count": 2, "first": "90 deg", "roll": "30 deg"}
    blind = tilts_for_the_dip(pitched, rolled)

    foretold = predictions(blind, load_station("default"))

    assert {prediction.cause for prediction in foretold} == {"blind_azimuth"}
    with pytest.raises(ConfigError, match=r"step f: poses must suffice.*blind_azimuth"):
        require_observable(blind, foretold)


def test_tilts_that_see_the_dip_are_foretold_to_be_good_at_tilt():
    seeing = tilts_for_the_dip(
        *({"count": 2, "first": "90 deg", "pitch": f"{sign}30 deg"} for sign in ("", "-")),
        *({"count": 2, "first": "0 deg", "roll": f"{sign}30 deg"} for sign in ("", "-")),
    )

    foretold = predictions(seeing, load_station("default"))

    require_observable(seeing, foretold)
    aided = next(p for p in foretold if p.method == "two_axis_aided")
    assert 0.0 < aided.predicted_heading_max_deg < 0.5


def test_methods_marked_as_level_calibrate_no_tilt_and_the_others_do():
    attitudes = calibration_attitudes(load_procedure("caruso_24"))
    like = perfect_data(attitudes)
    data = replace(like, offset_mg=np.zeros_like(like.field_mg))

    fits = {name: fit_named(name, data) for name in METHODS}

    without_tilt = {name for name, fit in fits.items() if fit.accel_matrix is None}
    assert without_tilt - LEVEL_ONLY == {"ellipsoid"}  # its prediction is for raw tilt, all poses
    assert without_tilt >= LEVEL_ONLY
    assert not any(fits[name].two_axis for name in LEVEL_ONLY)


def test_a_recording_has_no_poses_to_predict_from():
    assert predictions(load_procedure("recording"), load_station("default")) == []


def test_one_module_and_the_rig_load_the_bus_by_a_quarter_at_worst():
    # notes of the protocol: 25 % of 500 kbit/s, heartbeats and rounding aside
    assert expected_load_percent() == pytest.approx(24.0, abs=2.5)


def test_a_bus_that_would_be_too_full_is_refused():
    require_load(70.0)
    with pytest.raises(ConfigError, match="must be at most 70 %"):
        require_load(expected_load_percent(modules=16, module_rate_hz=50.0))
