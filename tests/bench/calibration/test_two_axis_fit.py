"""Cho & Park's procedure: level turn, tilts at known azimuths, and what two axes cannot see."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench.calibration.affine_turn import affine_slopes, affine_turn_batch
from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.fit import CalibrationData, Cause, Fit
from bench.calibration.ranking import heading_errors_deg
from bench.calibration.tilt import ned_from_body
from bench.calibration.two_axis_batch import two_axis_batch
from bench.calibration.two_axis_fit import fit_two_axis, fit_two_axis_aided
from protocols.angles import wrap_180_deg

HORIZONTAL_MG = 250.0
TURN_DEG = np.array([(heading, 0.0, 0.0) for heading in range(0, 360, 15)])
TILTS_DEG = np.array(
    [
        (azimuth, pitch, roll)
        for pitch, roll in ((30, 0), (-30, 0), (0, 30), (0, -30))
        for azimuth in range(0, 360, 45)
    ],
    dtype=float,
)
ANGLES_DEG = np.concatenate([TURN_DEG, TURN_DEG[::-1], TILTS_DEG])
FITS = {"two_axis": fit_two_axis, "two_axis_aided": fit_two_axis_aided}


def field_ned(dip_deg: float, azimuth_deg: float = 0.0) -> np.ndarray:
    turned = np.deg2rad(azimuth_deg)
    down = np.tan(np.deg2rad(dip_deg))
    return HORIZONTAL_MG * np.array([np.cos(turned), np.sin(turned), down])


def completed(accel_g: np.ndarray) -> np.ndarray:
    """z of the force as the two-axis module's firmware completes it."""
    force_g = accel_g.copy()
    force_g[..., 2] = -np.sqrt(np.maximum(1.0 - (force_g[..., :2] ** 2).sum(axis=-1), 0.0))
    return force_g


def module_data(
    angles_deg: np.ndarray = ANGLES_DEG,
    *,
    dip_deg: float = 48.72,
    azimuth_deg: float = 0.0,
    gain: Any = ((1.08, 0.0), (0.0, 0.94)),
    vertical: tuple[float, float] = (0.0, 0.0),
    noisy: bool = False,
    seed: int = 1,
) -> CalibrationData:
    """Read a module of two axes on the rig: gains, hard iron, 20 mg and half a degree of force."""
    rng = np.random.default_rng(seed)
    share = 1.0 if noisy else 0.0
    actual_deg = angles_deg + share * rng.normal(0.0, 0.02, angles_deg.shape)
    rotations = ned_from_body(*actual_deg.T)
    body_mg = np.einsum("nji,j->ni", rotations, field_ned(dip_deg, azimuth_deg))
    body_g = np.einsum("nji,j->ni", rotations, np.array([0.0, 0.0, -1.0]))
    matrix = np.eye(3)
    matrix[:2, :2], matrix[:2, 2] = gain, vertical
    accel = np.eye(3) + np.array([[0.01, 0.006, -0.005], [-0.008, -0.01, 0.007], [0, 0, 0]])
    accel_g = body_g @ accel.T + [0.02, -0.015, 0.0] + share * rng.normal(0, 5e-4, body_g.shape)
    return CalibrationData(
        field_mg=body_mg @ matrix.T
        + [40.0, -30.0, 60.0]
        + share * rng.normal(0, 0.35, body_mg.shape),
        accel_g=completed(accel_g),
        azimuth_deg=angles_deg[:, 0],
        pitch_deg=angles_deg[:, 1],
        roll_deg=angles_deg[:, 2],
        field_sd_mg=0.35,
        accel_sd_g=5e-4,
        rig_sd_deg=0.02,
        station_field_mg=field_ned(dip_deg, azimuth_deg),
    )


def worst_deg(fit: Fit, data: CalibrationData) -> float:
    return float(np.abs(heading_errors_deg(data, fit)).max())


