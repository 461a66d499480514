from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.errors import ConfigError
from bench.recording_import import ImportOptions, import_recording, resample
from bench.recording_presets import PRESETS, preset

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return tmp_path / "source.csv"


@pytest.fixture
def target(tmp_path: Path) -> Path:
    return tmp_path / "product.csv"


def test_gauss_become_milligauss_on_the_converters_grid(
    source: Path, target: Path, rng: np.random.Generator
) -> None:
    counts = rng.integers(-700, 700, (300, 3))
    rows = "\n".join(",".join(f"{value:.6f}" for value in row / 1090.0) for row in counts)
    source.write_text(rows)

    recording = import_recording(
        source, target, ImportOptions(columns=("mx", "my", "mz"), field_unit="G", rate_hz=75.0)
    )

    assert recording.mag_resolution_mg == pytest.approx(1000.0 / 1090.0, rel=1e-6)
    assert np.array_equal(np.rint(recording.field_mg / recording.mag_resolution_mg), counts)
    assert np.allclose(recording.field_mg, counts / 1.09, atol=1e-3)
    assert recording.rate_hz == pytest.approx(75.0)


def test_what_a_replay_sends_equals_the_file_to_its_printed_decimals(
    source: Path, target: Path, rng: np.random.Generator
) -> None:
    source.write_text(
        "mx;my;mz\n"
        + "\n".join(";".join(f"{v:.4f}" for v in row) for row in rng.uniform(-60, 60, (200, 3)))
    )

    recording = import_recording(source, target, ImportOptions(field_unit="uT"))

    step_mg = recording.mag_resolution_mg
    assert step_mg is not None
    counts = np.rint(recording.field_mg / step_mg)
    assert np.max(np.abs(counts)) <= 32767
    decimals = len(target.read_text().splitlines()[-1].split(",")[1].partition(".")[2])
    assert np.array_equal(np.round(counts * step_mg, decimals), recording.field_mg)
    assert float(recording.metadata["mag_rounding_mg"]) <= step_mg / 2.0 + 1e-12


def test_axes_are_turned_into_body_forward_right_down(source: Path, target: Path) -> None:
    source.write_text("mx,my,mz,ax,ay,az\n1,2,3,0.25,0.5,1\n4,5,6,0.25,0.5,1\n")

    recording = import_recording(
        source, target, ImportOptions(field_axes="y,x,-z", accel_axes="x,-y,-z")
    )

    assert recording.field_mg.tolist() == [[2.0, 1.0, -3.0], [5.0, 4.0, -6.0]]
    assert recording.accel_g is not None
    assert recording.accel_g[0].tolist() == [0.25, -0.5, -1.0]


def test_an_accelerometer_at_another_rate_is_brought_onto_the_magnetometers_times(
    source: Path, target: Path, tmp_path: Path
) -> None:
    times = np.arange(0.0, 2.0, 0.05)
    source.write_text("t_s,mx,my,mz\n" + "\n".join(f"{t:.3f},100,200,300" for t in times))
    second = tmp_path / "accelerometer.csv"
    second.write_text(
        "t_s,ax,ay,az\n"
        + "\n".join(f"{t:.3f},{0.1 * t:.4f},0.0000,-1.0000" for t in np.arange(0.0, 2.0, 0.008))
    )

    recording = import_recording(source, target, ImportOptions(), second)

    assert recording.accel_g is not None
    step_g = recording.accel_resolution_g
    assert step_g is not None
    assert np.allclose(recording.accel_g[:, 0], 0.1 * times, atol=step_g)
    counts = recording.accel_g / step_g
    assert np.allclose(counts, np.rint(counts), atol=1e-6)
    assert recording.metadata["resampling"].startswith("linear")
    assert recording.metadata["accel_source"] == "accelerometer.csv"


def test_rows_that_the_accelerometer_does_not_cover_are_left_out_and_counted(
    source: Path, target: Path, tmp_path: Path
) -> None:
    source.write_text("t_s,mx,my,mz\n" + "\n".join(f"{t},1,2,3" for t in range(10)))
    second = tmp_path / "accelerometer.csv"
    second.write_text("t_s,ax,ay,az\n" + "\n".join(f"{t / 2},0,0,-1" for t in range(4, 13)))

    recording = import_recording(source, target, ImportOptions(), second)

    assert recording.t_s.tolist() == [2.0, 3.0, 4.0, 5.0, 6.0]
    assert recording.metadata["rows_outside"] == "5"


