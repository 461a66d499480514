"""The uncertainty on a certificate, held against virtual units and rigs in full: no white noise.

Coefficients are those of the unit's linear part, so that its own error at each pose is what the
sensor's cubic and cross-axis terms and the accelerometer's bend leave; the module's sensors are
read through a verification as a rig makes it, and e - eps is compared with its stated U.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.fit import Fit
from bench.samples import COMPLETE, READING, SAMPLE, reading_of
from bench.station import load_station
from bench.uncertainty.heading_budget import heading_budget
from bench.uncertainty.unit_data import UnitData
from devices.field import EarthField
from devices.rig import draw_rig
from devices.sensors import Sensors
from devices.unit import draw_unit, unit_stream
from devices.world import SlowDrift, World
from protocols.angles import wrap_180_deg

PART = UnitData(
    repeatability_mg=0.32,
    hysteresis_mg=0.16,
    converter_mg=0.0977,
    accel_tempco_g_per_c=0.002,
    accel_wander_g=3e-4,
)
RINGS = ((12, 7.5, 0.0, 0.0), (4, 22.5, 30.0, 0.0), (4, 52.5, -30.0, 0.0),
         (4, 37.5, 0.0, 30.0), (4, 67.5, 0.0, -30.0))  # fmt: skip
POSES = [
    (first + k * 360.0 / count, pitch, roll)
    for count, first, pitch, roll in RINGS
    for k in range(count)
]
UNITS = 16
ACROSS = (1, 0, 0)
"""Field across the x, y and z bridge, as the data sheet says."""


@dataclass
class Verification:
    """One virtual unit on one virtual rig, read at all poses."""

    number: int
    repeatability_mg: float = 0.32

    def __post_init__(self):
        serial, self.field = f"CERT{self.number}", EarthField()
        self.rig = draw_rig(self.number)
        phases = tuple(np.random.default_rng(self.number).uniform(0.0, 2.0 * np.pi, 2))
        self.world = World(self.field, self.rig, drift=SlowDrift(phases_rad=phases))
        unit = draw_unit(serial, self.number)
        bridges = tuple(replace(b, repeatability_mg=self.repeatability_mg) for b in unit.bridges)
        self.unit = replace(unit, bridges=bridges)
        self.sensors = Sensors(self.unit, self.world, unit_stream(serial, self.number, 2))
        self._t_ns = 0
        self.fit = linear_part(self.unit)

    def tick(self):
        self._t_ns += 10_000_000
        self.world.step(self._t_ns)
        return self.sensors.sample(self._t_ns / 1e9)

    def visit(self):
        """Return READING rows, true attitudes, and the mean zero of the accelerometer."""
        rows, attitudes, zeros_g = [], [], []
        for position, angles_deg in enumerate(POSES):
            for axis, angle_deg in zip(self.rig.axes, angles_deg, strict=True):
                axis.command(angle_deg)
            self.tick()
            while any(axis.moving for axis in self.rig.axes):
                self.tick()
            for _ in range(30):
                self.tick()
            rows.append(reading_of(self.dwell(position)))
            attitudes.append(np.reshape(self.rig.ned_from_body(), (3, 3)))
            zeros_g.append(list(self.sensors._wander_g))
        readings = np.array(rows, dtype=READING)
        return readings, np.array(attitudes), np.mean(zeros_g, axis=0)

    def dwell(self, position):
        samples = np.zeros(50, dtype=SAMPLE)
        samples["position"], samples["complete"] = position, COMPLETE
        for row in samples:
            set_counts, reset_counts, accel_counts = self.tick()
            row["t_s"] = self._t_ns / 1e9
            row["set_mg"] = np.multiply(set_counts, self.unit.mag_mg_per_count)
            row["reset_mg"] = np.multiply(reset_counts, self.unit.mag_mg_per_count)
            row["accel_g"] = np.multiply(accel_counts, self.unit.accel_g_per_count)
        samples["temperature_c"] = self.sensors.temperature_c
        for name, axis in zip(("azimuth", "pitch", "roll"), self.rig.axes, strict=True):
            samples[f"rig_{name}_deg"] = axis.encoder_deg
        field_mg = (samples["set_mg"] - samples["reset_mg"]) / 2.0
        samples["heading_deg"] = compensated_heading_deg(self.fit, field_mg, samples["accel_g"])
        return samples

    def own_error_deg(self, attitudes, temperature_c, zero_g):
        """Return eps: no noise, no repeatability, the middle of the play, the site's field."""
        errors = []
        for ned_from_body in attitudes:
            field_mg = self.unit.magnetics.sensor_field_mg(ned_from_body.T @ self.field.ned_mg)
            force_g = ned_from_body.T @ [0.0, 0.0, -1.0]
            accel_g = self.unit.accelerometer.level_g(tuple(force_g), temperature_c) + zero_g
            raw_mg = [
                half_difference_mg(bridge, field_mg[axis], field_mg[ACROSS[axis]], temperature_c)
                for axis, bridge in enumerate(self.unit.bridges)
            ]
            sent_deg = compensated_heading_deg(self.fit, np.array(raw_mg), np.array(accel_g))
            true_deg = np.rad2deg(np.arctan2(ned_from_body[1, 0], ned_from_body[0, 0]))
            errors.append(wrap_180_deg(sent_deg - true_deg))
        return np.array(errors)