@pytest.mark.parametrize("method", list(FITS))
@pytest.mark.parametrize("azimuth_deg", [0.0, -9.0])
def test_exact_readings_give_exact_headings(method: str, azimuth_deg: float) -> None:
    data = module_data(azimuth_deg=azimuth_deg)
    turned = data.azimuth_deg + azimuth_deg  # extremes of the turn lie on the headings
    data = module_data(np.column_stack([turned, ANGLES_DEG[:, 1:]]), azimuth_deg=azimuth_deg)
    fit = FITS[method](data)
    assert fit.extended_dip_deg == pytest.approx(48.72, abs=1e-6)
    assert fit.offset_mg == pytest.approx([40.0, -30.0, 0.0], abs=1e-6)
    assert fit.matrix @ np.diag([1.08, 0.94, 1.0]) == pytest.approx(np.eye(3), abs=1e-9)
    assert fit.matrix[2].tolist() == [0.0, 0.0, 1.0]
    assert fit.extra["horizontal_mg"] == pytest.approx(HORIZONTAL_MG)
    without_force = replace(data, accel_g=None)
    assert worst_deg(fit, without_force) < 1e-6


def test_soft_iron_between_the_axes_is_taken_with_azimuths_and_not_by_extremes() -> None:
    data = module_data(gain=((1.08, 0.06), (-0.02, 0.94)))
    assert worst_deg(fit_two_axis_aided(data), replace(data, accel_g=None)) < 1e-6
    assert worst_deg(fit_two_axis(data), replace(data, accel_g=None)) > 2.0


@pytest.mark.parametrize("method", list(FITS))
def test_the_accelerometer_s_x_and_y_come_right(method: str) -> None:
    data = module_data()
    fit = FITS[method](data)
    expected = np.einsum("nji,j->ni", ned_from_body(*ANGLES_DEG.T), np.array([0.0, 0.0, -1.0]))
    error_g = fit.corrected_g(data.accel_g)[:, :2] - expected[:, :2]
    assert np.abs(data.accel_g[:, :2] - expected[:, :2]).max() > 0.02
    assert np.abs(error_g).max() < 1.2e-3
    assert worst_deg(fit, data) < 0.12


def test_without_force_there_are_no_accelerometer_coefficients_and_it_is_said() -> None:
    fit = fit_two_axis_aided(replace(module_data(), accel_g=None))
    assert fit.accel_matrix is None
    assert "nor is the accelerometer" in fit.message
    assert fit.parameters[-1] == "extended_dip_deg"
    assert fit.covariance.shape == (7, 7)


@pytest.mark.parametrize(("share", "left_deg"), [(0.02, 0.75), (0.05, 1.87)])
def test_vertical_soft_iron_is_beyond_two_axes(share: float, left_deg: float) -> None:
    """0.75 and 1.9 deg at a roll of 30, dip 48.72: the turn takes it for hard iron."""
    iron: dict[str, Any] = {"gain": np.eye(2), "vertical": (share, 0.0)}
    fit = fit_two_axis_aided(replace(module_data(**iron), accel_g=None))
    rolled = np.array([(heading, 0.0, 30.0) for heading in range(0, 360, 5)])
    assert worst_deg(fit, replace(module_data(rolled, **iron), accel_g=None)) == pytest.approx(
        left_deg, abs=0.01
    )
    assert worst_deg(fit, replace(module_data(TURN_DEG, **iron), accel_g=None)) < 1e-6
    assert fit.predicted_heading_rms_deg < left_deg / 5.0
    assert "vertical soft iron is not in the prediction" in fit.message


@pytest.mark.parametrize("aided", [False, True])
def test_parameters_are_recovered_within_the_covariance(aided: bool) -> None:
    """400 units at once; extremes 15 deg apart are coarser than their noise, and say so."""
    rng = np.random.default_rng(5)

    def read(angles_deg: np.ndarray) -> np.ndarray:
        actual = angles_deg + rng.normal(0.0, 0.02, (400, *angles_deg.shape))
        rotations = ned_from_body(*np.moveaxis(actual, -1, 0))
        body_mg = np.einsum("unji,j->uni", rotations, field_ned(60.0))[..., :2]
        return body_mg * [1.1, 0.95] + [40.0, -30.0] + rng.normal(0.0, 0.35, body_mg.shape)

    turn_deg = np.concatenate([TURN_DEG, TURN_DEG[::-1]])
    fits = two_axis_batch(
        read(turn_deg),
        turn_deg[:, 0] if aided else None,
        read(TILTS_DEG),
        *TILTS_DEG.T,
        horizontal_mg=HORIZONTAL_MG,
        field_sd_mg=0.35,
    )
    assert not fits.cause.any()
    sd = np.sqrt(np.einsum("uii->ui", fits.covariance))
    pulls = (
        np.column_stack([fits.turn.offset_mg - [40.0, -30.0], fits.dip.dip_deg - 60.0])
        / sd[:, [0, 1, -1]]
    )
    assert np.mean(np.abs(pulls) < 2.0, axis=0).min() > 0.92
    if aided:
        assert pulls.std(axis=0) == pytest.approx(np.ones(3), abs=0.12)
        gains = np.linalg.inv(fits.turn.matrix) - np.diag([1.1, 0.95])
        assert (gains.reshape(-1, 4) / sd[:, 2:6]).std(axis=0) == pytest.approx(
            np.ones(4), abs=0.13
        )


