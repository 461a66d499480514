"""Heading errors that the unit's model expects of every method, against those of drawn units."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.expectation import (
    CLAIM_WITHOUT,
    UNIT_MODEL,
    expectation,
    expected_errors,
    largest_deg,
    unit_readings,
)
from bench.calibration.fit import Cause, refusal, rows_of
from bench.calibration.methods import METHODS, fit_all
from bench.calibration.ranking import borrowed_tilt, heading_errors_deg, study
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit

UNITS = 12
TILTS = ((30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -30.0))


def verification_deg() -> NDArray[np.float64]:
    """24 headings level and 4 at each of four tilts, between those of the end of line."""
    level = [(heading + 7.5, 0.0, 0.0) for heading in range(0, 360, 15)]
    tilted = [
        (heading + 22.5 + 15.0 * index, pitch, roll)
        for index, (pitch, roll) in enumerate(TILTS)
        for heading in range(0, 360, 90)
    ]
    return np.array([*level, *tilted])


def unit_of(
    drawn: Callable[..., Any], seed: int, eol_deg: NDArray[np.float64], **sizes: float
) -> tuple[CalibrationData, CalibrationData]:
    """Return calibration and verification readings of one drawn unit."""
    angles_deg = np.vstack([eol_deg, verification_deg()])
    data = drawn(seed, angles_deg, soft=0.03, **sizes).data
    first = np.arange(len(data)) < len(eol_deg)
    return rows_of(data, first), rows_of(data, ~first)


@pytest.fixture(scope="module")
def eol_poses_deg() -> NDArray[np.float64]:
    level = [(heading, 0.0, 0.0) for heading in range(0, 360, 15)]
    tilted = [
        (heading + 15.0 * index, pitch, roll)
        for index, (pitch, roll) in enumerate(TILTS)
        for heading in range(0, 360, 60)
    ]
    return np.array([*level, *reversed(level), *tilted], dtype=float)


@pytest.fixture(scope="module")
def units(
    drawn: Callable[..., Any], eol_poses_deg: NDArray[np.float64]
) -> list[tuple[dict[str, Fit], CalibrationData]]:
    pairs = (unit_of(drawn, seed, eol_poses_deg) for seed in range(UNITS))
    return [(fit_all(calibration), verification) for calibration, verification in pairs]


def test_given_no_noise_the_expected_error_of_every_method_is_the_achieved_one(
    drawn: Callable[..., Any], eol_poses_deg: NDArray[np.float64]
) -> None:
    none = {"field_sd_mg": 0.0, "accel_sd_g": 0.0, "rig_sd_deg": 0.0}
    calibration, verification = unit_of(drawn, 3, eol_poses_deg, **none)
    fits = fit_all(calibration)

    found = expected_errors(fits, verification)

    assert found is not None
    assert len(found) >= 9
    for name, expected in found.items():
        fit = fits.get(name)
        tilt = borrowed_tilt(fit, fits, verification)[1]
        achieved_deg = heading_errors_deg(verification, fit, tilt=tilt)
        assert expected.mean_deg == pytest.approx(achieved_deg, abs=1e-5), name


def test_achieved_errors_scatter_about_the_expected_ones_as_their_sd_says(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    scores: dict[str, list[float]] = {}
    for fits, data in units:
        for name, expected in (expected_errors(fits, data) or {}).items():
            fit = fits.get(name)
            achieved_deg = heading_errors_deg(data, fit, tilt=borrowed_tilt(fit, fits, data)[1])
            score = (achieved_deg - expected.mean_deg) / expected.sd_deg
            scores.setdefault(name, []).extend(score)

    assert {"raw", "min_max", "ellipsoid", "tilt_aided", UNIT_MODEL} <= scores.keys()
    for name, values in scores.items():
        rms = float(np.sqrt(np.mean(np.square(values))))
        spread = 1.0 / np.sqrt(2.0 * len(values))
        # a rig angle's error is counted in both sensors, though the heading feels it once
        assert 0.85 - 4.0 * spread < rms < 1.0 + 4.0 * spread, (name, rms)


def test_what_is_not_known_of_the_unit_adds_to_the_noise_as_squares(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]
    unit = fits[UNIT_MODEL]
    assert unit.covariance is not None
    doubtful = {**fits, UNIT_MODEL: replace(unit, covariance=4.0 * unit.covariance)}

    found, more = expected_errors(fits, data), expected_errors(doubtful, data)

    assert found is not None
    assert more is not None
    for name in fits.keys() & found.keys():
        by_unit = found[name].sd_deg ** 2 - found[name].noise_sd_deg ** 2
        assert by_unit.max() > 0.0, name
        more_by_unit = more[name].sd_deg ** 2 - more[name].noise_sd_deg ** 2
        assert more_by_unit == pytest.approx(4.0 * by_unit, rel=1e-6, abs=1e-12), name


def test_the_readings_to_expect_in_a_fixture_hold_its_iron_through_the_units_own_gain(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]
    unit, iron_mg = fits[UNIT_MODEL], np.array([2.0, -1.5, 1.0])
    assert unit.matrix is not None

    held = (
        unit_readings(unit, replace(data, fixture_mg=iron_mg)).raw - unit_readings(unit, data).raw
    )

    expected_mg = np.broadcast_to(np.linalg.inv(unit.matrix) @ iron_mg, held[:, :3].shape)
    assert held[:, :3] == pytest.approx(expected_mg)
    assert held[:, 3:] == pytest.approx(0.0)


def test_expected_over_achieved_is_near_one_level_and_tilted(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    sums: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for fits, data in units:
        expected, achieved = expectation(fits, data), study(fits, data)
        assert expected is not None
        for name, errors in expected.errors.items():
            found = achieved.raw if name == "raw" else achieved.orders[name]["body"]
            for key in ("level_rms_deg", "tilt_rms_deg", "level_max_deg", "tilt_max_deg"):
                pair = (getattr(errors, key), getattr(found, key))
                sums.setdefault((name, key), []).append(pair)

    for key, pairs in sums.items():
        expected_deg, achieved_deg = np.sqrt((np.array(pairs) ** 2).sum(axis=0))
        assert 0.85 < expected_deg / achieved_deg < 1.25, key


def test_the_readings_of_the_verification_take_no_part(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]
    assert data.accel_g is not None
    other = replace(data, field_mg=np.zeros_like(data.field_mg), accel_g=data.accel_g + 1.0)

    assert expectation(fits, other) == expectation(fits, data)


def test_a_zero_that_moves_on_makes_the_level_heading_uncertain_by_the_tangent_of_the_dip(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]
    assert data.station_field_mg is not None
    before, after = (expected_errors(fits, data, change_g) for change_g in (0.0, 0.0003))
    assert before is not None
    assert after is not None

    level = slice(0, 24)
    more = after[UNIT_MODEL].sd_deg[level] ** 2 - before[UNIT_MODEL].sd_deg[level] ** 2
    tangent = data.station_field_mg[2] / np.hypot(*data.station_field_mg[:2])
    assert np.sqrt(more) == pytest.approx(np.rad2deg(0.0003) * tangent, rel=0.1)
    assert after[UNIT_MODEL].noise_sd_deg == pytest.approx(before[UNIT_MODEL].noise_sd_deg)


def test_a_field_azimuth_that_the_station_has_wrong_is_expected_as_an_error_of_all(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]
    assert data.station_field_mg is not None
    before = expected_errors(fits, data)

    turned = ned_from_body(0.3, 0.0, 0.0) @ data.station_field_mg
    after = expected_errors(fits, replace(data, station_field_mg=turned))

    assert before is not None
    assert after is not None
    for name, expected in after.items():
        shift_deg = expected.mean_deg - before[name].mean_deg
        assert shift_deg == pytest.approx(np.full(len(data), 0.3), abs=1e-9), name


def test_with_the_tilt_given_the_force_takes_no_part(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]
    given = replace(data, accel_g=None)
    achieved = study(fits, given)

    found = expectation(fits, given)

    assert found is not None
    for name in ("min_max", "soft_iron", "ellipsoid"):
        expected_deg = found.errors[name].tilt_rms_deg
        assert expected_deg == pytest.approx(achieved.orders[name]["body"].tilt_rms_deg, rel=0.15)


def test_the_cross_axis_term_that_the_fits_know_is_in_the_readings_and_out_of_the_errors(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]
    hk_mg = np.array([8000.0, 8000.0, 8000.0])
    knowing = {name: replace(fit, hk_mg=hk_mg) for name, fit in fits.items()}

    plain, crossed = expected_errors(fits, data), expected_errors(knowing, data)

    raw_mg = unit_readings(fits[UNIT_MODEL], data).raw[:, :3]
    assert np.abs(unit_readings(knowing[UNIT_MODEL], data).raw[:, :3] - raw_mg).max() > 0.3
    assert plain is not None
    assert crossed is not None
    assert np.abs(crossed["raw"].mean_deg - plain["raw"].mean_deg).max() > 0.01
    for name in fits.keys() & plain.keys():
        assert crossed[name].mean_deg == pytest.approx(plain[name].mean_deg, abs=1e-6), name


def test_without_a_model_of_the_unit_nothing_is_expected(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]
    refused = refusal(UNIT_MODEL, Cause.DEGENERATE, "an axis is stuck", data)
    others = {name: fit for name, fit in fits.items() if name != UNIT_MODEL}
    forceless = replace(fits[UNIT_MODEL], accel_matrix=None, accel_offset_g=None)

    assert expectation(others, data) is None
    assert expectation({**others, UNIT_MODEL: refused}, data) is None
    assert expectation({**others, UNIT_MODEL: forceless}, data) is None
    assert expectation(fits, replace(data, azimuth_deg=None)) is None


def test_level_poses_alone_have_no_tilted_expectation_and_all_is_json(
    units: list[tuple[dict[str, Fit], CalibrationData]],
) -> None:
    fits, data = units[0]

    found = expectation(fits, rows_of(data, np.arange(len(data)) < 24))

    assert found is not None
    assert found.noise.tilt_deg is None
    assert all(errors.tilt_max_deg is None for errors in found.errors.values())
    plain = found.as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain


def test_the_mean_of_the_largest_error_is_that_of_many_draws() -> None:
    rng = np.random.default_rng(5)
    mean_deg, sd_deg = rng.normal(0.0, 0.2, 24), rng.uniform(0.05, 0.2, 24)
    draws = np.abs(rng.normal(mean_deg, sd_deg, (20_000, 24))).max(axis=1)

    found_deg = largest_deg(mean_deg, sd_deg)

    assert abs(found_deg - draws.mean()) < 4.0 * draws.std() / np.sqrt(len(draws)) + 1e-4


def test_every_method_says_what_its_claim_leaves_out() -> None:
    assert CLAIM_WITHOUT.keys() == METHODS.keys()
