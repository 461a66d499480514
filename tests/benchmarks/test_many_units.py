"""The units of the benchmarks are those of `devices`, on benches off by what stations state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.pose import Attitude
from bench.station import load_station
from bench.steps.step import PlannedPose
from devices.bridge import Bridge
from devices.field import EarthField
from devices.rotation import apply_inverse, ned_from_body
from devices.unit import draw_unit
from protocols.angles import wrap_180_deg

POSES = [(10.0, 0.0, 0.0), (97.5, 30.0, 0.0), (200.0, -15.0, 15.0), (350.0, 0.0, -30.0)]
HOME = Attitude(azimuth_deg=0.0)
STATION = load_station("default")
PERFECT = ("geometry_deg", "index_deg", "level_deg", "iron_mg", "field_azimuth_deg", "gradient_mg")


def planned(dwell_s=0.5):
    return [
        PlannedPose(attitude=Attitude(azimuth_deg=a, pitch_deg=p, roll_deg=r), dwell_s=dwell_s)
        for a, p, r in POSES
    ]


def on_perfect_benches(lot):
    """Return the lot on benches whose drift alone is left, each in the drift's own phase."""
    own = lot.benches
    encoders = own.encoders.copy()
    encoders[..., 1:] = 0.0
    nothing = {name: np.zeros_like(getattr(own, name)) for name in PERFECT}
    return replace(lot, benches=replace(own, encoders=encoders, **nothing))


def test_a_unit_of_the_benchmarks_reads_what_the_devices_unit_reads():
    """Without memory and rig errors both are the same function, but for the noise of a mean."""
    from many_benches import field_at_sensor_mg, ned_from_seat
    from many_units import drawn_lot, read, way_of

    lot = on_perfect_benches(drawn_lot(7, 1))
    for name in ("hysteresis_mg", "repeatability_mg"):
        lot.values[name][:] = 0.0
    way = way_of(planned(dwell_s=50.0), HOME)

    readings = read(lot, way, np.random.default_rng(1))

    unit = draw_unit("GU0007", 7)
    seen_mg = field_at_sensor_mg(lot.benches, ned_from_seat(lot.benches, way), way.seconds)
    for index, pose in enumerate(POSES):
        warm_c = unit.temperature_c(way.seconds[index]) - 25.0
        axes = ned_from_body(*pose)
        ned_mg = tuple(seen_mg[0, index, -1].tolist())
        assert ned_mg == pytest.approx(EarthField().ned_mg, abs=0.06)
        sensor_mg = unit.magnetics.sensor_field_mg(apply_inverse(axes, ned_mg))
        for axis, across in enumerate((1, 0, 0)):
            bridge = Bridge(unit.bridges[axis])
            set_mg, reset_mg = bridge.levels_mg(sensor_mg[axis], sensor_mg[across], 1.0, warm_c)[:2]
            assert readings.field_mg[0, index, axis] == pytest.approx(
                (set_mg - reset_mg) / 2.0, abs=0.05
            )
            assert readings.offset_mg[0, index, axis] == pytest.approx(
                (set_mg + reset_mg) / 2.0, abs=0.2
            )
        expected_g = unit.accelerometer.level_g(
            apply_inverse(axes, (0.0, 0.0, -1.0)), warm_c + 25.0
        )
        assert readings.force_g[0, index] == pytest.approx(expected_g, abs=0.0015)


def test_benches_are_off_by_half_the_stations_expanded_uncertainties():
    from many_benches import drawn_benches

    benches = drawn_benches(1, 600, STATION)

    seat, around = STATION.seat, STATION.surroundings
    for values, expanded in (
        (benches.index_deg, seat.u_index_deg),
        (benches.level_deg, seat.u_level_deg),
        (benches.iron_mg[:, :2], seat.u_iron_mg),
        (benches.iron_mg[:, 2], seat.u_iron_down_mg),
        (benches.field_azimuth_deg, STATION.u_field_azimuth_deg),
        (benches.gradient_mg, around.u_gradient_mg),
        (benches.encoders[:, :, 0, 1:], around.u_one_cycle_deg),
        (benches.encoders[:, :, 1, 1:], around.u_two_cycle_deg),
        (benches.geometry_deg[:, :2], around.u_base_level_deg),
        (benches.geometry_deg[:, 2:4], around.u_squareness_deg),
    ):
        assert np.std(values) == pytest.approx(expanded / 2.0, rel=0.12)


def test_on_a_perfect_bench_the_measured_error_is_the_error_that_the_unit_showed():
    from many_units import drawn_lot
    from verifications import verifications_of

    found = verifications_of(on_perfect_benches(drawn_lot(3, 4)), 1, "quick")

    # the play of the drives and the drift are left
    assert found.error_deg == pytest.approx(found.shown_deg, abs=0.03)
    assert np.abs(found.error_deg).max() > 0.05


def test_a_turned_seat_is_an_error_of_the_unit_that_its_verification_cannot_see():
    from many_units import drawn_lot
    from verifications import verifications_of

    square = on_perfect_benches(drawn_lot(3, 4))
    turned = replace(square, benches=replace(square.benches, index_deg=np.full(4, 0.5)))

    before, after = (verifications_of(lot, 1, "quick") for lot in (square, turned))

    assert after.error_deg == pytest.approx(before.error_deg, abs=0.02)
    level = before.readings[0]["rig_pitch_deg"] == before.readings[0]["rig_roll_deg"]
    assert level.sum() == 12
    assert after.own_deg[:, level] == pytest.approx(before.own_deg[:, level] - 0.5, abs=0.03)


def test_units_that_changed_after_the_write_err_by_up_to_what_was_asked():
    from many_units import drawn_lot
    from verifications import verifications_of

    lot = on_perfect_benches(drawn_lot(3, 20))

    found = verifications_of(lot, 1, "quick", np.full(20, 5.0))

    largest_deg = np.abs(found.error_deg).max(axis=1)
    assert np.all((largest_deg > 3.0) & (largest_deg < 12.0))
    assert np.isnan(found.own_deg).all()
    assert np.abs(wrap_180_deg(found.error_deg - found.shown_deg)).max() < 0.03


def test_the_calibration_knows_the_cross_axis_term_of_every_unit():
    from many_fits import calibrated
    from many_units import drawn_lot, read, way_of
    from verifications import poses_of

    lot = drawn_lot(11, 6)
    poses = poses_of("eol_three_axis")
    way = way_of(poses, HOME)

    found = calibrated(way.shown_deg[:, -1], read(lot, way, np.random.default_rng(2)), len(poses))

    across = lot.values["sensitivity"][:, [1, 0, 0]]
    true_mg = lot.values["hk_mg"] * across
    corrected = found.hk_mg > 0.0
    assert corrected.mean() > 0.9
    assert found.hk_mg[corrected] == pytest.approx(true_mg[corrected], rel=0.08)
    assert np.all(found.fits.cause == 0)
