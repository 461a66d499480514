"""What all methods of a level turn owe: units in a batch as alone, honest sigmas, refusals."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.four_position import fit_four_position, four_position_batch
from bench.calibration.level_kernel import CAUSES
from bench.calibration.level_turn import amplitude_slopes
from bench.calibration.min_max import fit_min_max, min_max_batch
from bench.calibration.ranking import heading_error
from bench.calibration.soft_iron import fit_soft_iron, soft_iron_batch
from bench.calibration.three_headings import fit_three_headings, three_headings_batch

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

SD_MG = 0.5
HEADINGS = np.arange(0.0, 360.0, 15.0)
THIRDS = np.array([0.0, 120.0, 240.0])
METHODS = {
    "min_max": (fit_min_max, min_max_batch, HEADINGS),
    "four_position": (fit_four_position, four_position_batch, np.arange(0.0, 360.0, 90.0)),
    "soft_iron": (fit_soft_iron, soft_iron_batch, HEADINGS),
    "three_headings": (
        fit_three_headings,
        partial(three_headings_batch, heading_deg=THIRDS),
        THIRDS,
    ),
}


@dataclass(frozen=True, kw_only=True)
class Units:
    """Readings of many units at the same headings, and what was put into them."""

    field_mg: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    amplitude_mg: NDArray[np.float64]
    index_deg: NDArray[np.float64]
    back: NDArray[np.float64]


def units_of(method: str, count: int, *, seed: int = 1, sd_mg: float = SD_MG) -> Units:
    """Return units with the errors that the method can take out, and hard iron."""
    rng = np.random.default_rng(seed)
    heading = np.deg2rad(METHODS[method][2])
    offset, amplitude = rng.normal(0.0, 80.0, (count, 2)), rng.uniform(220.0, 280.0, (count, 2))
    index_deg, sensor = np.zeros(count), np.eye(2) * amplitude[:, None, :]
    if method == "three_headings":
        index_deg = rng.normal(0.0, 3.0, count)
        amplitude[:, 1] = amplitude[:, 0]
        c, s = np.cos(np.deg2rad(index_deg)), np.sin(np.deg2rad(index_deg))
        turn_back = np.moveaxis(np.array([[c, s], [-s, c]]), -1, 0)
        sensor = turn_back * amplitude[:, :1, None]
    if method == "soft_iron":
        iron = rng.normal(0.0, 12.0, (count, 2, 2))
        sensor = sensor + iron + np.swapaxes(iron, 1, 2)
    circle = np.stack([np.cos(heading), -np.sin(heading)], axis=-1)
    field = offset[:, None] + np.einsum("nij,kj->nki", sensor, circle)
    field += rng.normal(0.0, 1.0, field.shape) * sd_mg
    return Units(
        field_mg=field,
        offset_mg=offset,
        amplitude_mg=amplitude,
        index_deg=index_deg,
        back=np.linalg.inv(sensor),
    )


def data_of(method: str, field_mg: NDArray[np.float64], **known: object) -> CalibrationData:
    with_z = np.insert(field_mg, 2, 433.0, axis=1)
    data = CalibrationData(field_mg=with_z, azimuth_deg=METHODS[method][2], field_sd_mg=SD_MG)
    return replace(data, **known)


@pytest.mark.parametrize("method", METHODS)
def test_parameters_lie_within_their_covariance(method: str) -> None:
    truth = units_of(method, 3000)
    fits = METHODS[method][1](truth.field_mg, field_sd_mg=SD_MG, horizontal_mg=250.0)
    last = {
        "three_headings": [truth.amplitude_mg[:, 0], truth.index_deg],
        "soft_iron": [250.0 * truth.back[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1))],
    }.get(method, [*truth.amplitude_mg.T])
    if method == "three_headings":
        found = [fits.gain_mg, fits.index_deg]
    elif method == "soft_iron":
        found = [fits.matrix[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1))]
    else:
        found = [*fits.amplitude_mg.T]
    errors = np.column_stack([fits.offset_mg - truth.offset_mg, np.subtract(found, last).T])
    sigma = np.sqrt(np.diagonal(fits.covariance, axis1=-2, axis2=-1))
    assert not fits.cause.any()
    inside = (np.abs(errors) < 2.0 * sigma).mean(axis=0)
    assert (inside > 0.94).all()
    assert (np.abs(errors).mean(axis=0) > 0.4 * sigma.mean(axis=0)).all()


@pytest.mark.parametrize("method", METHODS)
def test_predicted_heading_error_is_the_one_achieved(method: str) -> None:
    truth = units_of(method, 60, seed=2)
    exact = units_of(method, 60, seed=2, sd_mg=0.0)
    predicted, achieved = [], []
    for noisy_mg, clean_mg in zip(truth.field_mg, exact.field_mg, strict=True):
        fit = METHODS[method][0](data_of(method, noisy_mg))
        predicted.append(fit.predicted_heading_rms_deg)
        achieved.append(heading_error(data_of(method, clean_mg), fit).rms_deg)
    ratio = np.sqrt(np.mean(np.square(achieved))) / np.sqrt(np.mean(np.square(predicted)))
    assert 0.6 < ratio < 1.25


@pytest.mark.parametrize("method", METHODS)
def test_a_fit_without_noise_leaves_no_heading_error(method: str) -> None:
    for field_mg in units_of(method, 10, sd_mg=0.0).field_mg:
        data = data_of(method, field_mg)
        assert heading_error(data, None).max_deg > 1.0
        assert heading_error(data, METHODS[method][0](data)).max_deg < 1e-6


@pytest.mark.parametrize("method", METHODS)
def test_units_in_a_batch_are_fitted_as_alone(method: str) -> None:
    field_mg = units_of(method, 12, seed=3).field_mg.copy()
    field_mg[3] = 5.0
    field_mg[4, :, 0] = field_mg[4, :, 1]
    field_mg[5] = 1e9
    field_mg[6] = np.random.default_rng(4).normal(0.0, 200.0, field_mg[6].shape)
    kernel = METHODS[method][1]
    batch = kernel(field_mg.reshape(3, 4, -1, 2), field_sd_mg=SD_MG)
    assert (batch.cause.ravel()[3:7] != 0).all()
    for unit, one_mg in enumerate(field_mg):
        alone = kernel(one_mg, field_sd_mg=SD_MG)
        for name in (entry.name for entry in fields(alone)):
            together = getattr(batch, name)[unit // 4, unit % 4]
            np.testing.assert_allclose(together, getattr(alone, name), rtol=1e-6, atol=1e-9)


def awkward_mg(name: str, count: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(5)
    step = np.arange(count)[:, None]
    return {
        "zero": np.zeros((count, 2)),
        "constant": np.full((count, 2), 123.4),
        "two points": np.where(step % 2, [100.0, 0.0], [-100.0, 50.0]),
        "two far points": np.where(step % 2, [1e6, 0.0], [-1e6, 0.0]),
        "line": step * np.array([[30.0, 20.0]]) - 100.0,
        "one axis": np.column_stack([250.0 * np.cos(step[:, 0]), np.zeros(count)]),
        "huge": rng.normal(0.0, 1e300, (count, 2)),
        "tiny": rng.normal(0.0, 1e-300, (count, 2)),
        "noise": rng.normal(0.0, SD_MG, (count, 2)),
        "one outlier": np.vstack([np.full((count - 1, 2), 1.0), [[1e6, -1e6]]]),
    }[name]


AWKWARD = (
    "zero", "constant", "two points", "two far points", "line", "one axis", "huge", "tiny",
    "noise", "one outlier",
)  # fmt: skip


@pytest.mark.parametrize("name", AWKWARD)
@pytest.mark.parametrize("method", METHODS)
def test_awkward_readings_are_refused_with_a_sentence_and_never_a_nan(
    method: str, name: str
) -> None:
    field_mg = awkward_mg(name, len(METHODS[method][2]))
    fits = METHODS[method][1](field_mg, field_sd_mg=SD_MG)
    assert all(np.isfinite(getattr(fits, entry.name)).all() for entry in fields(fits))
    assert CAUSES[fits.cause] is not None
    assert fits.offset_mg.tolist() == [0.0, 0.0]
    assert fits.matrix.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    fit = METHODS[method][0](data_of(method, field_mg))
    assert fit.refused
    assert fit.message
    assert (fit.offset_mg, fit.matrix, fit.covariance) == (None, None, None)


@pytest.mark.parametrize("method", METHODS)
def test_unusable_arrays_are_named(method: str) -> None:
    kernel = METHODS[method][1]
    count = len(METHODS[method][2])
    for bad in (np.zeros((count, 3)), np.zeros((2, 2)), np.full((count, 2), np.nan)):
        with pytest.raises(ValueError, match="field_mg must"):
            kernel(bad, field_sd_mg=SD_MG)


def turn_data(**known: object) -> CalibrationData:
    """Return 24 headings there and back in one field, hard iron (90, -40) mG."""
    azimuth = np.concatenate([HEADINGS, HEADINGS[::-1]])
    turn = np.deg2rad(azimuth)
    field = np.column_stack([90 + 250 * np.cos(turn), -40 - 250 * np.sin(turn), 433 + 0 * turn])
    data = CalibrationData(field_mg=field, azimuth_deg=azimuth, field_sd_mg=SD_MG)
    return replace(data, **known)


@pytest.mark.parametrize("method", METHODS)
def test_a_field_that_changes_after_the_turn_is_seen_when_the_rig_comes_back(method: str) -> None:
    field_mg = turn_data().field_mg.copy()
    field_mg[30:] += [20.0, 0.0, 0.0]
    fit = METHODS[method][0](turn_data(field_mg=field_mg))
    assert fit.cause == Cause.FIELD_DISTURBED
    assert "field changed" in fit.message
    assert METHODS[method][0](turn_data()).cause is None


@pytest.mark.parametrize("fit_of", [fit_min_max, fit_soft_iron])
@pytest.mark.parametrize("change", [(20.0, 0.0), (-11.0, 17.0)])
def test_a_field_that_changes_between_two_turns_is_seen_without_azimuths(
    fit_of: Callable[..., object], change: tuple[float, float]
) -> None:
    field_mg = turn_data().field_mg.copy()
    field_mg[24:, :2] += change
    assert fit_of(turn_data(field_mg=field_mg, azimuth_deg=None)).cause == Cause.FIELD_DISTURBED
    assert fit_of(turn_data(azimuth_deg=None)).cause is None


@pytest.mark.parametrize("fit_of", [fit_min_max, fit_soft_iron])
@pytest.mark.parametrize("east_mg", [-60.0, -20.0, 20.0, 60.0])
def test_a_field_that_changes_half_way_through_one_turn_is_seen_by_the_azimuths(
    fit_of: Callable[..., object], east_mg: float
) -> None:
    """The readings make a good ellipse: 20 mG of 250 leave less than 2 % of residual."""
    turn = np.deg2rad(HEADINGS)
    field_mg = turn_data().field_mg[:24].copy()
    field_mg[12:, 0] += east_mg * np.sin(turn[12:])
    field_mg[12:, 1] += east_mg * np.cos(turn[12:])
    fit = fit_of(turn_data(field_mg=field_mg, azimuth_deg=HEADINGS))
    assert fit.cause == Cause.FIELD_DISTURBED


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_at_its_end_is_saturated(method: str, axis: int) -> None:
    limit_mg = np.full(3, 1e4)
    limit_mg[axis] = 150.0
    field_mg = np.minimum(turn_data().field_mg, limit_mg)
    fit = METHODS[method][0](turn_data(field_mg=field_mg))
    assert fit.cause == Cause.SATURATED
    assert "saturated" in fit.message


@pytest.mark.parametrize("method", METHODS)
def test_tilted_rows_do_not_count(method: str, drawn: Callable[..., object]) -> None:
    data = drawn(1, soft=0.02).data
    level = METHODS[method][0](data)
    assert level.samples == {"four_position": 4, "three_headings": 3}.get(method, 48)
    tilted = replace(data, pitch_deg=np.full(72, 20.0))
    assert METHODS[method][0](tilted).cause == Cause.TOO_FEW


def test_slopes_of_the_amplitude_matrix_are_its_derivatives() -> None:
    amplitude, step = np.array([[220.0, 280.0], [250.0, 240.0]]), np.diag([1e-3, 1e-3])
    slopes = amplitude_slopes(np.eye(2) * (250.0 / amplitude)[:, None, :], amplitude)
    assert not slopes[:, :2].any()
    for axis in range(2):
        high, low = (np.eye(2) * (250.0 / (amplitude + s * step[axis]))[:, None] for s in (1, -1))
        assert slopes[:, 2 + axis] == pytest.approx((high - low) / 2e-3, rel=1e-6)
