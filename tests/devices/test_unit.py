"""Units drawn from serial and seed: good ones, different ones, the same ones again."""

from __future__ import annotations

import math

import numpy as np
import pytest

from devices.accelerometer import Accelerometer
from devices.bridge import Bridge3
from devices.field import EarthField
from devices.noise import BLOCK, NormalStream, pink_block
from devices.rotation import apply_inverse, ned_from_body
from devices.unit import draw_unit, peak_reading_mg, unit_stream

UNITS = [draw_unit(f"SN{n:04d}", n) for n in range(60)]


def test_serial_and_seed_decide() -> None:
    assert draw_unit("SN0001", 1) == draw_unit("SN0001", 1)
    assert draw_unit("SN0001", 1) != draw_unit("SN0002", 1)
    assert draw_unit("SN0001", 1) != draw_unit("SN0001", 2)


def test_streams_of_other_purposes_are_independent() -> None:
    first = unit_stream("SN0001", 1, 1).standard_normal(4)
    second = unit_stream("SN0001", 1, 2).standard_normal(4)

    assert not np.array_equal(first, second)


def test_readings_stay_within_720_mg_at_every_attitude() -> None:
    assert max(peak_reading_mg(unit, EarthField()) for unit in UNITS) < 720.0


def test_peak_agrees_with_the_bridges_at_their_worst_attitude() -> None:
    unit = UNITS[7]
    bridges = Bridge3(unit.bridges, unit.strap, lambda: 0.0)
    peak_mg = 0.0
    for azimuth_deg in range(0, 360, 10):
        for pitch_deg, roll_deg in ((0, 0), (35, 0), (-35, 0), (0, 35), (0, -35), (24, 26)):
            body_from_ned = ned_from_body(azimuth_deg, pitch_deg, roll_deg)
            body_mg = apply_inverse(body_from_ned, EarthField().ned_mg)
            levels = bridges.levels_mg(unit.magnetics.sensor_field_mg(body_mg), 25.0)
            peak_mg = max(peak_mg, *(abs(level) for level in levels))

    assert peak_mg <= peak_reading_mg(unit, EarthField()) + 1.0
    assert peak_mg > 0.85 * peak_reading_mg(unit, EarthField())


def test_hard_iron_is_up_to_0_8_of_the_horizontal_field() -> None:
    shares = [math.hypot(*unit.magnetics.hard_iron_mg[:2]) / 250.0 for unit in UNITS]

    assert max(shares) <= 0.8
    assert 0.4 < np.median(shares) < 0.7


def test_soft_iron_is_tens_of_percent() -> None:
    ratios = []
    for unit in UNITS:
        values = np.linalg.svd(np.reshape(unit.magnetics.soft_iron, (3, 3)))[1]
        ratios.append(values[0] / values[-1] - 1.0)

    assert 0.1 < np.median(ratios) < 0.4
    assert max(ratios) < 0.6


def test_bridges_are_within_their_data_sheet() -> None:
    bridges = [bridge for unit in UNITS for bridge in unit.bridges]

    assert all(0.95 <= bridge.sensitivity <= 1.05 for bridge in bridges)
    assert all(abs(bridge.offset_mg) <= 50.0 for bridge in bridges)
    assert all(6500.0 < bridge.hk_mg < 9500.0 for bridge in bridges)
    assert all(abs(bridge.cubic_per_mg2) * 400.0**3 <= 0.2 + 1e-12 for bridge in bridges)


def test_accelerometers_are_raw() -> None:
    biases_g = np.array([unit.accelerometer.bias_g for unit in UNITS])
    drifts = np.array([unit.accelerometer.drift_g_per_c for unit in UNITS])

    assert 0.024 < biases_g.std() < 0.034
    assert np.abs(biases_g).max() <= 0.075
    assert np.abs(drifts).max() <= 0.002
    for unit in UNITS:
        values = np.linalg.svd(np.reshape(unit.accelerometer.matrix, (3, 3)))[1]
        assert np.all(np.abs(values - 1.0) < 0.04)


def test_accelerometer_nonlinearity_is_at_most_0_2_percent_of_full_scale() -> None:
    for unit in UNITS:
        part = unit.accelerometer
        bent = Accelerometer(quadratic_per_g=part.quadratic_per_g, cubic_per_g2=part.cubic_per_g2)
        for force_g in (-2.0, -1.0, 1.0, 2.0):
            level_g = np.array(bent.level_g((force_g, force_g, force_g), 25.0))

            assert np.all(np.abs(level_g - force_g) <= 0.004 + 1e-12)


def test_accelerometer_matrix_bias_and_drift() -> None:
    part = Accelerometer(
        matrix=(1.0, 0.01, 0.0, 0.0, 1.02, 0.0, 0.0, 0.0, 1.0),
        bias_g=(0.03, 0.0, -0.01),
        drift_g_per_c=(0.002, 0.0, 0.0),
    )

    assert part.level_g((0.1, 0.5, -0.8), 30.0) == pytest.approx((0.145, 0.51, -0.81))


def test_a_site_too_strong_for_the_converter_ends_the_trimming() -> None:
    unit = draw_unit("SN0001", 1, site=EarthField(horizontal_mg=600.0, dip_deg=60.0))

    assert math.hypot(*unit.magnetics.hard_iron_mg) < 1.1


def test_temperature_rises_to_its_end() -> None:
    unit = UNITS[0]

    assert unit.temperature_c(0.0) == unit.ambient_c
    assert unit.temperature_c(1e6) == pytest.approx(unit.ambient_c + unit.self_heating_c)
    assert unit.temperature_c(230.0) - unit.temperature_c(30.0) < 0.25


def test_pink_noise_has_unit_variance_and_the_same_power_in_each_octave() -> None:
    rng = np.random.default_rng(3)
    blocks = [pink_block(rng, 4) for _ in range(12)]
    power = np.mean(
        [
            (np.abs(np.fft.rfft(block - block.mean(axis=0), axis=0)) ** 2).mean(axis=1)
            for block in blocks
        ],
        axis=0,
    )
    octaves = [power[2**k : 2 ** (k + 1)].sum() for k in range(3, 10)]

    assert np.mean([block.var() for block in blocks]) == pytest.approx(1.0, rel=0.25)
    assert max(octaves) / min(octaves) < 2.5
    assert blocks[0].shape == (BLOCK, 4)


def test_normal_stream_is_normal_and_reproducible() -> None:
    first = NormalStream(np.random.default_rng(2))
    second = NormalStream(np.random.default_rng(2))
    values = [first() for _ in range(4000)]

    assert values == [second() for _ in range(4000)]
    assert np.mean(values) == pytest.approx(0.0, abs=0.06)
    assert np.std(values) == pytest.approx(1.0, rel=0.05)