def linear_part(unit):
    gain = np.diag([bridge.sensitivity for bridge in unit.bridges])
    sensor = gain @ np.reshape(unit.magnetics.soft_iron, (3, 3))
    return Fit(
        method="coefficients",
        offset_mg=gain @ np.array(unit.magnetics.hard_iron_mg),
        matrix=np.linalg.inv(sensor),
        accel_offset_g=np.array(unit.accelerometer.bias_g),
        accel_matrix=np.linalg.inv(np.reshape(unit.accelerometer.matrix, (3, 3))),
    )


def half_difference_mg(bridge, along_mg, across_mg, temperature_c):
    gain = bridge.sensitivity * (1.0 + bridge.sensitivity_tempco_per_c * (temperature_c - 25.0))
    seen_mg = gain * (along_mg + bridge.cubic_per_mg2 * along_mg**3)
    return seen_mg / (1.0 - (across_mg / bridge.hk_mg) ** 2)


def scatter(repeatability_mg, units=UNITS):
    """Return (e - eps) over its standard uncertainty, shape (units, poses); index and field known.

    The virtual rig is square to the field and its seat true: their lines are drawn here, from
    the station's record.
    """
    station, part = load_station("default"), replace(PART, repeatability_mg=repeatability_mg)
    found = []
    for number in range(units):
        one = Verification(number, repeatability_mg)
        readings, attitudes, zero_g = one.visit()
        budget = heading_budget(readings, one.fit, station, part)
        rng = np.random.default_rng(1000 + number)
        shared_deg = rng.normal(0.0, station.u_field_azimuth_deg / 2.0)
        shared_deg += rng.normal(0.0, station.seat.u_index_deg / 2.0)
        error_deg = readings["heading_deg"] - readings["rig_azimuth_deg"] + shared_deg
        warm_c = float(readings["temperature_c"].mean())
        own_deg = one.own_error_deg(attitudes, warm_c, zero_g)
        found.append(wrap_180_deg(error_deg - own_deg) / (budget.u_deg / 2.0))
    return np.array(found)


@pytest.fixture(scope="module")
def certified():
    return scatter(repeatability_mg=0.32)


@pytest.mark.parametrize("group", ["level", "tilted"])
def test_the_certificates_uncertainty_is_the_scatter_of_virtual_units(certified, group):
    level = np.array([pitch == roll == 0.0 for _, pitch, roll in POSES])
    rows = certified[:, level if group == "level" else ~level]

    # about three independent numbers a unit and group: sd of the RMS is 1/sqrt(2 * 3 * 16) = 0.10
    assert 0.8 < np.sqrt(np.mean(rows**2)) < 1.2


def test_the_certificates_intervals_hold_the_units_own_error_in_95_of_100(certified):
    assert 0.92 <= np.mean(np.abs(certified) <= 2.0) <= 0.98


def test_play_and_drift_are_stated_in_full_where_no_repeatability_covers_them():
    rows = scatter(repeatability_mg=0.0, units=8)

    assert 0.75 < np.sqrt(np.mean(rows**2)) < 1.25
