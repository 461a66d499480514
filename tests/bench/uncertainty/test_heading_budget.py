"""The budget of a heading error against what a hand computes and what a simulation scatters."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.fit import Fit
from bench.station import Seat, Surroundings, load_station
from bench.uncertainty.heading_budget import heading_budget
from bench.uncertainty.seat_heading import ned_from_seat
from bench.uncertainty.unit_data import UnitData
from protocols.angles import wrap_180_deg

DEG_A_MG = np.rad2deg(1.0 / 250.0)
"""Heading by a field square to the horizontal field, 250 mG."""
LEVEL = [(15.0 * k, 0.0, 0.0) for k in range(24)]
TILTED = [(20.0, 30.0, 0.0), (110.0, -30.0, 0.0), (200.0, 0.0, 30.0), (290.0, 20.0, -20.0)]


def test_a_level_budget_is_that_of_a_hand(budget):
    found = budget(
        [(0.0, 0.0, 0.0)],
        u_field_azimuth_deg=0.05,
        seat=Seat(u_index_deg=0.04, u_iron_mg=0.05),
        surroundings=Surroundings(
            u_one_cycle_deg=0.023, u_two_cycle_deg=0.023, u_fine_deg=0.023, u_drift_mg=0.1
        ),
        unit=UnitData(repeatability_mg=0.32),
    )

    encoder = 3.0 * 0.0115**2
    bench = encoder + 0.025**2 + 0.02**2 + ((0.025**2 + 0.05**2) * DEG_A_MG**2)
    assert found.u_test_deg == pytest.approx(2.0 * np.sqrt(bench), rel=1e-6)
    unit = (0.32 * DEG_A_MG) ** 2
    assert found.u_deg == pytest.approx(2.0 * np.sqrt(bench + unit), rel=1e-6)


def test_the_units_own_scatter_is_in_the_certificate_and_not_in_the_test(budget):
    found = budget(LEVEL, unit=UnitData(repeatability_mg=0.32, hysteresis_mg=0.16))

    assert np.all(found.u_test_deg == 0.0)
    assert np.all(found.u_deg > 2.0 * 0.32 * DEG_A_MG)


@pytest.mark.parametrize(
    ("name", "doubt"),
    [
        ("field azimuth", {"u_field_azimuth_deg": 0.1}),
        ("seat index", {"seat": Seat(u_index_deg=0.1)}),
    ],
)
def test_one_quantity_at_all_poses_is_fully_correlated_and_never_averages_out(line, name, doubt):
    one = line(name, LEVEL, **doubt)

    mean_deg = np.sqrt(np.mean(one.covariance))
    assert one.shared
    assert mean_deg == pytest.approx(0.05, rel=1e-6)


def test_what_is_drawn_anew_at_each_pose_is_not_correlated(line):
    one = line("repeatability", LEVEL, unit=UnitData(repeatability_mg=0.32))

    off_diagonal = one.covariance - np.diag(np.diag(one.covariance))
    assert np.all(off_diagonal == 0.0)
    assert np.diag(one.covariance) == pytest.approx((0.32 * DEG_A_MG) ** 2, rel=1e-6)


def test_a_one_cycle_error_of_the_encoder_turns_its_sign_over_half_a_turn(line):
    one = line("encoder, one cycle", LEVEL, surroundings=Surroundings(u_one_cycle_deg=0.1))

    assert one.covariance[0, 12] == pytest.approx(-(0.05**2))
    assert np.mean(one.covariance) == pytest.approx(0.0, abs=1e-15)
    two = line("encoder, two cycles", LEVEL, surroundings=Surroundings(u_two_cycle_deg=0.1))
    assert two.covariance[0, 12] == pytest.approx(0.05**2)


def test_an_angle_that_comes_back_has_the_same_fine_error(line):
    poses = [(10.0, 0.0, 0.0), (100.0, 0.0, 0.0), (370.0, 30.0, 0.0)]
    one = line("encoder, fine", poses, surroundings=Surroundings(u_fine_deg=0.1))

    assert one.covariance == pytest.approx(
        0.05**2 * np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]])
    )


def test_pitch_and_roll_encoders_do_not_turn_a_seat_along_the_roll_axis(line):
    one = line("pitch and roll encoders", [*LEVEL, *TILTED], u_rig_deg=0.1)

    assert one.value == 0.05
    assert np.abs(one.columns_deg).max() < 1e-9


def test_the_roll_encoder_turns_a_seat_that_points_across_the_roll_axis(line):
    one = line("pitch and roll encoders", [(0.0, 30.0, 0.0)], seat=Seat(index_deg=90.0),
               u_rig_deg=0.1)  # fmt: skip

    assert np.sqrt(one.covariance[0, 0]) == pytest.approx(0.05 * 0.5, rel=1e-5)  # sin(pitch)


def test_squareness_and_levels_count_at_tilted_poses_only(line):
    around = Surroundings(u_squareness_deg=0.1, u_base_level_deg=0.1)
    for name in ("squareness and wobble", "base level"):
        one = line(name, [(0.0, 0.0, 0.0), (0.0, 30.0, 0.0)], surroundings=around)
        assert np.diag(one.covariance)[0] == pytest.approx(0.0, abs=1e-12)
        assert np.sqrt(np.diag(one.covariance)[1]) == pytest.approx(
            0.05 * np.tan(np.deg2rad(30.0)), rel=1e-5
        )
    seat = line("seat level", [(0.0, 0.0, 0.0), (0.0, 0.0, 30.0)], seat=Seat(u_level_deg=0.1))
    assert np.sqrt(np.diag(seat.covariance)) == pytest.approx([0.0, 0.05 * 0.5], abs=1e-7)


def test_a_gradient_is_worth_its_field_at_each_pose_and_fades_with_the_turn(line):
    one = line("field gradient", LEVEL, surroundings=Surroundings(u_gradient_mg=0.1))

    assert np.sqrt(np.diag(one.covariance)) == pytest.approx(0.05 * DEG_A_MG, rel=1e-6)
    # trace of a turn by 90 deg is 1, by 180 deg -1, over that of none, 3
    assert one.covariance[0, 6] / one.covariance[0, 0] == pytest.approx(1.0 / 3.0, rel=1e-5)
    assert one.covariance[0, 12] / one.covariance[0, 0] == pytest.approx(-1.0 / 3.0, rel=1e-5)


def test_a_drift_of_the_field_reaches_a_turned_seat_through_its_own_attitude(
    readings, fit, station
):
    rows = readings([(0.0, 0.0, 0.0), (70.0, 30.0, 0.0), (200.0, 0.0, -30.0)])
    angles_deg = np.stack([rows[f"rig_{name}_deg"] for name in ("azimuth", "pitch", "roll")], -1)
    seat = np.swapaxes(ned_from_seat(angles_deg, 90.0), 1, 2)
    site_mg, doubt_mg = np.array([250.0, 0.0, 433.0]), 0.1
    rows["field_mg"], rows["accel_g"] = seat @ site_mg, -seat[:, :, 2]
    here_deg = compensated_heading_deg(fit, rows["field_mg"], rows["accel_g"])
    moved_deg = [
        compensated_heading_deg(fit, seat @ (site_mg + doubt_mg * axis), rows["accel_g"])
        for axis in np.eye(3)
    ]
    around = station(seat=Seat(index_deg=90.0), surroundings=Surroundings(u_drift_mg=2 * doubt_mg))

    lines = heading_budget(rows, fit, around, UnitData()).contributions

    drift = next(one for one in lines if one.name == "site field drift")
    expected = wrap_180_deg(np.array(moved_deg) - here_deg).T
    assert drift.columns_deg == pytest.approx(expected, rel=1e-3, abs=1e-6)


def test_the_play_of_the_axes_adds_up_because_they_lag_on_the_same_side_of_a_turn(line):
    one = line("hysteresis", LEVEL, unit=UnitData(hysteresis_mg=0.16))

    heading_rad = np.deg2rad([azimuth for azimuth, _, _ in LEVEL])
    expected = (np.abs(np.sin(heading_rad)) + np.abs(np.cos(heading_rad))) * DEG_A_MG
    assert np.abs(one.columns_deg[:, 0]) == pytest.approx(0.16 / np.sqrt(2.0) * expected, rel=1e-5)
    assert len(set(np.sign(one.columns_deg[:, 0]))) == 1  # a turn lags everywhere alike


def test_the_play_lags_to_the_other_side_where_the_rig_turns_back(line):
    there_and_back = [(azimuth, 0.0, 0.0) for azimuth in (20.0, 50.0, 110.0, 50.0, 20.0)]
    one = line("hysteresis", there_and_back, unit=UnitData(hysteresis_mg=0.16))

    lag_deg = one.columns_deg[:, 0]
    assert lag_deg[3:] == pytest.approx(-lag_deg[1::-1], rel=1e-5)
    assert one.covariance[1, 3] == pytest.approx(-one.covariance[1, 1], rel=1e-5)


@pytest.mark.parametrize("name", ["hysteresis", "accelerometer wander"])
def test_what_depends_on_the_way_goes_by_the_time_of_the_visit_not_by_the_row(
    readings, fit, station, name
):
    unit = UnitData(hysteresis_mg=0.16, accel_wander_g=3e-4)
    rows = readings([*LEVEL[:12], *TILTED, *LEVEL[11::-1]])
    mixed = np.random.default_rng(3).permutation(len(rows))

    def covariance(of):
        lines = heading_budget(of, fit, station(), unit).contributions
        return next(one for one in lines if one.name == name).covariance

    assert covariance(rows[mixed]) == pytest.approx(covariance(rows)[np.ix_(mixed, mixed)])


def test_the_accelerometers_tempco_is_a_limit_times_the_warming_about_the_mean(
    readings, fit, station
):
    rows = readings(LEVEL)
    rows["temperature_c"] = 25.0 + np.linspace(0.0, 0.2, len(rows))
    unit = UnitData(accel_tempco_g_per_c=0.002)
    lines = heading_budget(rows, fit, station(), unit).contributions

    one = next(line for line in lines if line.name == "accelerometer tempco")
    warmer_c = rows["temperature_c"].std()
    assert one.value == pytest.approx(1000.0 * 0.002 / np.sqrt(3.0) * warmer_c)


def test_noise_is_that_of_the_mean_of_the_dwell(readings, fit, station):
    rows = readings(LEVEL)
    rows["noise_mg"], rows["accel_sd_g"] = 0.1, 0.002
    lines = heading_budget(rows, fit, station(), UnitData()).contributions
    by_name = {one.name: one for one in lines}

    assert by_name["sensor noise"].value == pytest.approx(0.1 / np.sqrt(2.0 * 50))
    assert by_name["accelerometer noise"].value == pytest.approx(2.0 / np.sqrt(50))
    expected_deg = np.rad2deg(0.002 / np.sqrt(50) * np.sqrt(3.0))  # tan(dip) = sqrt(3)
    assert by_name["accelerometer noise"].rms_deg(np.ones(24, bool)) == pytest.approx(
        expected_deg, rel=1e-4
    )


def test_a_converter_coarser_than_the_noise_does_not_average(readings, fit, station):
    rows, unit = readings(LEVEL), UnitData(converter_mg=0.4)
    values = []
    for noise_mg in (0.01, 0.4):
        rows["noise_mg"] = noise_mg
        lines = heading_budget(rows, fit, station(), unit).contributions
        values.append(next(one for one in lines if one.name == "converter").value)

    assert values[0] == pytest.approx(0.4 / np.sqrt(24.0))
    assert values[1] == pytest.approx(values[0] / np.sqrt(50.0))


def test_the_wander_of_the_accelerometer_is_that_of_a_random_walk_about_its_mean(line):
    every_s, n = 1.7, len(LEVEL)
    one = line("accelerometer wander", LEVEL, unit=UnitData(accel_wander_g=3e-4))

    rng = np.random.default_rng(5)
    steps = rng.normal(0.0, 3e-4 * np.sqrt(every_s / 100.0), (20_000, n))
    steps[:, 0] = 0.0
    walk = np.cumsum(steps, axis=1)
    walk -= walk.mean(axis=1, keepdims=True)
    assert one.value == pytest.approx(1000.0 * np.sqrt(np.mean(walk**2)), rel=0.02)


def test_a_reference_magnetometer_that_sees_more_than_the_station_says_is_believed(
    readings, fit, station
):
    rows = readings(LEVEL)
    names = [*rows.dtype.descr]
    if "reference_mg" not in rows.dtype.names:
        names.append(("reference_mg", "f8", (3,)))
    seen = np.zeros(len(rows), dtype=names)
    for name in rows.dtype.names:
        seen[name] = rows[name]
    around = station(surroundings=Surroundings(u_drift_mg=0.1))

    def drift(reference_mg):
        seen["reference_mg"] = reference_mg
        lines = heading_budget(seen, fit, around, UnitData()).contributions
        return next(one for one in lines if one.name == "site field drift")

    assert (drift(np.nan).source, drift(np.nan).value) == ("B", 0.05)
    assert (drift(7.0).source, drift(7.0).value) == ("B", 0.05)
    stepped = np.where(np.arange(len(rows)) < 12, 0.0, 1.0)[:, None]
    assert (drift(stepped).source, drift(stepped).value) == ("A", 0.5)
    since_start = heading_budget(seen, fit, around, UnitData(), baseline_mg=np.full(3, -1.0))
    line = next(one for one in since_start.contributions if one.name == "site field drift")
    assert line.value == pytest.approx(np.sqrt(2.5))


def test_the_scatter_of_simulated_verifications_is_the_budgets(readings, fit, station):
    """Draw station and part anew 1,000 times; e - eps scatters by the covariance, per pose."""
    default = load_station("default")
    unit = UnitData(repeatability_mg=0.32)
    rows = readings(LEVEL + TILTED)
    found = heading_budget(rows, fit, default, unit)

    rng = np.random.default_rng(11)
    error = np.array([simulated_error_deg(rows, fit, default, unit, rng) for _ in range(1000)])

    sd = np.sqrt(np.mean(error**2, axis=0))
    assert sd == pytest.approx(found.u_deg / 2.0, rel=4.0 / np.sqrt(2.0 * 1000))
    covariance = error.T @ error / len(error)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    correlation_off = np.abs(covariance - found.covariance_certificate) / scale
    assert correlation_off.max() < 5.0 / np.sqrt(1000)
    covered = np.mean(np.abs(error) <= found.u_deg)
    assert 0.94 < covered < 0.97


def simulated_error_deg(rows, fit, station, unit, rng):
    """Return e of a module without own error, on a bench drawn from its record."""
    around, seat = station.surroundings, station.seat
    azimuth, pitch, roll = (rows[f"rig_{name}_deg"] for name in ("azimuth", "pitch", "roll"))

    def draw(u, size=None):
        return rng.normal(0.0, u / 2.0, size)

    encoder = np.zeros(len(rows))
    for order, u in ((1, around.u_one_cycle_deg), (2, around.u_two_cycle_deg)):
        phase = order * np.deg2rad(azimuth)
        cosine, sine = draw(u, 2)
        encoder += cosine * np.cos(phase) + sine * np.sin(phase)
    fine = {angle: draw(around.u_fine_deg) for angle in np.unique(azimuth)}
    encoder += [fine[angle] for angle in azimuth]
    turn = turn_about
    skew = turn("x", draw(around.u_squareness_deg))
    yaw = turn("z", draw(around.u_squareness_deg))
    base = turn("x", draw(around.u_base_level_deg)) @ turn("y", draw(around.u_base_level_deg))
    mount = turn("z", draw(seat.u_index_deg)) @ turn("y", draw(seat.u_level_deg))
    iron = np.append(draw(seat.u_iron_mg, 2), draw(seat.u_iron_down_mg))
    drift = draw(around.u_drift_mg, 3)
    bend = draw(around.u_gradient_mg, (3, 9)) / np.sqrt(3.0)
    truth = []
    field, force = np.empty((len(rows), 3)), np.empty((len(rows), 3))
    for k, angle in enumerate(azimuth + encoder):
        tilt = skew @ turn("y", pitch[k]) @ skew.T @ yaw @ turn("x", roll[k]) @ yaw.T
        rotation = base @ turn("z", angle) @ tilt @ mount
        site_mg = np.array([250.0, 0.0, 250.0 * np.sqrt(3.0)])
        field[k] = rotation.T @ (site_mg + drift + bend @ rotation.ravel()) + iron
        force[k] = -rotation[2]
        truth.append(np.rad2deg(np.arctan2(rotation[1, 0], rotation[0, 0])))
    field += rng.normal(0.0, unit.repeatability_mg, field.shape)
    sent = compensated_heading_deg(fit, field, force)
    reference = azimuth - draw(station.u_field_azimuth_deg)
    return wrap_180_deg(sent - reference)


def turn_about(axis, angle_deg):
    cosine, sine = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    place = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    i, j = place
    matrix[i, i] = matrix[j, j] = cosine
    matrix[i, j], matrix[j, i] = -sine, sine
    return matrix


def test_a_two_axis_module_is_judged_by_its_own_heading_formula(readings, station):
    two_axis = Fit(
        method="coefficients",
        offset_mg=np.zeros(3),
        matrix=np.eye(3),
        accel_offset_g=np.zeros(3),
        accel_matrix=np.eye(3),
        extended_dip_deg=60.0,
        extra={"horizontal_mg": 250.0},
    )
    around = station(seat=Seat(u_iron_mg=0.2, u_iron_down_mg=0.2))
    rows = readings([(0.0, 0.0, 0.0), (90.0, 0.0, 30.0)])
    lines = heading_budget(rows, two_axis, around, UnitData()).contributions
    by_name = {one.name: one.columns_deg for one in lines}

    assert np.all(by_name["fixture iron, down"] == 0.0)  # it does not measure z
    assert abs(by_name["fixture iron"][0, 1]) == pytest.approx(0.1 * DEG_A_MG, rel=1e-4)


def test_coefficients_that_stretch_the_reading_stretch_what_the_sensor_adds(readings, station, fit):
    doubled = Fit(
        method="coefficients",
        offset_mg=np.zeros(3),
        matrix=2.0 * np.eye(3),
        accel_offset_g=np.zeros(3),
        accel_matrix=np.eye(3),
    )
    rows, unit = readings(LEVEL), UnitData(repeatability_mg=0.32)
    halved = rows.copy()
    halved["field_mg"] /= 2.0
    plain = heading_budget(rows, fit, station(), unit)

    assert heading_budget(halved, doubled, station(), unit).u_deg == pytest.approx(
        2.0 * plain.u_deg, rel=1e-6
    )
