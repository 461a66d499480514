"""The virtual module's physics as it is seen over CAN alone.

The station is made in this process; a strong field is brought near the module in its world.
Everything else, the turning of the rig as well, is asked for and observed over CAN.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.bus import BenchBus
from bench.module import Module
from bench.pose import Attitude
from bench.rig import Rig
from bench.sample_log import SampleLog
from bench.samples import COMPLETE
from devices.drive import Drive
from devices.host import Host
from devices.simulator import SimulatorOptions, build_module, build_world
from protocols import uds
from protocols.canopen import AXIS_NODES
from protocols.clock import SimulatedClock
from protocols.link import Wire

if TYPE_CHECKING:
    from devices.sensors import Sensors

HEADINGS_DEG = np.arange(0.0, 360.0, 15.0)
SWINGS = 5
STRONG_FIELD_MG = (9000.0, 0.0, 0.0)
FLIPS_ONLY_MA = 400
"""Enough to turn an ordered film round, too little to order a broken one."""
ORDERS_MA = 1000


@dataclass
class Station:
    """The bench's clients, and the sensors that a test may disturb."""

    bus: BenchBus
    module: Module
    rig: Rig
    log: SampleLog
    sensors: Sensors

    def reading(self, dwell_s=0.3):
        """Return the mean set and reset readings, mG, shape (2, 3)."""
        self.log.begin_dwell(0)
        self.bus.run_for(dwell_s)
        samples = self.log.end_dwell()
        samples = samples[samples["complete"] == COMPLETE]
        assert len(samples) >= 20
        return np.array([samples["set_mg"].mean(axis=0), samples["reset_mg"].mean(axis=0)])

    def swing(self, direction):
        """Turn once and return the readings in the order of HEADINGS_DEG, shape (n, 2, 3)."""
        turn = HEADINGS_DEG if direction > 0 else HEADINGS_DEG[::-1]
        # one heading before the first, so that the first is approached in this direction too
        self.rig.move_to(Attitude(azimuth_deg=float(turn[0] - 15.0 * direction)))
        readings = []
        for azimuth_deg in turn:
            self.rig.move_to(Attitude(azimuth_deg=float(azimuth_deg)), direction=direction)
            readings.append(self.reading())
        return np.array(readings[::direction])

    def amplitude_mg(self):
        """Return (set - reset)/2 of the three axes."""
        set_mg, reset_mg = self.reading()
        return (set_mg - reset_mg) / 2.0

    def pulse_with(self, current_ma):
        """Let the straps give one pair of pulses, by UDS."""
        self.module.diagnostics.unlock()
        self.module.diagnostics.routine(uds.ROUTINE_SET_RESET_PULSE, current_ma.to_bytes(2, "big"))

    def measure_with(self, current_ma):
        """Let every measuring cycle use pulses of this current, by UDS."""
        self.module.diagnostics.unlock()
        self.module.diagnostics.write_did(uds.DID_SET_RESET, struct.pack(">HB", current_ma, 1))


@pytest.fixture
def station():
    options = SimulatorOptions()
    world = build_world(options)
    module, sensors = build_module(options, world)
    drives = [Drive(node, axis) for node, axis in zip(AXIS_NODES, world.rig.axes, strict=True)]
    wire = Wire()
    wire.add_server(Host(world, [*drives, module], wire.attach()).serve)
    bus = BenchBus(wire.attach(), SimulatedClock())
    client, rig = Module(bus), Rig(bus)
    station = Station(bus, client, rig, SampleLog(None, client, rig), sensors)
    client.wait_ready()
    client.identity()
    rig.connect()
    rig.home()
    return station


def test_half_the_sum_of_set_and_reset_varies_as_the_product_of_the_fields(station):
    """V = p S H/(1 + p Ha/Hk) + b: (set + reset)/2 = b - H Ha/Hk (Caruso, cross-axis term)."""
    readings = station.swing(+1)
    field_mg = (readings[:, 0] - readings[:, 1]) / 2.0
    offset_mg = (readings[:, 0] + readings[:, 1]) / 2.0

    product_mg2 = field_mg[:, 0] * field_mg[:, 1]
    for axis in (0, 1):
        design = np.column_stack([np.ones(len(product_mg2)), product_mg2])
        (_, slope), *_ = np.linalg.lstsq(design, offset_mg[:, axis], rcond=None)
        left_mg = (
            offset_mg[:, axis] - design @ np.linalg.lstsq(design, offset_mg[:, axis], rcond=None)[0]
        )

        assert np.ptp(offset_mg[:, axis]) > 3.0, "it varies by milligauss"
        assert -1.0 / slope == pytest.approx(8000.0, rel=0.15)
        assert left_mg.std() < 0.05 * offset_mg[:, axis].std()


def test_clockwise_and_counter_clockwise_readings_differ_as_hysteresis_does(station):
    """A rising field is read lower than a falling one; twice the same way shows no such thing."""
    swings = {+1: [], -1: []}
    for _ in range(SWINGS):
        for direction, made in swings.items():
            made.append(station.swing(direction))
    level_mg = {
        direction: np.array(made)[:, :, 0, :2] - np.array(made)[:, :, 1, :2]
        for direction, made in swings.items()
    }
    clockwise_mg, back_mg = level_mg[+1] / 2.0, level_mg[-1] / 2.0
    mean_mg = clockwise_mg.mean(axis=0)
    steps_mg = np.roll(mean_mg, -1, axis=0) - np.roll(mean_mg, 1, axis=0)
    moves = np.abs(steps_mg) > 30.0  # away from the extremes, where the field turns back

    lag_mg = ((clockwise_mg - back_mg) * np.sign(steps_mg))[:, moves].ravel()
    same_mg = ((clockwise_mg[1:] - clockwise_mg[:-1]) * np.sign(steps_mg))[:, moves].ravel()

    assert lag_mg.mean() < -6.0 * lag_mg.std() / np.sqrt(len(lag_mg))
    assert -1.0 < lag_mg.mean() < -0.1
    assert abs(same_mg.mean()) < 4.0 * same_mg.std() / np.sqrt(len(same_mg))
    assert abs(same_mg.mean()) < 0.5 * abs(lag_mg.mean())


def test_a_strong_field_takes_signal_that_only_a_sufficient_pulse_brings_back(station):
    station.measure_with(FLIPS_ONLY_MA)
    before_mg = station.amplitude_mg()

    station.sensors.expose(STRONG_FIELD_MG)
    after_mg = station.amplitude_mg()
    station.pulse_with(FLIPS_ONLY_MA)
    weak_pulse_mg = station.amplitude_mg()
    station.pulse_with(ORDERS_MA)
    sufficient_pulse_mg = station.amplitude_mg()

    assert np.linalg.norm(after_mg) < 0.75 * np.linalg.norm(before_mg)
    assert weak_pulse_mg == pytest.approx(after_mg, abs=1.0)
    assert sufficient_pulse_mg == pytest.approx(before_mg, abs=3.0)


def test_a_module_with_its_own_pulse_recovers_from_a_strong_field_by_itself(station):
    before_mg = station.amplitude_mg()

    station.sensors.expose(STRONG_FIELD_MG)
    after_mg = station.amplitude_mg()

    assert after_mg == pytest.approx(before_mg, abs=3.0)


def test_a_pulse_too_weak_to_turn_the_film_makes_set_and_reset_alike(station):
    turned_mg = station.amplitude_mg()

    station.measure_with(100)

    assert np.linalg.norm(station.amplitude_mg()) < 0.1 * np.linalg.norm(turned_mg)
