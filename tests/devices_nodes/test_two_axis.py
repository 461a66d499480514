"""The module with two axes: its formula against a rotation in double precision, and its bank."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from devices.firmware import Converters
from devices.two_axis import TwoAxisFormula, completed
from protocols import compass, uds
from protocols.uds import DEFAULT_COEFFICIENTS, Coefficients, pack_coefficients

CONVERTERS = Converters(mag_mg_per_count=1600.0 / 65536.0)
MG, G = CONVERTERS.mag_mg_per_count, CONVERTERS.accel_g_per_count
H_MG, DIP_DEG = 250.0, 60.0
IDEAL = (np.eye(3), np.zeros(3))
WRITTEN = replace(DEFAULT_COEFFICIENTS, extended_dip_deg=DIP_DEG, horizontal_mg=H_MG)


def counts_at(attitude_deg, mag=IDEAL, accel=IDEAL):
    """Return (set - reset, force) in counts; a sensor reads matrix @ (vector in body) + offset."""
    ned_from_body = Rotation.from_euler("ZYX", attitude_deg, degrees=True).as_matrix()
    field = ned_from_body.T @ (H_MG, 0.0, H_MG * math.tan(math.radians(DIP_DEG)))
    force = ned_from_body.T @ (0.0, 0.0, -1.0)
    difference = np.rint(2.0 * (mag[0] @ field + mag[1]) / MG)
    shown = np.rint((accel[0] @ force + accel[1]) / G)
    return tuple(map(int, difference)), completed(tuple(map(int, shown)), G)


def wrapped(difference_deg):
    return (difference_deg + 180.0) % 360.0 - 180.0


@pytest.mark.parametrize("azimuth", [0, 45, 90, 135, 180, 225, 270, 315, 359])
@pytest.mark.parametrize(
    ("pitch", "roll"), [(0, 0), (30, 0), (-30, 0), (0, 30), (0, -30), (25, 40), (-40, -25)]
)
def test_two_axes_and_the_dip_show_the_attitude_that_the_module_is_held_at(azimuth, pitch, roll):
    difference, force = counts_at((azimuth, pitch, roll))
    formula = TwoAxisFormula(WRITTEN, CONVERTERS)

    solution = formula.solve(difference, force)

    assert solution is not None
    assert wrapped(solution[0] - azimuth) == pytest.approx(0.0, abs=0.02)
    assert solution[1:] == pytest.approx((pitch, roll), abs=0.01)
    assert formula.solve((*difference[:2], -5 * difference[2]), force) == solution, "z is not read"


def test_coefficients_are_taken_out_before_the_formula(rng):
    mag = np.eye(3)
    mag[:2, :2] += rng.normal(0.0, 0.05, (2, 2))
    accel = np.diag((1.02, 0.97, 1.0))
    mag_offset, accel_offset = np.array((90.0, -70.0, 33.0)), np.array((0.03, -0.02, 0.0))
    formula = TwoAxisFormula(
        Coefficients(
            version=1,
            mag_offset_mg=tuple(mag_offset),
            mag_matrix=tuple(np.linalg.inv(mag).ravel()),
            accel_offset_g=tuple(accel_offset),
            accel_matrix=tuple(np.linalg.inv(accel).ravel()),
            extended_dip_deg=DIP_DEG,
            horizontal_mg=H_MG,
        ),
        CONVERTERS,
    )
    for _ in range(200):
        attitude = rng.uniform((0, -40, -40), (360, 40, 40))
        solution = formula.solve(*counts_at(attitude, (mag, mag_offset), (accel, accel_offset)))

        assert wrapped(solution[0] - attitude[0]) == pytest.approx(0.0, abs=0.03)
        assert solution[1:] == pytest.approx(attitude[1:], abs=0.01)


def test_a_part_of_z_in_the_matrix_is_not_used():
    matrix = np.eye(3)
    matrix[:2, 2] = 0.3
    formula = TwoAxisFormula(replace(WRITTEN, mag_matrix=tuple(matrix.ravel())), CONVERTERS)

    assert formula.solve(*counts_at((70.0, 20.0, 0.0)))[0] == pytest.approx(70.0, abs=0.02)


def test_without_a_dip_the_heading_is_right_level_and_wrong_by_the_vertical_field_tilted():
    formula = TwoAxisFormula(DEFAULT_COEFFICIENTS, CONVERTERS)

    level, tilted = (formula.solve(*counts_at((90.0, pitch, 0.0)))[0] for pitch in (0.0, 20.0))

    assert level == pytest.approx(90.0, abs=0.02)
    # north of the levelled field: Z sin(theta) is missing, and Z was taken as X tan(theta)
    z_error = 0.0 - H_MG * math.tan(math.radians(DIP_DEG)) / math.cos(math.radians(20.0))
    north = z_error * math.sin(math.radians(20.0))
    assert wrapped(tilted - math.degrees(math.atan2(H_MG, north))) == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("force", [(16384, 0, 0), (-17000, 0, 0), (0, 16384, 0), (12000, 12000, 0)])
def test_beyond_the_tilts_of_the_formula_there_is_no_heading(force):
    assert TwoAxisFormula(WRITTEN, CONVERTERS).solve((2000, 0, 4000), completed(force, G)) is None


@pytest.mark.parametrize(
    ("shown", "z"),
    [((0, 0, 5), -16384), ((8192, 0, 0), -14189), ((9830, 9830, 1), -8671), ((16384, 99, 7), 0)],
)
def test_the_third_force_is_completed_to_one_g(shown, z):
    assert completed(shown, G) == (*shown[:2], z)


def status_of(station):
    frames = [f for f in station.tick(10) if f.can_id == compass.status_id(0x80)]
    return compass.unpack_status(frames[-1].data)


def qualities(station):
    frames = [f for f in station.tick(5) if f.can_id == compass.heading_id(0x80)]
    return {compass.unpack_heading(f.data).quality for f in frames}


def write(station, coefficients):
    station.unlock()
    answer = station.request(b"\x2e\x01\x01" + pack_coefficients(coefficients))
    if answer[0] == 0x6E:
        assert station.request(b"\x31\x01\x02\x02")[0] == 0x71
        assert station.request(b"\x11\x01")[0] == 0x51
        station.tick(40)
    return answer


def test_the_part_says_what_it_is(make_station):
    station = make_station(part="CB-AMR2")
    station.tick(40)

    assert station.request(b"\x22\xf1\x87") == b"\x62\xf1\x87CB-AMR2"
    flags = compass.FLAG_TWO_AXIS | compass.FLAG_DEFAULT_COEFFICIENTS
    assert status_of(station).flags == flags
    assert qualities(station) == {compass.QUALITY_UNCALIBRATED}


def test_coefficients_without_the_dip_do_not_make_it_calibrated(make_station):
    station = make_station(part="CB-AMR2")
    station.tick(40)

    write(station, replace(DEFAULT_COEFFICIENTS, version=1))
    assert status_of(station).flags == compass.FLAG_TWO_AXIS
    assert qualities(station) == {compass.QUALITY_UNCALIBRATED}

    write(station, replace(WRITTEN, version=2))
    assert qualities(station) == {compass.QUALITY_CALIBRATED}


def test_three_axes_refuse_a_bank_for_two_and_keep_theirs(booted):
    answer = write(booted, WRITTEN)

    assert answer == b"\x7f\x2e\x31"
    assert booted.request(b"\x22\x01\x00")[3:] == pack_coefficients(DEFAULT_COEFFICIENTS)


def test_three_axes_with_a_memory_of_two_do_not_pass_for_calibrated(make_station, tmp_path):
    nvm = tmp_path / "module.nvm"
    first = make_station(part="CB-AMR2", nvm=nvm)
    first.tick(40)
    write(first, WRITTEN)
    second = make_station(nvm=nvm)
    second.tick(60)

    assert qualities(second) == {compass.QUALITY_UNCALIBRATED}


def test_the_cycle_on_the_wire_has_a_completed_force_and_a_measured_z(make_station):
    station = make_station(part="CB-AMR2")
    station.tick(40)
    frames = station.tick(50)
    force = [
        compass.unpack_counts(f.data) for f in frames if f.can_id == compass.acceleration_id(0x80)
    ]
    z = [compass.unpack_counts(f.data)[2] for f in frames if f.can_id == compass.mag_set_id(0x80)]

    assert all(one == completed(one, G) for one in force)
    assert len(set(force)) > 10
    assert 300.0 < np.mean(z) * compass.MAG_MG_PER_COUNT < 560.0
    assert len(set(z)) > 1


def test_a_recording_is_sent_with_a_completed_force_too(make_station, tmp_path):
    recording = tmp_path / "recording.csv"
    recording.write_text("mx,my,mz,ax,ay,az\n100,50,400,0.5,0,0.25\n")
    station = make_station(part="CB-AMR2", replay=recording)
    frames = station.tick(40)
    force = next(f for f in frames if f.can_id == compass.acceleration_id(0x80))

    assert compass.unpack_counts(force.data) == (8192, 0, -14189)


def test_an_unknown_part_is_refused_with_the_parts_that_there_are(make_station):
    with pytest.raises(ValueError, match="must be CB-AMR3 or CB-AMR2; instead received 'CB-AMR9'"):
        make_station(part="CB-AMR9")


def test_a_nonsense_dip_is_refused_by_the_module(make_station):
    station = make_station(part="CB-AMR2")
    station.tick(40)

    for dip_deg in (90.0, math.nan):
        assert write(station, replace(WRITTEN, extended_dip_deg=dip_deg)) == b"\x7f\x2e\x31"
    assert station.request(b"\x22\x01\x01") == b"\x7f\x22\x22"
    assert uds.unpack_coefficients(station.request(b"\x22\x01\x00")[3:]) == DEFAULT_COEFFICIENTS


@pytest.mark.parametrize("part", ["CB-AMR2", "CB-AMR3"])
@pytest.mark.parametrize(
    "beyond",
    [
        {"mag_matrix": (3e38, 0.0, 0.0, 0.0, 3e38, 0.0, 0.0, 0.0, 3e38)},
        {"accel_matrix": (3e38, 0.0, 0.0, 0.0, 3e38, 0.0, 0.0, 0.0, 3e38)},
        {"mag_offset_mg": (3e38, -3e38, 3e38), "mag_matrix": (9.0,) * 9},
    ],
)
def test_coefficients_whose_products_overflow_leave_a_module_that_still_sends_and_answers(
    make_station, part, beyond
):
    station = make_station(part=part)
    station.tick(40)
    sound = WRITTEN if part == "CB-AMR2" else DEFAULT_COEFFICIENTS

    assert write(station, replace(sound, version=1, **beyond))[0] == 0x6E

    assert len(qualities(station)) == 1
    write(station, replace(sound, version=2))
    assert qualities(station) == {compass.QUALITY_CALIBRATED}
