"""The module of two axes (Cho & Park) as it is seen over CAN alone, and how a run gets one."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from bench.bus import BenchBus
from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.fit import Fit
from bench.cli.laboratory import open_laboratory
from bench.cli.main import app
from bench.errors import ModuleRefused
from bench.module import Module
from bench.pose import Attitude
from bench.reproduction.setup import Setup
from bench.rig import Rig
from bench.sample_log import SampleLog
from bench.samples import COMPLETE
from devices.simulator import SimulatorOptions, build_host
from protocols.clock import SimulatedClock
from protocols.compass import FLAG_DEFAULT_COEFFICIENTS, FLAG_TWO_AXIS, QUALITY_CALIBRATED
from protocols.link import Wire
from protocols.uds import DEFAULT_COEFFICIENTS

G_STEP = 1.0 / 16384.0
NOISY = Setup(part="CB-AMR2", noise_mg=0.085, accel_noise_g=0.002)
WRITTEN = replace(DEFAULT_COEFFICIENTS, version=1, extended_dip_deg=60.0, horizontal_mg=250.0)
POSES = [
    Attitude(azimuth_deg=40.0 * k, pitch_deg=pitch, roll_deg=roll)
    for k, (pitch, roll) in enumerate(
        [(0.0, 0.0), (30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -30.0)]
        + [(25.0, 40.0), (-25.0, 40.0), (25.0, -40.0), (-25.0, -40.0)]
    )
]


def wrapped(difference_deg):
    return (np.asarray(difference_deg) + 180.0) % 360.0 - 180.0


def test_with_dip_and_field_written_the_heading_is_right_at_tilt_within_the_noise():
    azimuth_deg = np.array([pose.azimuth_deg for pose in POSES])
    with open_laboratory(NOISY) as laboratory:
        before = laboratory.measure(POSES, dwell_s=0.2)
        assert laboratory.module.status.flags == FLAG_TWO_AXIS | FLAG_DEFAULT_COEFFICIENTS
        written = laboratory.module.diagnostics.write_coefficients(WRITTEN)
        readings = laboratory.measure(POSES, dwell_s=0.5)
        samples = laboratory.listen(0.2)

    assert written.read_back_equal
    assert written.read_back == WRITTEN
    assert set(samples["flags"][-10:]) == {FLAG_TWO_AXIS}
    assert set(samples["quality"]) == {QUALITY_CALIBRATED}
    ax, ay, az = samples["accel_g"].T
    assert az == pytest.approx(-np.sqrt(1.0 - ax**2 - ay**2), abs=G_STEP)
    # 2 mg of 50 readings are 0.016 deg of tilt; tan(dip) and the steep poses make 3 of it
    assert np.abs(wrapped(readings["heading_deg"] - azimuth_deg)).max() < 0.2
    assert np.abs(wrapped(before["heading_deg"] - azimuth_deg))[0] < 0.2
    assert np.abs(wrapped(before["heading_deg"] - azimuth_deg))[1:].min() > 5.0


def test_module_and_bench_agree_on_any_coefficients(rng):
    """The firmware's formula in single precision, the bench's in double, from the same counts."""
    matrix, accel_matrix = np.eye(3), np.eye(3)
    matrix[:2, :2] += rng.normal(0.0, 0.05, (2, 2))
    accel_matrix[:2] += rng.normal(0.0, 0.02, (2, 3))
    fit = Fit(
        method="two_axis",
        offset_mg=np.array([30.0, -20.0, 0.0]),
        matrix=matrix,
        accel_offset_g=np.array([0.02, -0.03, 0.0]),
        accel_matrix=accel_matrix,
        extended_dip_deg=53.0,
        extra={"horizontal_mg": 262.0},
    )
    coefficients = replace(
        WRITTEN,
        mag_offset_mg=tuple(fit.offset_mg),
        mag_matrix=tuple(fit.matrix.ravel()),
        accel_offset_g=tuple(fit.accel_offset_g),
        accel_matrix=tuple(fit.accel_matrix.ravel()),
        extended_dip_deg=fit.extended_dip_deg,
        horizontal_mg=fit.extra["horizontal_mg"],
    )
    with open_laboratory(NOISY) as laboratory:
        laboratory.module.diagnostics.write_coefficients(coefficients)
        readings = []
        for pose in POSES:
            laboratory.rig.move_to(pose)
            readings.append(laboratory.listen(0.1))
    samples = np.concatenate(readings)

    field_mg = (samples["set_mg"] - samples["reset_mg"]) / 2.0
    expected_deg = compensated_heading_deg(fit, field_mg, samples["accel_g"])
    assert len(samples) > 50
    assert wrapped(samples["heading_deg"] - expected_deg) == pytest.approx(0.0, abs=0.006)


def test_a_drawn_unit_keeps_its_coefficients_and_three_axes_refuse_them():
    found = {}
    for part in ("CB-AMR2", "CB-AMR3"):
        wire = Wire()
        wire.add_server(build_host(SimulatorOptions(part=part), wire.attach()).serve)
        bus = BenchBus(wire.attach(), SimulatedClock())
        module, rig = Module(bus), Rig(bus)
        module.wait_ready()
        assert module.identity().part == part
        if part == "CB-AMR3":
            with pytest.raises(ModuleRefused, match="RequestOutOfRange"):
                module.diagnostics.write_coefficients(WRITTEN)
        else:
            assert module.diagnostics.write_coefficients(WRITTEN).read_back_equal
        found[part] = module.diagnostics.read_coefficients()
        rig.connect()
        log = SampleLog(None, module, rig)
        log.begin_dwell(0)
        bus.run_for(0.2)
        samples = log.end_dwell()
        norm_g = np.linalg.norm(samples[samples["complete"] == COMPLETE]["accel_g"], axis=1)
        assert (np.ptp(norm_g) < 2 * G_STEP) == (part == "CB-AMR2")
        bus.close()

    assert found == {"CB-AMR2": WRITTEN, "CB-AMR3": DEFAULT_COEFFICIENTS}


PROCEDURE = """\
name: identity
version: "1.0"
title: Identity
limits: set_reset
steps:
  - {kind: check_bus, name: bus}
  - {kind: identify, name: whoever}
  - {kind: identify, name: identify, part: PART}
"""


@pytest.mark.parametrize(
    ("asked", "made", "code"), [("CB-AMR2", "CB-AMR2", 0), ("CB-AMR9", "CB-AMR3", 1)]
)
def test_a_run_in_this_process_makes_the_part_that_its_procedure_asks_for(
    tmp_path, asked, made, code
):
    path = tmp_path / "identity.yaml"
    path.write_text(PROCEDURE.replace("PART", asked), encoding="utf-8")
    argv = ["run", str(path), "--serial", "SN0001", "--no-input", "--no-dashboard", "--json"]

    ended = CliRunner().invoke(app, [*argv, "--out", str(tmp_path / "runs")])

    assert ended.exit_code == code
    assert json.loads(ended.stdout)["module"]["part"] == made


def test_an_unknown_part_of_simulate_is_refused_in_one_sentence():
    argv = ["simulate", "--interface", "socketcan", "--channel", "vcan9", "--part", "CB-AMR9"]

    ended = CliRunner().invoke(app, argv)

    assert str(ended.exception) == "part must be CB-AMR3 or CB-AMR2; instead received 'CB-AMR9'"
    assert ended.exception.exit_code == 2
