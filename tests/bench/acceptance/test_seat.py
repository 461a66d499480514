"""What the station knows of the seat is taken out of attitudes, references and offsets."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bench.acceptance.heading_evaluation import evaluate_field_strength
from bench.acceptance.method_comparison import study_of
from bench.acceptance.seat import seat_angles_deg, seat_of
from bench.acceptance.site import (
    calibration_data,
    expected_field_mg,
    expected_force_g,
    field_rig_mg,
    reference_heading_deg,
)
from bench.calibration.fixture import SeatFound
from bench.calibration.methods import fit_named
from bench.calibration.reversal_model import seat_rotation
from bench.calibration.tilt import attitude_deg, heading_deg, ned_from_body
from bench.samples import READING
from protocols.angles import wrap_180_deg
from protocols.uds import DEFAULT_COEFFICIENTS

TURNED = SeatFound(index_deg=0.5, pitch_deg=0.2, roll_deg=-0.1)
IRON = SeatFound(iron_mg=(2.0, -2.0, 1.0))
BOTH = SeatFound(index_deg=0.5, pitch_deg=0.2, roll_deg=-0.1, iron_mg=(2.0, -2.0, 1.0))
GAIN = np.array([[1.1, 0.08, -0.05], [0.06, 0.9, 0.04], [-0.03, 0.05, 1.0]])
HARD_IRON_MG = np.array([90.0, -60.0, 40.0])
POSES = [(15.0 * k, 0.0, 0.0) for k in range(24)] + [
    (60.0 * k + 10.0, pitch, roll)
    for pitch, roll in ((30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -30.0))
    for k in range(6)
]


def site_with(seat):
    return SimpleNamespace(horizontal_mg=250.0, dip_deg=60.0, field_azimuth_deg=3.0, seat=seat)


def readings_in(seat):
    """Return what a unit with iron and soft iron of its own reads in a seat, without noise."""
    angles = np.array(POSES)
    readings = np.zeros(len(POSES), dtype=READING)
    for axis, name in enumerate(("rig_azimuth_deg", "rig_pitch_deg", "rig_roll_deg")):
        readings[name] = angles[:, axis]
    readings["position"] = np.arange(len(POSES))
    turns = ned_from_body(*angles.T) @ seat_rotation(seat.index_deg, seat.pitch_deg, seat.roll_deg)
    field_mg = np.swapaxes(turns, 1, 2) @ field_rig_mg(site_with(seat)) + np.array(seat.iron_mg)
    readings["field_mg"] = field_mg @ GAIN.T + HARD_IRON_MG
    readings["accel_g"] = -turns[:, 2, :]
    return readings


def test_a_square_seat_without_iron_changes_no_bit():
    readings = readings_in(SeatFound())
    site = site_with(SeatFound())

    data = calibration_data(readings, site)

    assert np.array_equal(data.azimuth_deg, readings["rig_azimuth_deg"])
    assert np.array_equal(data.roll_deg, readings["rig_roll_deg"])
    assert data.fixture_mg is None
    assert np.array_equal(
        reference_heading_deg(readings, site), np.mod(readings["rig_azimuth_deg"] - 3.0, 360.0)
    )


def test_a_record_of_before_the_seat_counts_as_square():
    assert seat_of({}) == SeatFound()
    assert seat_of({"index_deg": 0.5, "iron_mg": [1.0, 0.0, 0.0]}).iron_mg == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("seat", [TURNED, IRON, BOTH])
def test_the_reference_is_the_heading_of_a_perfect_module_in_the_seat(seat):
    readings = readings_in(seat)
    site = site_with(seat)
    perfect = expected_field_mg(readings, site)

    pitch_deg, roll_deg = attitude_deg(expected_force_g(readings, seat))
    sent_deg = heading_deg(perfect, pitch_deg, roll_deg)

    assert wrap_180_deg(reference_heading_deg(readings, site) - sent_deg) == pytest.approx(
        0.0, abs=1e-9
    )
    assert expected_force_g(readings, seat) == pytest.approx(readings["accel_g"])


def test_a_level_seat_points_to_azimuth_and_index_and_keeps_whole_turns():
    readings = readings_in(SeatFound())[:3]
    readings["rig_azimuth_deg"] = [359.9, 360.2, -725.0]

    azimuth_deg, pitch_deg, roll_deg = seat_angles_deg(readings, SeatFound(index_deg=0.5))

    assert azimuth_deg == pytest.approx([360.4, 360.7, -724.5])
    assert np.abs(np.concatenate([pitch_deg, roll_deg])).max() < 1e-9


@pytest.mark.parametrize("seat", [TURNED, IRON, BOTH])
def test_the_truth_aided_fit_finds_the_unit_without_seat_and_fixture(seat):
    fit = fit_named("truth_aided", calibration_data(readings_in(seat), site_with(seat)))

    assert np.linalg.inv(fit.matrix) == pytest.approx(GAIN, abs=1e-6)
    assert fit.offset_mg == pytest.approx(HARD_IRON_MG, abs=1e-4)
    assert fit.extra["field_azimuth_deg"] == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize(
    ("method", "left_mg"),
    [("ellipsoid", 0.06), ("tilt_aided", 0.005), ("truth_aided", 1e-6)],  # it knows no rotation
)
def test_every_method_over_tilts_takes_the_fixtures_iron_out_of_its_offset(method, left_mg):
    free = fit_named(method, calibration_data(readings_in(SeatFound()), site_with(SeatFound())))
    held = fit_named(method, calibration_data(readings_in(IRON), site_with(IRON)))

    assert held.offset_mg == pytest.approx(free.offset_mg, abs=left_mg)
    assert held.matrix == pytest.approx(free.matrix, abs=1e-4)


@pytest.mark.parametrize("method", ["min_max", "four_position", "soft_iron"])
def test_level_methods_come_as_near_as_their_own_matrix_allows(method):
    level = slice(0, 24)
    free = fit_named(
        method, calibration_data(readings_in(SeatFound())[level], site_with(SeatFound()))
    )
    held = fit_named(method, calibration_data(readings_in(IRON)[level], site_with(IRON)))

    assert held.offset_mg[:2] == pytest.approx(free.offset_mg[:2], abs=0.6)


def test_a_seat_that_the_station_does_not_know_becomes_the_units_error():
    readings = readings_in(BOTH)
    fit = fit_named("truth_aided", calibration_data(readings, site_with(SeatFound())))

    free_mg = readings_in(SeatFound())["field_mg"]
    sent_deg = heading_deg(fit.corrected_mg(free_mg[:24]), 0.0, 0.0)
    error_deg = wrap_180_deg(sent_deg - (np.arange(24) * 15.0 - 3.0))

    assert abs(error_deg.mean()) == pytest.approx(0.5, abs=0.02)
    assert np.ptp(error_deg) / 2.0 == pytest.approx(np.rad2deg(np.hypot(2.0, 2.0) / 250.0), rel=0.1)


def test_the_comparison_of_methods_holds_them_against_the_perfect_module():
    readings, site = readings_in(BOTH), site_with(BOTH)
    fits = {"truth_aided": fit_named("truth_aided", calibration_data(readings, site))}

    compared = study_of(fits, readings, site)

    assert compared.orders["truth_aided"]["body"].level_max_deg < 1e-3
    assert compared.orders["truth_aided"]["body"].tilt_max_deg < 1e-3


def test_the_strength_is_held_against_that_of_station_and_fixture():
    strong = SeatFound(iron_mg=(0.0, 0.0, 10.0))
    readings = readings_in(strong)
    readings["field_mg"] = expected_field_mg(readings, site_with(strong))

    (known,) = evaluate_field_strength("v", readings, DEFAULT_COEFFICIENTS, site_with(strong))
    (unknown,) = evaluate_field_strength(
        "v", readings, DEFAULT_COEFFICIENTS, site_with(SeatFound())
    )

    assert known.value < 1e-9
    assert unknown.value > 1.0