def test_the_turn_s_noise_is_in_the_uncertainty_of_the_dip() -> None:
    """Many readings of one tilt after a short turn: the dip is off by what the offset is off."""
    rng = np.random.default_rng(6)
    turn_deg, tilt_deg = TURN_DEG[::4], np.tile([[45.0, 30.0, 0.0]], (100, 1))

    def read(angles_deg: np.ndarray) -> np.ndarray:
        body_mg = np.einsum("nji,j->ni", ned_from_body(*angles_deg.T), field_ned(60.0))[:, :2]
        return body_mg + rng.normal(0.0, 0.35, (400, *body_mg.shape))

    fits = two_axis_batch(
        read(turn_deg),
        turn_deg[:, 0],
        read(tilt_deg),
        *tilt_deg.T,
        horizontal_mg=HORIZONTAL_MG,
        field_sd_mg=0.35,
        rig_sd_deg=1e-4,
    )
    sd_deg = np.sqrt(fits.covariance[:, -1, -1])
    assert np.std((fits.dip.dip_deg - 60.0) / sd_deg) == pytest.approx(1.0, abs=0.12)


def test_predicted_heading_error_is_the_achieved_one() -> None:
    grid = replace(module_data(), accel_g=None)
    told, achieved = [], []
    for seed in range(40):
        fit = fit_two_axis_aided(replace(module_data(noisy=True, seed=seed), accel_g=None))
        told.append(fit.predicted_heading_rms_deg)
        achieved.append(np.mean(heading_errors_deg(grid, fit) ** 2))
    assert np.sqrt(np.mean(achieved)) == pytest.approx(np.mean(told), rel=0.2)
    assert 0.0 < fit.extra["predicted_by_dip_rms_deg"] < fit.predicted_heading_rms_deg
    assert fit.predicted_heading_max_deg > 2.0 * fit.predicted_heading_rms_deg


def test_the_accelerometer_s_part_is_predicted_besides() -> None:
    """Its residual holds what completing z from x and y leaves, so that the promise is careful."""
    data = module_data(noisy=True)
    fit = fit_two_axis_aided(data)
    alone = fit_two_axis_aided(replace(data, accel_g=None))
    assert fit.predicted_heading_rms_deg > alone.predicted_heading_rms_deg
    achieved = np.sqrt(np.mean(heading_errors_deg(module_data(), fit) ** 2))
    assert achieved < 2.0 * fit.predicted_heading_rms_deg


def rows(kept: np.ndarray) -> CalibrationData:
    data = module_data(noisy=True)
    columns = ("field_mg", "accel_g", "azimuth_deg", "pitch_deg", "roll_deg")
    return replace(data, **{name: getattr(data, name)[kept] for name in columns})


LEVEL = np.arange(len(ANGLES_DEG)) < 48
PITCHED = np.abs(ANGLES_DEG[:, 1]) > 0.0
NORTH_SOUTH = np.isin(ANGLES_DEG[:, 0], (0.0, 180.0))


