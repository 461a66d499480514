"""Identities that the virtual world must keep, each by one test; the bridges have their own.

| identity | test |
|---|---|
| ned_from_body = Rz(azimuth) Ry(pitch) Rx(roll), by hand and by scipy | rotation |
| a rotation keeps lengths and the angle of field and gravity | invariance |
| level at rest the specific force is (0, 0, -1) g; nose up f_x > 0; right down f_y < 0 | force |
| heading = atan2(-Y, X) of a level body | heading |
| tan(dip) = down/horizontal; declination is east positive | field |
| a dipole's field falls with the cube of the distance, twice as strong on its axis | dipole |
"""

from __future__ import annotations

import math
from datetime import date

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from devices import rotation
from devices.field import EarthField
from devices.magnetics import Magnetics
from devices.rig import RigGeometry, RigMechanics, perfect_rig
from devices.seat import Seat
from devices.world import Forklift, MainsHum, SlowDrift, World

STEP_NS = 10_000_000


def move(world: World, *angles_deg: float) -> None:
    for axis, angle_deg in zip(world.rig.axes, angles_deg, strict=True):
        axis.command(angle_deg)
    for _ in range(3000):
        world.step(round(world.t_s * 1e9) + STEP_NS)
        if not any(axis.moving for axis in world.rig.axes):
            return
    pytest.fail("the rig did not come to rest")


