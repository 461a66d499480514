"""The sensors of a unit: noise, saturation, seeds, pulses and faults, in counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from devices.faults import parse_fault
from devices.field import EarthField
from devices.rig import perfect_rig
from devices.sensors import Sensors
from devices.unit import ModuleUnit, draw_unit
from devices.world import World

TICKS = 4000


def make(unit: ModuleUnit | None = None, seed: int = 9) -> Sensors:
    world = World(EarthField(), perfect_rig())
    return Sensors(unit or draw_unit("SN0001", 1), world, np.random.default_rng(seed))


def read(sensors: Sensors, ticks: int = TICKS) -> np.ndarray:
    """Return counts, shape (ticks, 3, 3): set, reset, acceleration by x, y, z."""
    return np.array([sensors.sample(0.01 * tick) for tick in range(ticks)], dtype=float)


def field_mg(sensors: Sensors, ticks: int = 100) -> np.ndarray:
    counts = read(sensors, ticks)
    return ((counts[:, 0] - counts[:, 1]) / 2.0).mean(axis=0) * sensors.unit.mag_mg_per_count


def force_g(sensors: Sensors, ticks: int = 100) -> np.ndarray:
    return read(sensors, ticks)[:, 2].mean(axis=0) * sensors.unit.accel_g_per_count


def with_fault(specification: str, unit: ModuleUnit | None = None) -> Sensors:
    sensors = make(unit)
    assert sensors.apply(parse_fault(specification))
    return sensors


class TestNoise:
    def test_of_one_reading_is_that_of_the_data_sheet(self) -> None:
        counts = read(make())
        noise_mg = counts[:, :2].std(axis=0, ddof=1) * (1600.0 / 16384.0)

        # 85 uG and the converter's 98/sqrt(12) uG; 1/f leaves a slow part in each 40 s
        assert noise_mg == pytest.approx(np.full((2, 3), np.hypot(0.085, 0.0282)), rel=0.12)

    def test_of_the_difference_is_white_and_smaller(self) -> None:
        counts = read(make())
        difference_mg = (counts[:, 0] - counts[:, 1]) / 2.0 * (1600.0 / 16384.0)
        expected_mg = np.hypot(0.085 * np.sqrt(0.75), 0.0282) / np.sqrt(2.0)

        assert difference_mg.std(axis=0) == pytest.approx(np.full(3, expected_mg), rel=0.06)
        for axis in range(3):
            lagged = np.corrcoef(difference_mg[:-1, axis], difference_mg[1:, axis])[0, 1]
            assert abs(lagged) < 0.06

    def test_set_and_reset_share_their_slow_part(self) -> None:
        counts = read(make())
        slow_set = counts[:, 0, 0].reshape(-1, 100).mean(axis=1)
        slow_reset = counts[:, 1, 0].reshape(-1, 100).mean(axis=1)

        assert np.corrcoef(slow_set, slow_reset)[0, 1] > 0.5

    def test_of_the_accelerometer_is_2_mg(self) -> None:
        unit = replace(draw_unit("SN0001", 1), accel_wander_g=0.0, self_heating_c=0.0)
        counts = read(make(unit))

        noise_g = counts[:, 2].std(axis=0, ddof=1) / 16384.0
        assert noise_g == pytest.approx(np.full(3, 0.002), rel=0.05)


class TestReproducibility:
    def test_same_seed_gives_the_same_counts(self) -> None:
        np.testing.assert_array_equal(read(make(seed=4), 300), read(make(seed=4), 300))

    def test_another_seed_gives_others(self) -> None:
        assert not np.array_equal(read(make(seed=4), 300), read(make(seed=5), 300))

    def test_counts_are_integers(self) -> None:
        readings = make().sample(0.0)

        assert all(type(count) is int for triple in readings for count in triple)


class TestSaturation:
    def test_converter_holds_at_its_ends(self) -> None:
        unit = draw_unit("SN0001", 1)
        strong = replace(
            unit, magnetics=replace(unit.magnetics, hard_iron_mg=(1500.0, -1500.0, 0.0))
        )
        set_counts, reset_counts, _ = make(strong).sample(0.0)

        assert (set_counts[0], reset_counts[0]) == (8191, -8192)
        assert (set_counts[1], reset_counts[1]) == (-8192, 8191)
        assert abs(set_counts[2]) < 8191

    def test_twelve_bits(self) -> None:
        coarse = make(draw_unit("SN0001", 1, bits=12))
        fine = make(draw_unit("SN0001", 1))

        assert coarse.unit.mag_mg_per_count == 0.390625
        assert field_mg(coarse) == pytest.approx(field_mg(fine), abs=0.3)


class TestPulses:
    def test_strong_field_lowers_the_amplitude_until_a_sufficient_pulse(self) -> None:
        sensors = make()
        sensors.pulse_current_ma = 420.0
        before_mg = field_mg(sensors)
        sensors.expose((0.0, 0.0, 20_000.0))
        exposed_mg = field_mg(sensors)
        sensors.pulse(300.0)
        weak_mg = field_mg(sensors)
        sensors.pulse(1000.0)
        restored_mg = field_mg(sensors)

        assert np.all(np.abs(exposed_mg) < 0.7 * np.abs(before_mg))
        assert weak_mg == pytest.approx(exposed_mg, abs=0.3)
        assert restored_mg == pytest.approx(before_mg, abs=0.5)
        assert sensors.film_order == pytest.approx((1.0, 1.0, 1.0), abs=1e-3)

    def test_own_pulses_of_the_nominal_current_restore_at_once(self) -> None:
        sensors = make()
        before_mg = field_mg(sensors)
        sensors.expose((0.0, 0.0, 20_000.0))

        assert field_mg(sensors) == pytest.approx(before_mg, abs=0.3)

    def test_too_weak_a_current_does_not_flip_the_film(self) -> None:
        sensors = make()
        assert sensors.pulse_current_ma == 1000.0
        sensors.pulse_current_ma = 100.0

        assert field_mg(sensors) == pytest.approx(np.zeros(3), abs=0.5)


class TestTemperature:
    def test_warms_slowly(self) -> None:
        sensors = make()
        start_c = sensors.temperature_c
        sensors.sample(1000.0)

        assert 0.2 < sensors.temperature_c - start_c < 0.4
        assert sensors.supply_v == pytest.approx(5.0, abs=0.2)


class TestFaults:
    @pytest.mark.parametrize(("axis", "name"), list(enumerate("xyz")))
    def test_dead_strap_leaves_no_difference(self, axis: int, name: str) -> None:
        plain_mg, broken_mg = field_mg(make()), field_mg(with_fault(f"dead_strap_{name}"))
        others = [other for other in range(3) if other != axis]

        assert abs(broken_mg[axis]) < 0.1
        assert broken_mg[others] == pytest.approx(plain_mg[others], abs=0.1)

    @pytest.mark.parametrize(("axis", "name"), list(enumerate("xyz")))
    def test_stuck_axis_gives_one_count(self, axis: int, name: str) -> None:
        counts = read(with_fault(f"stuck_axis_{name}"), 90)

        assert np.ptp(counts[:, :2, axis]) == 0
        assert np.ptp(counts[:, 0, axis - 1]) > 0

    @pytest.mark.parametrize(("axis", "name"), list(enumerate("xyz")))
    def test_inverted_axis(self, axis: int, name: str) -> None:
        plain_mg, broken_mg = field_mg(make()), field_mg(with_fault(f"inverted_axis_{name}"))

        assert broken_mg[axis] == pytest.approx(-plain_mg[axis], rel=0.01, abs=0.5)

    @pytest.mark.parametrize(("axis", "name"), list(enumerate("xyz")))
    def test_accelerometer_sign(self, axis: int, name: str) -> None:
        plain_g, broken_g = force_g(make()), force_g(with_fault(f"accel_sign_{name}"))

        assert broken_g[axis] == pytest.approx(-plain_g[axis], abs=0.002)

    def test_swapped_axes(self) -> None:
        plain_mg, broken_mg = field_mg(make()), field_mg(with_fault("swapped_axes"))

        assert broken_mg[[1, 0]] == pytest.approx(plain_mg[[0, 1]], rel=0.08)

    def test_excess_noise_is_twenty_times_the_data_sheet(self) -> None:
        noise_mg = read(with_fault("excess_noise"))[:, 0].std(axis=0) * (1600.0 / 16384.0)

        assert noise_mg == pytest.approx(np.full(3, 20 * 0.085), rel=0.12)

    def test_excess_noise_takes_hold_at_once(self) -> None:
        sensors = make()
        quiet = read(sensors, 100)[:, 0].std()
        sensors.apply(parse_fault("excess_noise"))

        assert read(sensors, 100)[:, 0, 0].std() > 5.0 * read(make(), 100)[:, 0, 0].std()
        assert quiet > 0.0

    def test_saturated_axis_is_at_its_end_of_scale(self) -> None:
        counts = read(with_fault("saturated_axis"), 50)

        assert np.all(np.abs(counts[:, :2, 0]) >= 8191)

    @pytest.mark.parametrize(
        "name",
        [
            "dead_strap_x", "stuck_axis_y", "inverted_axis_z", "swapped_axes", "excess_noise",
            "saturated_axis", "accel_sign_x",
        ],
    )  # fmt: skip
    def test_strength_zero_changes_nothing(self, name: str) -> None:
        np.testing.assert_array_equal(read(with_fault(f"{name}=0"), 50), read(make(), 50))

    @pytest.mark.parametrize("name", ["inverted_axis_x", "stuck_axis_x", "dead_strap_x"])
    def test_strength_scales_the_loss(self, name: str) -> None:
        plain_mg = abs(field_mg(make())[0])
        levels_mg = [abs(field_mg(with_fault(f"{name}={s}"))[0]) for s in (0.1, 0.2, 0.4)]

        assert plain_mg > levels_mg[0] > levels_mg[1] > levels_mg[2] > 0.0

    @pytest.mark.parametrize("name", ["lost_write", "module_silent", "axis_stalled_roll"])
    def test_faults_of_others_are_left_to_them(self, name: str) -> None:
        assert not make().apply(parse_fault(name))
