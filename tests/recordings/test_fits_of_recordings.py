"""Real recordings: what the fits must reach, and what they must refuse."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.ellipsoid import fit_ellipsoid
from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.fit_report import fit_report
from bench.calibration.methods import fit_all, fit_named
from bench.calibration.ranking import heading_errors_deg
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.data

ENU_TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
UP_TO_DOWN = np.diag([1.0, -1.0, -1.0])


def broad(recordings: Path, name: str) -> CalibrationData:
    """Read a BROAD recording: optical quaternion w,x,y,z sensor to ENU, sensor z up."""
    rows = np.genfromtxt(recordings / "broad" / name, delimiter=",", skip_header=1)
    w, x, y, z = rows[:, 10:14].T
    first = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1)
    second = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1)
    third = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1)
    ned = ENU_TO_NED @ np.stack([first, second, third], axis=1) @ UP_TO_DOWN
    return CalibrationData(
        field_mg=rows[:, 7:10] @ UP_TO_DOWN * 10.0,
        accel_g=rows[:, 4:7] @ UP_TO_DOWN / 9.81,
        azimuth_deg=np.rad2deg(np.arctan2(ned[:, 1, 0], ned[:, 0, 0])),
        pitch_deg=np.rad2deg(-np.arcsin(np.clip(ned[:, 2, 0], -1.0, 1.0))),
        roll_deg=np.rad2deg(np.arctan2(ned[:, 2, 1], ned[:, 2, 2])),
    )


def relative_sd(corrected: np.ndarray) -> float:
    lengths = np.linalg.norm(corrected, axis=1)
    return float(lengths.std() / lengths.mean())


def test_full_sphere_of_a_real_amr_leaves_half_a_percent(recordings: Path) -> None:
    folder = recordings / "hmc5883l_sunsided"
    mag = np.loadtxt(folder / "full-sphere_mag.csv", delimiter=",")
    data = CalibrationData(field_mg=mag[:, 1:] * 1000.0)
    fit = fit_ellipsoid(data)
    assert not fit.refused
    assert relative_sd(fit.corrected_mg(data.field_mg)) == pytest.approx(0.0046, abs=0.0002)
    assert fit.coverage > 0.9
    assert 450.0 < fit.field_mg < 600.0


def test_qmc5883l_is_fitted_as_well_as_its_published_parameters(recordings: Path) -> None:
    raw = np.genfromtxt(
        recordings / "qmc5883l_tomisuarez2_noisy_raw.csv", delimiter=",", skip_header=3
    )
    published = np.loadtxt(recordings / "qmc5883l_tomisuarez2_published_params.csv")
    matrix, shift = published[:9].reshape(3, 3), published[9:]
    fit = fit_ellipsoid(CalibrationData(field_mg=raw))
    theirs, ours = relative_sd(raw @ matrix.T + shift), relative_sd(fit.corrected_mg(raw))
    assert theirs == pytest.approx(0.0619, abs=0.0003)
    assert ours == pytest.approx(0.0624, abs=0.0006)
    centre = -np.linalg.solve(matrix, shift)
    assert np.linalg.norm(fit.offset_mg - centre) < 0.05 * fit.field_mg


@pytest.mark.parametrize(
    ("name", "columns", "skip", "residual"),
    [
        ("ckexplorer_acc_mag_log.csv", (3, 4, 5), 1, 0.0125),
        ("bazhin_mag_out.txt", (0, 1, 2), 0, 0.0206),
    ],
)
def test_other_recordings_reach_their_known_residual(
    recordings: Path, name: str, columns: tuple[int, ...], skip: int, residual: float
) -> None:
    delimiter = "," if name.endswith(".csv") else None
    raw = np.loadtxt(recordings / name, delimiter=delimiter, skiprows=skip, usecols=columns)
    scale = 1000.0 if name.startswith("ck") else 1.0
    fit = fit_ellipsoid(CalibrationData(field_mg=raw * scale))
    assert relative_sd(fit.corrected_mg(raw * scale)) == pytest.approx(residual, rel=0.05)


def test_broad_attitude_is_converted_without_a_mirror(recordings: Path) -> None:
    data = broad(recordings, "02_undisturbed_slow_rotation_B.csv")
    ned = ned_from_body(data.azimuth_deg, data.pitch_deg, data.roll_deg)
    mean = np.einsum("nij,nj->ni", ned, data.field_mg).mean(axis=0)
    strength_mg = np.linalg.norm(data.field_mg, axis=1).mean()
    assert np.linalg.norm(mean) == pytest.approx(strength_mg, rel=0.02)
    assert mean[2] > 0.0


def test_an_undisturbed_recording_is_not_refused_and_reaches_the_room_s_floor(
    recordings: Path,
) -> None:
    data = broad(recordings, "02_undisturbed_slow_rotation_B.csv")
    for method in ("ellipsoid", "truth_aided"):
        fit = fit_named(method, data)
        assert not fit.refused, fit.message
    fit = fit_named("truth_aided", data)
    # The hand that shakes it spoils the accelerometer's tilt: take the optical one.
    flat = np.abs(data.pitch_deg) < 60.0
    optical = replace(data, accel_g=None)
    errors = heading_errors_deg(optical, fit)[flat] + fit.extra["field_azimuth_deg"]
    assert np.sqrt(np.mean(errors**2)) < 4.0
    assert fit.extra["dip_deg"] == pytest.approx(69.8, abs=0.5)


def test_an_attached_magnet_is_refused_by_every_magnetometer_method_with_a_reason(
    recordings: Path,
) -> None:
    data = broad(recordings, "32_disturbed_attached_magnet_1cm.csv")
    fits = fit_all(data)
    assert fits["ellipsoid"].cause == Cause.FIELD_DISTURBED
    assert "magnet" in fits["ellipsoid"].message
    assert fits["truth_aided"].cause == Cause.RESIDUAL_TOO_LARGE
    assert fits["min_max"].refused
    report = fit_report(CalibrationData(field_mg=data.field_mg), "ellipsoid")
    assert report["cause"] == "field_disturbed"


def test_a_module_that_was_only_pushed_along_is_refused(recordings: Path) -> None:
    folder = recordings / "hmc5883l_sunsided"
    mag = np.loadtxt(folder / "pan-along-z-pointing-up_mag.csv", delimiter=",")
    fit = fit_ellipsoid(CalibrationData(field_mg=mag[:, 1:] * 1000.0))
    assert fit.refused
    assert fit.cause != Cause.FIELD_DISTURBED
