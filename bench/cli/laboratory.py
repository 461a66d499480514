"""The virtual station of a paper's experiment: joins devices and bench on a wire of its own."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.bus import BenchBus
from bench.errors import ModuleSilent
from bench.module import Module
from bench.pose import Attitude
from bench.rig import Rig
from bench.sample_log import SampleLog
from bench.samples import COMPLETE, READING, reading_of
from bench.travel import RIG_PROFILE, AxisProfile
from devices.accelerometer import Accelerometer
from devices.bridge import BridgeParameters
from devices.coefficient_store import CoefficientStore
from devices.field import EarthField
from devices.host import Host
from devices.magnetics import Magnetics
from devices.mechanics import AxisMechanics, EncoderMap
from devices.rig import AZIMUTH_RATING, TILT_RATING, TILT_TRAVEL_DEG, RigMechanics
from devices.simulator import build_drives, module_of
from devices.unit import ModuleUnit
from devices.world import World
from protocols.clock import SimulatedClock
from protocols.j1939 import MODULE_ADDRESS
from protocols.link import Wire

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from bench.reproduction.setup import Setup
    from protocols.link import WirePort

SERIAL: Final = "PAPER"


class VirtualLaboratory:
    """Rig and module clients on an open bus, homed; see `bench.reproduction.laboratory`."""

    def __init__(self, bus: BenchBus, profiles: Mapping[str, AxisProfile] = RIG_PROFILE) -> None:
        self._bus = bus
        self.module = Module(bus)
        self.rig = Rig(bus, profiles=profiles)
        self._samples = SampleLog(None, self.module, self.rig)
        self._position = 0
        self.module.wait_ready(5.0)
        self.module.identity()
        self.rig.connect()
        self.rig.home()

    @property
    def now_s(self) -> float:
        """Time of the station in seconds."""
        return self._bus.now_s

    def measure(
        self, poses: Sequence[Attitude], *, dwell_s: float = 0.05, direction: int | None = None
    ) -> NDArray[np.void]:
        """Go to poses one after the other and return one READING each, shape (n,).

        Raises
        ------
        RigFault
            If a pose is not reached.
        ModuleSilent
            If fewer than two complete samples arrive at a pose.
        """
        rows = []
        for pose in poses:
            self.rig.move_to(pose, direction=direction)
            samples = self.listen(dwell_s)
            if len(samples) < 2:
                message = f"module sent {len(samples)} complete cycles in {dwell_s:g} s at {pose}"
                raise ModuleSilent(message)
            rows.append(reading_of(samples))
        return np.array(rows, dtype=READING)

    def listen(self, duration_s: float) -> NDArray[np.void]:
        """Stay where the rig is and return the complete SAMPLEs of a time, shape (n,)."""
        self._samples.begin_dwell(self._position)
        self._position += 1
        self._bus.run_for(duration_s)
        samples = self._samples.end_dwell()
        complete: NDArray[np.void] = samples[samples["complete"] == COMPLETE]
        return complete


@contextmanager
def open_laboratory(setup: Setup) -> Iterator[VirtualLaboratory]:
    """Build the station of a setup on a wire of its own; its links are closed at the end."""
    wire = Wire()
    link, device_link = wire.attach(), wire.attach()
    wire.add_server(_host(setup, device_link).serve)
    bus = BenchBus(link, SimulatedClock())
    try:
        yield VirtualLaboratory(bus, _profiles(setup))
    finally:
        bus.close()
        device_link.close()


def _profiles(setup: Setup) -> dict[str, AxisProfile]:
    azimuth = RIG_PROFILE["azimuth"]
    gentle = replace(azimuth, acceleration_dps2=setup.azimuth_acceleration_dps2)
    return {**RIG_PROFILE, "azimuth": gentle}


def _host(setup: Setup, link: WirePort) -> Host:
    field = EarthField(
        horizontal_mg=setup.horizontal_mg,
        dip_deg=setup.dip_deg,
        declination_deg=setup.declination_deg,
    )
    world = World(field, _rig(setup), vehicle_g=setup.acceleration_level_g)
    module, _ = module_of(_unit(setup), world, CoefficientStore(), MODULE_ADDRESS)
    return Host(world, [*build_drives(world, setup.seed), module], link)


def _rig(setup: Setup) -> RigMechanics:
    encoder = EncoderMap(harmonics=((0, setup.azimuth_error_deg, 0.0),))
    azimuth = AxisMechanics(
        "azimuth",
        max_velocity_dps=AZIMUTH_RATING[0],
        max_acceleration_dps2=AZIMUTH_RATING[1],
        encoder=encoder,
    )
    pitch, roll = (
        AxisMechanics(
            name,
            max_velocity_dps=TILT_RATING[0],
            max_acceleration_dps2=TILT_RATING[1],
            travel_deg=TILT_TRAVEL_DEG,
        )
        for name in ("pitch", "roll")
    )
    return RigMechanics((azimuth, pitch, roll))


def _unit(setup: Setup) -> ModuleUnit:
    x, y, z = (
        BridgeParameters(
            sensitivity=setup.sensitivity[axis],
            sensitivity_tempco_per_c=setup.sensitivity_tempco_per_c[axis],
            offset_mg=setup.offset_mg[axis],
            offset_tempco_mg_per_c=setup.offset_tempco_mg_per_c[axis],
            hk_mg=setup.hk_mg,
            cubic_per_mg2=setup.cubic_per_mg2[axis],
            hysteresis_mg=setup.hysteresis_mg,
            repeatability_mg=setup.repeatability_mg,
        )
        for axis in range(3)
    )
    a, b, c, d, e, f, g, h, i = setup.soft_iron
    return ModuleUnit(
        serial=SERIAL,
        seed=setup.seed,
        part=setup.part,
        bridges=(x, y, z),
        magnetics=Magnetics(soft_iron=(a, b, c, d, e, f, g, h, i), hard_iron_mg=setup.hard_iron_mg),
        accelerometer=Accelerometer(bias_g=setup.accel_bias_g, noise_g=setup.accel_noise_g),
        bits=setup.bits,
        range_mg=setup.range_mg,
        noise_mg=setup.noise_mg,
        ambient_c=setup.temperature_c,
        self_heating_c=0.0,
        accel_wander_g=0.0,
    )