class TestRotation:
    @pytest.mark.parametrize(
        "angles_deg",
        [(0, 0, 0), (37, 0, 0), (0, 30, 0), (0, 0, -30), (211, -25, 17), (359, 89, -91)],
    )
    def test_matches_scipy(self, angles_deg: tuple[float, float, float]) -> None:
        expected = Rotation.from_euler("ZYX", angles_deg, degrees=True).as_matrix()

        actual = np.reshape(rotation.ned_from_body(*angles_deg), (3, 3))

        np.testing.assert_allclose(actual, expected, atol=1e-14)

    def test_by_hand(self) -> None:
        body_x = rotation.apply(rotation.ned_from_body(90.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        body_y = rotation.apply(rotation.ned_from_body(0.0, 0.0, 90.0), (0.0, 1.0, 0.0))
        nose = rotation.apply(rotation.ned_from_body(0.0, 30.0, 0.0), (1.0, 0.0, 0.0))

        assert body_x == pytest.approx((0.0, 1.0, 0.0))  # heading east
        assert body_y == pytest.approx((0.0, 0.0, 1.0))  # right side down
        assert nose == pytest.approx((math.cos(math.radians(30.0)), 0.0, -0.5))  # nose up

    def test_about_axis_matches_rotation_vector(self) -> None:
        axis = (0.36, 0.48, 0.8)

        actual = np.reshape(rotation.about_axis(axis, 50.0), (3, 3))

        expected = Rotation.from_rotvec(np.radians(50.0) * np.array(axis)).as_matrix()
        np.testing.assert_allclose(actual, expected, atol=1e-14)

    def test_inverse_is_transpose(self) -> None:
        matrix = rotation.ned_from_body(12.0, 34.0, 56.0)

        unity = rotation.product(matrix, rotation.transpose(matrix))

        assert unity == pytest.approx(rotation.IDENTITY)
        assert rotation.apply_inverse(
            matrix, rotation.apply(matrix, (1.0, 2.0, 3.0))
        ) == pytest.approx((1.0, 2.0, 3.0))


class TestWorld:
    @pytest.mark.parametrize("angles_deg", [(0, 0, 0), (123, 20, -30), (300, -30, 10)])
    def test_turning_keeps_strength_and_dip(self, angles_deg: tuple[float, float, float]) -> None:
        world = World(EarthField(), perfect_rig())
        move(world, *angles_deg)

        field = np.array(world.field_body_mg())
        force = np.array(world.force_body_g())

        assert np.linalg.norm(field) == pytest.approx(500.0)
        assert np.linalg.norm(force) == pytest.approx(1.0)
        sine_of_dip = field @ -force / 500.0
        assert math.degrees(math.asin(sine_of_dip)) == pytest.approx(60.0)

    def test_imperfect_rig_keeps_lengths(self) -> None:
        geometry = RigGeometry(
            base_level_north_deg=0.3,
            base_level_east_deg=-0.2,
            azimuth_pitch_squareness_deg=0.1,
            pitch_roll_squareness_deg=0.15,
            wobble_deg=0.05,
        )
        world = World(EarthField(), RigMechanics(perfect_rig().axes, geometry))
        move(world, 77.0, 12.0, -21.0)

        assert np.linalg.norm(world.field_body_mg()) == pytest.approx(500.0)
        assert np.linalg.norm(world.force_body_g()) == pytest.approx(1.0)

    def test_level_base_tilt_shows_in_the_force(self) -> None:
        geometry = RigGeometry(base_level_east_deg=1.0)
        world = World(EarthField(), RigMechanics(perfect_rig().axes, geometry))

        assert world.force_body_g()[0] == pytest.approx(math.sin(math.radians(1.0)))

    def test_specific_force_signs(self) -> None:
        world = World(EarthField(), perfect_rig())
        assert world.force_body_g() == pytest.approx((0.0, 0.0, -1.0))

        move(world, 0.0, 30.0, 0.0)
        assert world.force_body_g()[0] == pytest.approx(0.5)

        move(world, 0.0, 0.0, 30.0)
        assert world.force_body_g()[1] == pytest.approx(-0.5)

    @pytest.mark.parametrize("heading_deg", [0.0, 45.0, 90.0, 200.0, 315.0])
    def test_level_heading(self, heading_deg: float) -> None:
        world = World(EarthField(), perfect_rig())
        move(world, heading_deg, 0.0, 0.0)

        x, y, _ = world.field_body_mg()

        assert math.degrees(math.atan2(-y, x)) % 360.0 == pytest.approx(heading_deg, abs=1e-9)

    def test_same_object_at_rest(self) -> None:
        world = World(EarthField(), perfect_rig())
        before = world.field_body_mg()
        world.step(STEP_NS)

        assert world.field_body_mg() is before

    def test_time_must_not_go_back(self) -> None:
        world = World(EarthField(), perfect_rig())
        world.step(STEP_NS)

        with pytest.raises(ValueError, match="must not go back"):
            world.step(0)

    def test_hiccups_of_the_host_do_not_disturb_the_motion(self) -> None:
        world = World(EarthField(), perfect_rig())
        rng = np.random.default_rng(6)
        world.rig.azimuth.command(170.0)
        highest_deg = 0.0
        for _ in range(60):
            step_ns = int(rng.integers(0, 3)) * int(rng.integers(1, 60)) * 1_000_000
            world.step(round(world.t_s * 1e9) + step_ns)
            highest_deg = max(highest_deg, world.rig.azimuth.angle_deg)
        world.step(round(world.t_s * 1e9) + 6_000_000_000)

        assert world.rig.azimuth.encoder_deg == pytest.approx(170.0)
        assert highest_deg < 171.0

    def test_no_time_no_motion(self) -> None:
        world = World(EarthField(), perfect_rig())
        world.rig.azimuth.command(10.0)
        world.step(0)

        assert world.rig.azimuth.angle_deg == 0.0

    def test_stage_field_turns_with_the_seat_and_anomaly_does_not(self) -> None:
        plain = World(EarthField(), perfect_rig())
        anomaly = World(EarthField(), perfect_rig(), anomaly_ned_mg=(0.0, 5.0, 0.0))
        stage = World(EarthField(), perfect_rig(), seat=Seat(iron_mg=(0.0, 5.0, 0.0)))
        for world in (plain, anomaly, stage):
            move(world, 90.0, 0.0, 0.0)

        from_anomaly = np.subtract(anomaly.field_body_mg(), plain.field_body_mg())
        from_stage = np.subtract(stage.field_body_mg(), plain.field_body_mg())

        assert from_anomaly == pytest.approx([5.0, 0.0, 0.0], abs=1e-9)
        assert from_stage == pytest.approx([0.0, 5.0, 0.0], abs=1e-9)


class TestField:
    def test_components(self) -> None:
        field = EarthField(horizontal_mg=250.0, dip_deg=60.0, declination_deg=10.0)
        north, east, down = field.ned_mg

        assert math.hypot(north, east) == pytest.approx(250.0)
        assert math.degrees(math.atan2(east, north)) == pytest.approx(10.0)
        assert down == pytest.approx(250.0 * math.sqrt(3.0))
        assert field.total_mg == pytest.approx(math.sqrt(north**2 + east**2 + down**2))

    @pytest.mark.parametrize(
        "wrong", [{"horizontal_mg": 0.0}, {"dip_deg": 90.0}, {"declination_deg": math.nan}]
    )
    def test_refuses_what_no_place_has(self, wrong: dict[str, float]) -> None:
        with pytest.raises(ValueError, match="instead received"):
            EarthField(**wrong)

    def test_world_magnetic_model_near_munich(self) -> None:
        field = EarthField.from_wmm(48.1, 11.6, 0.5, date(2026, 7, 1))

        assert 200.0 < field.horizontal_mg < 220.0
        assert 63.0 < field.dip_deg < 66.0
        assert 3.5 < field.declination_deg < 5.5


class TestDisturbances:
    def test_dipole_falls_with_the_cube(self) -> None:
        near = Forklift(
            moment_ned_am2=(0, 0, 300.0), start_ned_m=(0, 2.0, 0), velocity_ned_mps=(0, 0, 0)
        )
        far = Forklift(
            moment_ned_am2=(0, 0, 300.0), start_ned_m=(0, 4.0, 0), velocity_ned_mps=(0, 0, 0)
        )

        assert near.field_ned_mg(0.0)[2] == pytest.approx(8.0 * far.field_ned_mg(0.0)[2])

    def test_dipole_on_its_axis_is_twice_that_beside_it(self) -> None:
        above = Forklift(
            moment_ned_am2=(0, 0, 300.0), start_ned_m=(0, 0, 3.0), velocity_ned_mps=(0, 0, 0)
        )
        beside = Forklift(
            moment_ned_am2=(0, 0, 300.0), start_ned_m=(3.0, 0, 0), velocity_ned_mps=(0, 0, 0)
        )

        # mu0/4pi 2m/r3 = 2e-7 x 300/27 T = 22.2 mG along the moment; beside it, against it
        assert above.field_ned_mg(0.0)[2] == pytest.approx(2 * 300.0 / 27.0)
        assert beside.field_ned_mg(0.0)[2] == pytest.approx(-300.0 / 27.0)

    def test_forklift_comes_and_goes(self) -> None:
        forklift = Forklift()
        sizes_mg = [np.linalg.norm(forklift.field_ned_mg(t_s)) for t_s in (0.0, 40.0 / 3.0, 60.0)]

        assert sizes_mg[1] > 10.0 * max(sizes_mg[0], sizes_mg[2])

    def test_hum_has_its_amplitude_and_no_mean(self) -> None:
        hum = MainsHum(amplitude_ned_mg=(2.0, 0.0, 0.0), frequency_hz=50.0)
        values = np.array([hum.field_ned_mg(t / 1000.0)[0] for t in range(1000)])

        assert values.mean() == pytest.approx(0.0, abs=1e-9)
        assert values.max() == pytest.approx(2.0, rel=1e-6)

    def test_drift_is_slow_and_small(self) -> None:
        world = World(EarthField(), perfect_rig(), drift=SlowDrift())
        start = np.array(world.field_ned_mg)
        changes_mg = []
        for second in range(1, 400):
            world.step(second * 1_000_000_000)
            changes_mg.append(np.linalg.norm(np.array(world.field_ned_mg) - start))

        assert 0.02 < max(changes_mg) < 0.2
        assert np.abs(np.diff(changes_mg)).max() < 0.01

    def test_moving_sources_reach_the_module_at_every_step(self) -> None:
        world = World(EarthField(), perfect_rig(), forklift=Forklift(start_ned_m=(-2.0, 2.0, 0.0)))
        before = world.field_body_mg()
        world.step(STEP_NS)

        assert world.field_body_mg() != before


class TestIron:
    def test_soft_then_hard(self) -> None:
        iron = Magnetics(
            soft_iron=(1.1, 0.2, 0.0, 0.0, 0.9, 0.0, 0.0, 0.1, 1.0),
            hard_iron_mg=(100.0, 0.0, -20.0),
        )

        assert iron.sensor_field_mg((10.0, 20.0, 30.0)) == pytest.approx((115.0, 18.0, 12.0))


class TestPlaces:
    GRADIENT = (0.3, 0.1, -0.2, 0.1, -0.5, 0.4, -0.2, 0.4, 0.2)

    def test_the_field_at_the_crossing_is_that_of_the_module(self) -> None:
        forklift = Forklift(start_ned_m=(-2.0, 2.0, 0.0))
        world = World(EarthField(), perfect_rig(), drift=SlowDrift(), forklift=forklift)
        for second in range(1, 5):
            world.step(second * 1_000_000_000)

            assert world.field_at_ned_mg((0.0, 0.0, 0.0)) == world.field_ned_mg

    def test_a_dipole_falls_with_the_cube_of_its_distance(self) -> None:
        still = Forklift(start_ned_m=(0.0, 0.0, 0.0), velocity_ned_mps=(0.0, 0.0, 0.0))
        at_2, at_4 = (np.array(still.field_ned_mg(0.0, (0.0, r, 0.0))) for r in (2.0, 4.0))

        assert at_2 == pytest.approx(8.0 * at_4)
        assert at_2 == pytest.approx((0.0, 0.0, -300.0 / 8.0))

    def test_a_vehicle_stands_at_its_nearest_place_and_goes_on(self) -> None:
        past = Forklift(start_ned_m=(-15.0, 4.0, 0.0), starts_s=10.0, stands_s=20.0)

        assert past.place_ned_m(10.0) == (-15.0, 4.0, 0.0)
        assert past.place_ned_m(20.0) == (0.0, 4.0, 0.0)
        assert past.place_ned_m(40.0) == (0.0, 4.0, 0.0)
        assert past.place_ned_m(50.0) == pytest.approx((15.0, 4.0, 0.0))

    def test_a_gradient_turns_with_the_sensor_s_place(self) -> None:
        rig = perfect_rig()
        world = World(
            EarthField(), rig, gradient_ned_mg_per_m=self.GRADIENT, sensor_body_m=(0.1, 0.0, 0.02)
        )
        gradient = np.reshape(self.GRADIENT, (3, 3))
        for azimuth_deg in (0.0, 90.0, 180.0):
            rig.azimuth.angle_deg = azimuth_deg
            turn = np.reshape(rig.ned_from_body(), (3, 3))
            place = turn @ [0.1, 0.0, 0.02]
            expected_mg = turn.T @ (np.array(EarthField().ned_mg) + gradient @ place)

            assert world.field_body_mg() == pytest.approx(tuple(expected_mg))
            assert world.field_at_ned_mg(tuple(place)) == pytest.approx(tuple(turn @ expected_mg))

    def test_in_the_crossing_a_gradient_is_not_felt(self) -> None:
        plain = World(EarthField(), perfect_rig())
        bent = World(EarthField(), perfect_rig(), gradient_ned_mg_per_m=self.GRADIENT)

        assert bent.field_body_mg() == pytest.approx(plain.field_body_mg())

    @pytest.mark.parametrize("wrong", [(0.3,) + (0.0,) * 8, (0.0, 1.0) + (0.0,) * 7])
    def test_a_gradient_that_no_field_has_is_refused(self, wrong: tuple[float, ...]) -> None:
        with pytest.raises(ValueError, match="symmetric and without trace"):
            World(EarthField(), perfect_rig(), gradient_ned_mg_per_m=wrong)  # type: ignore[arg-type]
