"""The presets, on the recordings that they are for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.recording_csv import read_table
from bench.recording_import import import_recording
from bench.recording_presets import PRESETS
from devices.replay import ReplaySensors
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from pathlib import Path

    from bench.recordings import Recording

pytestmark = pytest.mark.data

FILES = {
    "hmc5883l_sunsided": (
        "hmc5883l_sunsided/full-sphere_mag.csv",
        "hmc5883l_sunsided/full-sphere_acc.csv",
    ),
    "qmc5883l_tomisuarez2": ("qmc5883l_tomisuarez2_noisy_raw.csv", None),
    "ckexplorer": ("ckexplorer_acc_mag_log.csv", None),
    "bazhin": ("bazhin_mag_out.txt", None),
    "broad": ("broad/02_undisturbed_slow_rotation_B.csv", None),
}


def imported(name: str, recordings: Path, target: Path) -> Recording:
    source, second = FILES[name]
    accelerometer = None if second is None else recordings / second
    return import_recording(recordings / source, target, PRESETS[name], accelerometer)


def test_every_preset_is_tried() -> None:
    assert set(FILES) == set(PRESETS)


@pytest.mark.parametrize("name", FILES)
def test_each_reading_fits_the_modules_counts_and_comes_back(
    recordings: Path, tmp_path: Path, name: str
) -> None:
    recording = imported(name, recordings, tmp_path / "product.csv")

    for values, step in (
        (recording.field_mg, recording.mag_resolution_mg),
        (recording.accel_g, recording.accel_resolution_g),
    ):
        if values is None:
            continue
        assert step is not None
        counts = np.rint(values / step)
        assert np.max(np.abs(counts)) <= 32767
        assert np.max(np.abs(counts * step - values)) < 1e-3 * step


@pytest.mark.parametrize("name", FILES)
def test_a_replayed_module_sends_each_reading_as_the_file_prints_it(
    recordings: Path, tmp_path: Path, name: str
) -> None:
    recording = imported(name, recordings, tmp_path / "product.csv")
    printed = read_table(tmp_path / "product.csv").decimals(("mx", "my", "mz"))

    sensors = ReplaySensors(tmp_path / "product.csv")
    sent = [sensors.sample(0.0) for _ in range(len(recording))]

    set_counts = np.array([sample[0] for sample in sent if sample is not None])
    assert len(set_counts) == len(recording)
    received_mg = set_counts * sensors.converters.mag_mg_per_count
    assert np.array_equal(np.round(received_mg, printed) + 0.0, recording.field_mg + 0.0)


def test_sunsided_keeps_the_chips_own_step_and_every_reading(
    recordings: Path, tmp_path: Path
) -> None:
    recording = imported("hmc5883l_sunsided", recordings, tmp_path / "product.csv")

    # HMC5883L data sheet, gain 1 (the default): 1090 counts a gauss. MPU6050, 8 g: 4096 a g.
    assert recording.mag_resolution_mg == pytest.approx(1000.0 / 1090.0, rel=1e-6)
    assert recording.accel_resolution_g == pytest.approx(1.0 / 4096.0, rel=1e-6)
    raw = read_table(recordings / FILES["hmc5883l_sunsided"][0], names=("t_s", "x", "y", "z"))
    turned = raw.numbers(("x", "y", "z"))[: len(recording)] * [1000.0, -1000.0, -1000.0]
    assert len(recording) >= len(raw.rows) - 1
    assert np.allclose(recording.field_mg, turned, atol=1e-9)
    assert recording.rate_hz == pytest.approx(77.0, abs=0.1)


def test_sunsided_starts_level_with_the_field_pointing_down(
    recordings: Path, tmp_path: Path
) -> None:
    recording = imported("hmc5883l_sunsided", recordings, tmp_path / "product.csv")

    assert recording.accel_g is not None
    assert recording.accel_g[:50, 2].mean() == pytest.approx(-1.01, abs=0.02)
    assert recording.field_mg[:50, 2].mean() > 300.0


def test_tomisuarez2_counts_stay_counts(recordings: Path, tmp_path: Path) -> None:
    recording = imported("qmc5883l_tomisuarez2", recordings, tmp_path / "product.csv")

    assert len(recording) == 22743
    assert recording.field_mg[0].tolist() == [6242.0, 980.0, 3872.0]
    assert recording.rate_hz == pytest.approx(50.0)
    assert "unknown" in recording.metadata["mag_scale"]


def test_broad_truth_agrees_with_accelerometer_and_magnetometer(
    recordings: Path, tmp_path: Path
) -> None:
    recording = imported("broad", recordings, tmp_path / "product.csv")

    assert recording.accel_g is not None
    assert recording.heading_deg is not None
    assert recording.pitch_deg is not None
    assert recording.roll_deg is not None
    forward, right, down = recording.accel_g.T
    pitch_rad = np.arctan2(forward, np.hypot(right, down))
    roll_rad = np.arctan2(-right, -down)
    assert np.median(np.abs(np.degrees(pitch_rad) - recording.pitch_deg)) < 1.0
    assert np.median(np.abs(np.degrees(roll_rad) - recording.roll_deg)) < 1.0
    # Shaking spoils the accelerometer's tilt, so the heading takes the true one.
    pitch_rad, roll_rad = np.radians(recording.pitch_deg), np.radians(recording.roll_deg)
    x, y, z = recording.field_mg.T
    north = x * np.cos(pitch_rad) + (y * np.sin(roll_rad) + z * np.cos(roll_rad)) * np.sin(
        pitch_rad
    )
    east = z * np.sin(roll_rad) - y * np.cos(roll_rad)
    error_deg = wrap_180_deg(np.degrees(np.arctan2(east, north)) - recording.heading_deg)
    assert abs(np.median(error_deg)) < 1.0
    assert np.std(error_deg) < 5.0
