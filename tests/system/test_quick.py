"""The procedure of planned poses, and the benchmark that tells what poses give."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from bench.cli.run_command import RunRequest, run_procedure
from bench.pose import Attitude
from bench.steps.step import PlannedPose
from devices.bridge import Bridge
from devices.field import EarthField
from devices.rotation import apply_inverse, ned_from_body
from devices.unit import draw_unit
from devices.world import SlowDrift

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
POSES = [(10.0, 0.0, 0.0), (97.5, 30.0, 0.0), (200.0, -15.0, 15.0), (350.0, 0.0, -30.0)]


@pytest.fixture(scope="module")
def many_units():
    specification = importlib.util.spec_from_file_location(
        "many_units", BENCHMARKS / "many_units.py"
    )
    module = importlib.util.module_from_spec(specification)
    sys.modules["many_units"] = module
    specification.loader.exec_module(module)
    yield module
    del sys.modules["many_units"]


def run_quick(folder, seed, *faults):
    request = RunRequest(
        procedure="quick", serial=f"SN{seed:04d}", seed=seed, out=folder, faults=faults,
        no_input=True, dashboard=False, quiet=True,
    )  # fmt: skip
    code = run_procedure(request)
    return code, json.loads((folder / "latest" / "record.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("seed", [11, 12])
def test_a_good_unit_passes_in_nine_poses_as_well_as_was_foretold(tmp_path, seed):
    code, record = run_quick(tmp_path, seed)

    assert (code, record["verdict"]["outcome"]) == (0, "PASS"), record["verdict"]["reason"]
    values = {m["name"]: m["value"] for m in record["measurements"]}
    fit = next(fit for fit in record["fits"] if fit["method"] == "truth_aided")
    assert 0.01 < fit["predicted_heading_max_deg"] < 0.25
    assert 0.05 < values["level_max"] < 0.5
    assert 0.05 < values["tilt_max"] < 0.5
    poses = [pose for pose in record["poses"] if pose["step"] == "planned_poses"]
    assert len(poses) == 9
    steps = {step["name"]: step for step in record["steps"]}
    planned = steps["planned_poses"]
    assert planned["ended_s"] - planned["started_s"] < 25.0


@pytest.mark.parametrize(
    ("fault", "first"), [("dead_strap_x", "fit_accepted"), ("excess_noise", "noise_x")]
)
def test_a_broken_unit_is_not_written(tmp_path, fault, first):
    code, record = run_quick(tmp_path, 11, fault)

    assert (code, record["verdict"]["outcome"]) == (1, "FAIL")
    assert record["first_failure"] == first
    assert record["coefficients"] == {}


def test_an_inverted_axis_is_calibrated_away_as_no_step_judges_its_sense(tmp_path):
    """What quick gives up for its time, and its description says: eol_three_axis fails it."""
    code, record = run_quick(tmp_path, 11, "accel_sign_y")

    assert (code, record["verdict"]["outcome"]) == (0, "PASS")
    (fit,) = (fit for fit in record["fits"] if fit["method"] == "truth_aided")
    assert fit["accel_matrix"][1][1] < -0.9


def test_the_benchmarks_unit_reads_what_the_devices_unit_reads(many_units):
    """Without memory and rig errors both are the same function, but for the noise of a mean."""
    lot = many_units.drawn_lot(7, 1)
    for name in ("hysteresis_mg", "repeatability_mg"):
        lot.values[name][:] = 0.0
    lot.encoders[..., 1:] = 0.0
    lot.geometry[:] = 0.0
    poses = [
        PlannedPose(attitude=Attitude(azimuth_deg=a, pitch_deg=p, roll_deg=r), dwell_s=50.0)
        for a, p, r in POSES
    ]
    way = many_units.way_of(poses, Attitude(azimuth_deg=0.0))

    field_mg, force_g = many_units.read(lot, way, np.random.default_rng(1))

    unit = draw_unit("GU0007", 7)
    for index, pose in enumerate(POSES):
        warm_c = unit.temperature_c(way.seconds[index]) - 25.0
        drift = SlowDrift().field_ned_mg(float(way.seconds[index]))
        ned_mg = tuple(np.add(EarthField().ned_mg, drift).tolist())
        axes = ned_from_body(*pose)
        sensor_mg = unit.magnetics.sensor_field_mg(apply_inverse(axes, ned_mg))
        for axis, across in enumerate((1, 0, 0)):
            bridge = Bridge(unit.bridges[axis])
            levels_mg = bridge.levels_mg(sensor_mg[axis], sensor_mg[across], 1.0, warm_c)
            half_mg = (levels_mg[0] - levels_mg[1]) / 2.0
            assert field_mg[0, index, axis] == pytest.approx(half_mg, abs=0.05)
        expected_g = unit.accelerometer.level_g(
            apply_inverse(axes, (0.0, 0.0, -1.0)), warm_c + 25.0
        )
        assert force_g[0, index] == pytest.approx(expected_g, abs=0.0015)