def test_two_files_of_different_times_are_refused(
    source: Path, target: Path, tmp_path: Path
) -> None:
    source.write_text("t_s,mx,my,mz\n0,1,2,3\n1,1,2,3\n")
    second = tmp_path / "accelerometer.csv"
    second.write_text("t_s,ax,ay,az\n100,0,0,-1\n101,0,0,-1\n")

    with pytest.raises(ConfigError, match=r"must cover the times of .* received 100.0 to 101.0 s"):
        import_recording(source, target, ImportOptions(), second)
    assert not target.exists()


@pytest.mark.parametrize(
    ("wanted", "rule", "expected"),
    [
        (0.25, "linear", 2.5),
        (0.25, "nearest", 0.0),
        (0.75, "nearest", 10.0),
        (0.5, "nearest", 0.0),
        (-1.0, "nearest", 0.0),
        (9.0, "nearest", 20.0),
        (-1.0, "linear", 0.0),
        (9.0, "linear", 20.0),
    ],
)
def test_resampling_rules(wanted: float, rule: str, expected: float) -> None:
    times, values = np.array([0.0, 1.0, 2.0]), np.array([[0.0], [10.0], [20.0]])

    assert resample(times, values, np.array([wanted]), rule).tolist() == [[expected]]


def test_an_unknown_rule_of_resampling_is_refused() -> None:
    with pytest.raises(ConfigError, match="must be linear or nearest; instead received 'cubic'"):
        resample(np.arange(2.0), np.zeros((2, 1)), np.zeros(1), "cubic")


def test_a_quaternion_becomes_heading_pitch_and_roll(source: Path, target: Path) -> None:
    source.write_text("mx,my,mz,w,x,y,z\n1,2,3,1,0,0,0\n4,5,6,1,0,0,0\n")

    recording = import_recording(
        source, target, ImportOptions(field_axes="x,-y,-z", quaternion=("w", "x", "y", "z"))
    )

    assert recording.heading_deg is not None
    assert recording.heading_deg.tolist() == [90.0, 90.0]
    assert "heading_deg,pitch_deg,roll_deg" in target.read_text()


def test_counts_of_known_size_are_scaled_and_those_of_unknown_size_said_so(
    source: Path, target: Path
) -> None:
    source.write_text("mx,my,mz\n3,6,9\n30,-60,90\n1,2,4\n")

    unknown = import_recording(source, target, ImportOptions(field_unit="counts"))
    assert unknown.field_mg[0].tolist() == [3.0, 6.0, 9.0]
    assert "unknown" in unknown.metadata["mag_scale"]
    known = import_recording(
        source, target, ImportOptions(field_unit="counts", mg_per_count=1.0 / 3.0)
    )
    assert np.allclose(known.field_mg[1], [10.0, -20.0, 30.0], atol=1e-4)
    assert "mag_scale" not in known.metadata


def test_importing_the_products_own_file_changes_no_value(source: Path, target: Path) -> None:
    source.write_text("mx,my,mz\n" + "\n".join(f"{i}.25,{-i}.75,0.50" for i in range(1, 99)))
    first = import_recording(source, target, ImportOptions())

    again = import_recording(target, target.with_name("again.csv"), ImportOptions())

    assert np.array_equal(again.field_mg, first.field_mg)
    assert np.array_equal(again.t_s, first.t_s)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (ImportOptions(field=("bx", "by", "bz")), "column 'bx' is missing; the columns are mx"),
        (ImportOptions(accel=("ax", "ay", "az")), "column 'ax' is missing"),
        (ImportOptions(time="time"), "column 'time' is missing"),
        (ImportOptions(field_unit="Oe"), "unit of the field must be one of"),
        (ImportOptions(accel_unit="gal"), "unit of the acceleration must be one of"),
        (ImportOptions(field_axes="x,y"), "axes must name x, y and z once"),
        (ImportOptions(rate_hz=0.0), "rate of the rows must be positive; instead received 0.0 Hz"),
        (ImportOptions(columns=("mx", "my")), "a row must hold 2 values"),
    ],
)
def test_options_that_do_not_fit_the_source_are_refused_and_nothing_is_written(
    source: Path, target: Path, options: ImportOptions, sentence: str
) -> None:
    source.write_text("mx,my,mz\n1,2,3\n4,5,6\n")

    with pytest.raises(ConfigError, match=sentence):
        import_recording(source, target, options)
    assert not target.exists()


def test_an_unknown_preset_is_refused_with_the_closest_name() -> None:
    assert preset("broad") is PRESETS["broad"]
    with pytest.raises(ConfigError, match="did you mean hmc5883l_sunsided"):
        preset("hmc5883l_sunside")
