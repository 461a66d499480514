from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.special import stdtrit

from bench.calibration.accelerometer import fit_accelerometer
from bench.calibration.fit import CalibrationData, Cause, rows_of
from bench.calibration.prediction import grid_attitudes_deg
from bench.calibration.ranking import heading_error
from bench.calibration.sphere_model import sphere_rows, tilt_rows
from bench.calibration.tilt import ned_from_body
from bench.calibration.tilt_aided import PARAMETERS, fit_tilt_aided, fit_with_force
from bench.calibration.tilt_aided_batch import CAUSES, tilt_aided_batch
from bench.calibration.tilt_force import Force

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bench.calibration.fit import Fit

FIELD = 500.0 * np.array([np.cos(np.deg2rad(65.0)), 0.0, np.sin(np.deg2rad(65.0))])
GAIN = np.eye(3) + np.array([[0.1, 0.04, -0.06], [-0.02, -0.08, 0.05], [0.07, -0.03, 0.02]])
OFFSET = np.array([180.0, -250.0, 90.0])
SD_MG, SD_G = 0.5, 0.0017


def poses_deg(count: int = 36, tilt: float = 45.0, seed: int = 1) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0, 360, count), *rng.uniform(-tilt, tilt, (2, count))])


def readings(
    angles_deg: NDArray[np.float64],
    *,
    units: int = 1,
    noise: float = 1.0,
    gain: NDArray[np.float64] = GAIN,
    seed: int = 7,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    ned = ned_from_body(*angles_deg.T)
    shape = (units, *angles_deg.shape)
    field = np.einsum("nji,j->ni", ned, FIELD) @ gain.T + OFFSET
    return (
        field + noise * SD_MG * rng.normal(size=shape),
        -ned[:, 2] + noise * SD_G * rng.normal(size=shape),
    )


def data_of(angles_deg: NDArray[np.float64], **options: Any) -> CalibrationData:
    field, force = readings(angles_deg, **options)
    return CalibrationData(
        field_mg=field[0],
        accel_g=force[0],
        field_sd_mg=SD_MG,
        accel_sd_g=SD_G,
        station_field_mg=FIELD,
    )


def fit_exact(data: CalibrationData) -> Fit:
    """Fit against a force whose coefficients are known without error."""
    force = Force(
        accel_g=data.accel_g,
        gain=np.eye(3),
        offset_g=np.zeros(3),
        spread=np.zeros((12, 12)),
        source="accelerometer",
    )
    return fit_with_force(data, force)


def ring(pitch: float, roll: float, count: int = 12) -> list[tuple[float, float, float]]:
    return [(360.0 * index / count, pitch, roll) for index in range(count)]


def test_derivatives_are_those_of_finite_differences() -> None:
    rng = np.random.default_rng(0)
    down = rng.normal(size=(2, 6, 3))
    down /= np.linalg.norm(down, axis=-1, keepdims=True)
    points, sd = rng.normal(size=(2, 6, 3)), np.array([0.1, 0.2])

    def rows(at: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        matrix, centre = at[:, :9].reshape(-1, 3, 3), at[:, 9:12]
        return tilt_rows(matrix, centre, at[:, 12], points, down, sd, 0.05)

    matrix = np.eye(3) + 0.1 * rng.normal(size=(2, 3, 3))
    at = np.concatenate([matrix.reshape(2, 9), 0.2 * rng.normal(size=(2, 4))], axis=1)
    residual, jacobian = rows(at)
    for column in range(13):
        step = 1e-6 * np.eye(13)[column]
        slope = (rows(at + step)[0] - rows(at - step)[0]) / 2e-6
        assert jacobian[..., column] == pytest.approx(slope, abs=1e-6)
    alone, by_sphere = sphere_rows(matrix, at[:, 9:12], points, sd)
    assert alone == pytest.approx(residual[:, 0])
    assert by_sphere == pytest.approx(jacobian[:, 0, :, :12])


def test_given_no_noise_when_fitted_then_matrix_offset_and_dip_are_exact() -> None:
    fit = fit_tilt_aided(data_of(poses_deg(), noise=0.0))
    assert not fit.refused
    assert fit.matrix @ GAIN == pytest.approx(np.eye(3), abs=1e-7)
    assert fit.offset_mg == pytest.approx(OFFSET, abs=1e-5)
    assert fit.dip_deg == pytest.approx(65.0, abs=1e-6)
    assert fit.rank == len(PARAMETERS) == len(fit.covariance)


def test_without_station_the_matrix_has_determinant_one() -> None:
    fit = fit_tilt_aided(replace(data_of(poses_deg(), noise=0.0), station_field_mg=None))
    assert np.linalg.det(fit.matrix) == pytest.approx(1.0)
    assert fit.field_mg == pytest.approx(500.0 * np.linalg.det(GAIN) ** (1 / 3), abs=1e-3)


@pytest.mark.parametrize(("count", "tilt"), [(36, 45.0), (12, 45.0), (36, 20.0)])
def test_intervals_hold_the_truth_and_errors_match_the_covariance(count: int, tilt: float) -> None:
    units = 1500
    field, force = readings(poses_deg(count, tilt), units=units)
    fits = tilt_aided_batch(field, force, SD_MG, SD_G, station_field_mg=FIELD)
    assert (fits.cause == 0).all()
    truth = np.concatenate([np.linalg.inv(GAIN).ravel(), OFFSET, [65.0]])
    dip_deg = fits.dip_deg[:, None]
    off = np.concatenate([fits.matrix.reshape(-1, 9), fits.offset_mg, dip_deg], axis=1) - truth
    chi2 = fits.chi2_reduced[:, None, None]
    own = fits.covariance / np.maximum(chi2, 1.0)
    distance = np.einsum("bi,bij,bj->b", off, np.linalg.inv(own), off) / 13.0
    assert distance.mean() == pytest.approx(1.0, abs=0.06)
    assert fits.chi2_reduced.mean() == pytest.approx(1.0, abs=0.03)
    sd = np.sqrt(np.diagonal(own * chi2, axis1=1, axis2=2))
    held = (np.abs(off) <= stdtrit(2 * count - 13, 0.975) * sd).mean(axis=0)
    assert (held > 0.93).all()
    assert (held < 0.97).all()


def test_a_batch_gives_each_unit_what_it_gets_alone() -> None:
    field, force = readings(poses_deg(), units=3)
    together = tilt_aided_batch(field, force, SD_MG, SD_G, station_field_mg=FIELD)
    alone = fit_exact(
        CalibrationData(
            field_mg=field[1],
            accel_g=force[1],
            field_sd_mg=SD_MG,
            accel_sd_g=SD_G,
            station_field_mg=FIELD,
        )
    )
    assert alone.matrix == pytest.approx(together.matrix[1], abs=1e-9)
    assert alone.covariance == pytest.approx(together.covariance[1], rel=1e-6, abs=1e-15)
    assert alone.predicted_heading_max_deg == pytest.approx(together.predicted_max_deg[1])


@pytest.mark.parametrize("turn_deg", [(0.0, 0.0, 25.0), (90.0, 0.0, 180.0), (170.0, 0.0, 0.0)])
def test_a_magnetometer_mounted_another_way_is_turned_to_the_accelerometer(
    turn_deg: tuple[float, float, float],
) -> None:
    gain = ned_from_body(*turn_deg) @ GAIN
    fit = fit_tilt_aided(data_of(poses_deg(), gain=gain))
    assert fit.matrix @ gain == pytest.approx(np.eye(3), abs=0.01)


def test_a_mirrored_magnetometer_is_never_accepted() -> None:
    fit = fit_tilt_aided(data_of(poses_deg(), gain=GAIN @ np.diag([1.0, -1.0, 1.0])))
    assert fit.cause == Cause.DEGENERATE
    assert "dip of -65 deg" in fit.message
    data = data_of(poses_deg())
    assert fit_tilt_aided(replace(data, accel_g=-data.accel_g)).cause == Cause.DEGENERATE


@pytest.mark.parametrize("noise", [0.02, 1.0, 10.0])
@pytest.mark.parametrize(
    ("angles", "causes"),
    [
        (ring(0, 0), {Cause.TILT_TOO_SMALL}),
        (ring(20, 0), {Cause.TILT_TOO_SMALL}),
        (ring(0, 0) + ring(30, 0) + ring(-30, 0), {Cause.NOT_OBSERVABLE}),
        (ring(0, 0) + ring(0, 30), {Cause.NOT_OBSERVABLE}),
    ],
    ids=["level only", "single tilt", "pitch only", "roll only"],
)
def test_poses_that_cannot_observe_are_refused(
    angles: list[tuple[float, float, float]], causes: set[Cause], noise: float
) -> None:
    field, force = readings(np.array(angles), units=40, noise=noise)
    fits = tilt_aided_batch(field, force, SD_MG, SD_G, station_field_mg=FIELD)
    if noise > 1.0:  # noise that is not assumed may pass for a little tilt
        causes = causes | {Cause.NOT_OBSERVABLE}
    assert {CAUSES[code] for code in fits.cause} <= causes
    assert (fits.matrix == np.eye(3)).all()


def test_pitch_only_is_refused_with_a_raw_accelerometer_too(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    for seed in range(10):
        data = rows_of(drawn(seed).data, eol_deg[:, 2] == 0)
        fit = fit_tilt_aided(data)
        assert fit.cause == Cause.NOT_OBSERVABLE
        assert "mirror image" in fit.message


@pytest.mark.parametrize("spread", [2.0, 8.0, 15.0])
@pytest.mark.parametrize("noise", [1.0, 10.0])
def test_clustered_poses_are_refused_or_as_good_as_predicted(spread: float, noise: float) -> None:
    rng = np.random.default_rng(3)
    angles = spread * np.column_stack([2.0 * rng.normal(size=24), *rng.normal(size=(2, 24))])
    field, force = readings(angles, units=60, noise=noise)
    fits = tilt_aided_batch(field, force, noise * SD_MG, noise * SD_G, station_field_mg=FIELD)
    accepted = fits.cause == 0
    assert spread > 5.0 or not accepted.any()
    error = (fits.matrix @ GAIN - np.eye(3))[accepted]
    sd = np.sqrt(np.diagonal(fits.covariance, axis1=1, axis2=2))[accepted, :9]
    assert (np.abs(error @ np.linalg.inv(GAIN)).reshape(-1, 9) < 6.0 * sd).all()


def test_saturated_readings_are_refused() -> None:
    data = data_of(poses_deg(200))
    held = np.minimum(data.field_mg, np.quantile(data.field_mg, 0.85, axis=0))
    fit = fit_tilt_aided(replace(data, field_mg=held))
    assert fit.cause == Cause.SATURATED
    assert "axis x" in fit.message


def test_a_magnet_that_moves_with_the_tilt_is_refused() -> None:
    angles = poses_deg(60)
    data = data_of(angles)
    near = 150.0 * np.sin(np.deg2rad(3.0 * angles))
    fit = fit_tilt_aided(replace(data, field_mg=data.field_mg + near))
    assert fit.cause in {Cause.RESIDUAL_TOO_LARGE, Cause.FIELD_DISTURBED, Cause.NOT_CONVERGED}


def test_what_cannot_be_fitted_at_all_is_refused_with_its_cause() -> None:
    data = data_of(poses_deg())
    still = np.tile([100.0, 20.0, 400.0], (36, 1))
    fallen = np.zeros((36, 3))
    stuck = data.field_mg * [1.0, 1.0, 0.0]
    assert fit_tilt_aided(replace(data, accel_g=None)).cause == Cause.NO_ACCELERATION
    assert fit_tilt_aided(replace(data, accel_g=fallen)).cause == Cause.NO_ACCELERATION
    assert fit_tilt_aided(replace(data, field_mg=still)).cause == Cause.NO_TURN
    assert fit_tilt_aided(replace(data, field_mg=stuck)).refused
    assert fit_tilt_aided(data_of(poses_deg(7))).cause == Cause.TOO_FEW


def test_a_few_disturbed_poses_are_named_and_left_out() -> None:
    data = data_of(poses_deg())
    field = data.field_mg.copy()
    field[[4, 21]] += [[60.0, -20.0, 40.0], [-30.0, 50.0, 10.0]]
    fit = fit_tilt_aided(replace(data, field_mg=field))
    named = [name for name in fit.extra if name.startswith("disturbed_") and "sigmas" in name]
    assert named == ["disturbed_4_sigmas", "disturbed_21_sigmas"]
    assert "4 by" in fit.message
    assert "21 by" in fit.message
    assert fit.samples == 34
    clean = fit_tilt_aided(rows_of(data, ~np.isin(np.arange(36), [4, 21])))
    assert fit.matrix == pytest.approx(clean.matrix, abs=1e-9)


def test_many_disturbed_poses_are_refused_by_name() -> None:
    data = data_of(poses_deg())
    field = data.field_mg.copy()
    field[:9] += 80.0 * np.random.default_rng(2).normal(size=(9, 3))
    fit = fit_tilt_aided(replace(data, field_mg=field))
    assert fit.cause == Cause.FIELD_DISTURBED
    assert "of 36 poses contradict the others (0 by" in fit.message


def judged_on_the_grid(drawn: Callable[..., Any], seed: int) -> CalibrationData:
    """Return what the module of a seed reads, without noise, at the attitudes of the grid."""
    quiet = {"field_sd_mg": 0.0, "accel_sd_g": 0.0, "rig_sd_deg": 0.0}
    clean = drawn(seed, **quiet)
    ned = ned_from_body(*grid_attitudes_deg().T)
    field = np.einsum("nji,j->ni", ned, clean.data.station_field_mg) @ clean.gain.T
    return replace(
        clean.data,
        field_mg=field + clean.offset_mg,
        accel_g=-ned[:, 2] @ clean.accel_gain.T + clean.accel_offset_g,
        azimuth_deg=grid_attitudes_deg()[:, 0],
        pitch_deg=grid_attitudes_deg()[:, 1],
        roll_deg=grid_attitudes_deg()[:, 2],
    )


@pytest.mark.parametrize("source", ["accelerometer", "raw"])
def test_the_heading_is_as_good_as_predicted_with_a_corrected_and_with_a_raw_force(
    drawn: Callable[..., Any], source: str
) -> None:
    squares, predicted = [], []
    expected_deg = {"accelerometer": 0.05, "raw": 1.1}[source]
    for seed in range(40):
        data = drawn(seed).data
        if source == "raw":
            data = replace(data, azimuth_deg=None, pitch_deg=None, roll_deg=None)
        fit = fit_tilt_aided(data)
        assert not fit.refused, fit.message
        assert fit.accel_from == source
        assert ("30 mg of bias" in fit.message) == (source == "raw")
        error = heading_error(judged_on_the_grid(drawn, seed), fit)
        squares.append((error.rms_deg / fit.predicted_heading_rms_deg) ** 2)
        predicted.append(fit.predicted_heading_rms_deg)
    assert np.sqrt(np.mean(squares)) == pytest.approx(1.0, abs=0.2)
    assert np.median(predicted) == pytest.approx(expected_deg, rel=0.2)


def test_the_corrected_force_brings_its_coefficients_and_their_uncertainty_along(
    drawn: Callable[..., Any],
) -> None:
    data = drawn(2).data
    fit, lender = fit_tilt_aided(data), fit_accelerometer(data)
    assert fit.accel_matrix == pytest.approx(lender.accel_matrix, abs=1e-12)
    assert fit.accel_offset_g == pytest.approx(lender.accel_offset_g, abs=1e-12)
    force = replace(data, accel_g=lender.corrected_g(data.accel_g))
    grown = np.linalg.eigvalsh(fit.covariance - fit_exact(force).covariance)
    assert grown[0] > -1e-9 * grown[-1]
    assert fit.predicted_heading_rms_deg > 1.05 * fit_exact(force).predicted_heading_rms_deg


@pytest.mark.parametrize("shape", ["drift", "jump"])
def test_a_field_that_changes_over_the_run_is_refused_or_in_the_prediction(shape: str) -> None:
    angles = poses_deg()
    data = data_of(angles)
    time = np.linspace(0.0, 1.0, 36)[:, None]
    change = (time if shape == "drift" else (time > 0.5) * 0.5) * [1.0, -0.6, 0.8]
    small = fit_exact(replace(data, field_mg=data.field_mg + 8.0 * change))
    assert small.extra["drift_deg"] > 0.05
    plain = fit_exact(data)
    assert plain.extra["drift_deg"] == 0.0
    assert plain.extra["residual_correlation"] == 0.0
    grown = small.predicted_heading_rms_deg / plain.predicted_heading_rms_deg
    assert grown > np.sqrt(small.chi2_reduced)
    large = fit_exact(replace(data, field_mg=data.field_mg + 100.0 * change))
    assert large.cause in {Cause.FIELD_DISTURBED, Cause.RESIDUAL_TOO_LARGE}


@pytest.mark.parametrize("scale", [1.0, 10.0, 60.0])
def test_no_draw_gives_a_value_that_is_not_finite_or_a_mirror_image(scale: float) -> None:
    for count, tilt in ((8, 10.0), (9, 30.0), (12, 5.0), (12, 90.0)):
        angles = poses_deg(count, tilt, seed=count)
        field, force = readings(angles, units=150, noise=scale)
        fits = tilt_aided_batch(field, force, SD_MG, SD_G, station_field_mg=FIELD)
        assert np.isfinite(fits.covariance).all()
        assert np.isfinite(fits.matrix).all()
        assert (np.linalg.det(fits.matrix) > 0.0).all()
        assert (fits.predicted_rms_deg <= 3.0).all()


def test_shapes_that_do_not_match_are_errors() -> None:
    field, force = readings(poses_deg())
    with pytest.raises(ValueError, match="accel_g must have the shape"):
        tilt_aided_batch(field, force[:, :-1], SD_MG, SD_G)
    with pytest.raises(ValueError, match="field_mg must be finite"):
        tilt_aided_batch(field * np.nan, force, SD_MG, SD_G)