@pytest.mark.parametrize("method", list(FITS))
@pytest.mark.parametrize(
    ("data", "cause", "words"),
    [
        (replace(module_data(), azimuth_deg=None), Cause.NO_TRUTH, "azimuth"),
        (
            replace(module_data(), pitch_deg=None, accel_g=None),
            Cause.NO_TRUTH,
            "pitch and roll or the specific force",
        ),
        (rows(LEVEL), Cause.TILT_TOO_SMALL, "received 0"),
        (module_data(ANGLES_DEG * [1.0, 0.13, 0.13]), Cause.TILT_TOO_SMALL, "received 0"),
        (rows(LEVEL | (PITCHED & NORTH_SOUTH)), Cause.BLIND_AZIMUTH, "does not show the dip"),
        (rows(~LEVEL), Cause.TOO_FEW, "level turn needs at least"),
        (rows(~LEVEL | (ANGLES_DEG[:, 0] < 180.0)), Cause.NO_TURN, "turn through all headings"),
        (
            replace(module_data(), roll_deg=np.where(LEVEL, 0.0, -ANGLES_DEG[:, 2])),
            Cause.RESIDUAL_TOO_LARGE,
            "off any dip",
        ),
    ],
    ids=[
        "azimuth",
        "tilt unknown",
        "level only",
        "3.9 deg",
        "blind",
        "no level rows",
        "half a turn",
        "signs",
    ],
)
def test_what_cannot_be_seen_is_refused_with_its_cause(
    method: str, data: CalibrationData, cause: Cause, words: str
) -> None:
    fit = FITS[method](data)
    assert fit.cause == cause
    assert words in fit.message
    assert fit.offset_mg is fit.matrix is fit.extended_dip_deg is fit.covariance is None
    assert fit.method == method


def test_tilts_beside_the_blind_azimuth_are_worth_less_than_across_it() -> None:
    across = np.isin(ANGLES_DEG[:, 0], (90.0, 270.0))
    aside = fit_two_axis_aided(rows(LEVEL | (PITCHED & ~across & ~NORTH_SOUTH)))
    seen = fit_two_axis_aided(rows(LEVEL | (PITCHED & across)))
    assert seen.extra["extended_dip_deg_sd"] < aside.extra["extended_dip_deg_sd"]
    assert aside.extended_dip_deg == pytest.approx(48.72, abs=0.3)


def test_without_rig_angles_the_tilt_is_the_force_s() -> None:
    data = replace(module_data(), pitch_deg=None, roll_deg=None)
    fit = fit_two_axis_aided(data)
    assert fit.extended_dip_deg == pytest.approx(48.72, abs=2.0)
    assert fit.accel_matrix is None


def test_headings_of_one_reading_and_of_many_agree() -> None:
    data = module_data()
    fit = fit_two_axis_aided(data)
    many = compensated_heading_deg(fit, data.field_mg, data.accel_g)
    one = compensated_heading_deg(fit, data.field_mg[60], data.accel_g[60])
    assert one == pytest.approx(many[60], abs=1e-9)
    assert np.abs(wrap_180_deg(many - ANGLES_DEG[:, 0])).max() < 0.12


def test_slopes_of_the_affine_matrix_are_its_derivatives() -> None:
    gain = np.array([[1.1, 0.05], [-0.03, 0.9]])
    slopes = affine_slopes(np.linalg.inv(gain))
    for parameter, (row, column) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1)), start=2):
        change = np.zeros((2, 2))
        change[row, column] = 1e-6
        found = (np.linalg.inv(gain + change) - np.linalg.inv(gain - change)) / 2e-6
        assert slopes[parameter] == pytest.approx(found, abs=1e-8)


@pytest.mark.parametrize(
    ("readings", "cause"),
    [
        (np.zeros((24, 2)), "no_turn"),
        (np.column_stack([250.0 * np.cos(np.deg2rad(TURN_DEG[:, 0])), np.zeros(24)]), "degenerate"),
    ],
)
def test_a_turn_of_no_use_is_refused_beside_a_good_one(readings: np.ndarray, cause: str) -> None:
    from bench.calibration.level_kernel import CAUSES

    psi = np.deg2rad(TURN_DEG[:, 0])
    good = 250.0 * np.column_stack([np.cos(psi), -np.sin(psi)])
    fits = affine_turn_batch(np.stack([good, readings]), TURN_DEG[:, 0])
    assert [CAUSES[code] for code in fits.cause] == [None, cause]
    assert fits.matrix[1].tolist() == np.eye(2).tolist()
    assert np.isfinite(fits.covariance).all()
