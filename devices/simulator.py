"""Builds a virtual station: a rig, a module in its field, and the host that runs them.

Everything random comes from the seed: the rig, the unit (with its serial number), the
noise and the diagnostics' seeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from devices.coefficient_store import CoefficientStore
from devices.drive import Drive
from devices.faults import FaultKind, parse_fault, timed
from devices.field import EarthField
from devices.field_faults import vehicle_of
from devices.firmware import Converters, Firmware
from devices.host import Host
from devices.module import CompassModule
from devices.operator import VirtualOperator
from devices.reference_magnetometer import ReferenceMagnetometer
from devices.replay import ReplaySensors
from devices.rig import draw_rig
from devices.seat import Seat
from devices.sensors import Sensors
from devices.unit import draw_unit, unit_stream
from devices.world import SlowDrift, World
from protocols.canopen import AXIS_NODES
from protocols.clock import MonotonicClock
from protocols.compass import PART_THREE_AXIS, PARTS
from protocols.j1939 import MODULE_ADDRESS
from protocols.reference_field import REFERENCE_ADDRESS
from protocols.sync import TICK_NS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from devices.faults import ActiveFault
    from devices.host import Node
    from devices.unit import ModuleUnit
    from protocols.clock import Clock
    from protocols.link import Link

LONGEST_SERIAL: Final = 32
SILENT_TICKS: Final = 500
"""The fault `module_silent` below strength 1 lasts for this number of ticks times it."""
_NOISE: Final = 2
_FIRMWARE: Final = 3
_REFERENCE_STREAM: Final = 0x5EF
"""Stream of the reference magnetometer: its own, so that no other node's numbers change by it."""
_OPERATOR_STREAM: Final = 0x0B5
_NEVER_NS: Final = 1 << 62
TURNED_DEG: Final = 0.5
"""Turn of the seat by the full fault `seat_turned`."""
FIXTURE_IRON_MG: Final = (2.0, -2.0, 1.0)
"""Iron of the full fault `fixture_iron`: 3 mG."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorOptions:
    """What the virtual station is made of.

    Attributes
    ----------
    serial : str
        Serial number of the module in the seat, 1 to 32 printable ASCII characters.
    seed : int
        Seed of the rig, the unit and every noise.
    part : str
        Part number of the module: CB-AMR3 has three axes, CB-AMR2 two.
    faults : tuple of str
        NAME[=strength][@tick] from `devices.faults`.
    nvm : Path, optional
        File of the module's non-volatile memory; kept in this process without one.
    replay : Path, optional
        Recording in the product's CSV that takes the place of the sensors.
    horizontal_mg, dip_deg, declination_deg : float
        Field of the site; the declination counts from the rig's zero.
    address : int
        J1939 source address of the module.
    drift : bool
        Whether the site's field drifts slowly.
    reference_address : int or None
        J1939 source address of the reference magnetometer; None leaves it out.
    seat : Seat
        Turn and iron of the seat; a square one without iron by default.
    seating_sd_deg : float
        Standard deviation of each of the three turns of a unit that is put in again, deg.

    Raises
    ------
    ValueError
        If a value cannot be; says which.
    """

    serial: str = "SN0001"
    seed: int = 1
    part: str = PART_THREE_AXIS
    faults: tuple[str, ...] = ()
    nvm: Path | None = None
    replay: Path | None = None
    horizontal_mg: float = 250.0
    dip_deg: float = 60.0
    declination_deg: float = 0.0
    address: int = MODULE_ADDRESS
    drift: bool = True
    reference_address: int | None = REFERENCE_ADDRESS
    seat: Seat = Seat()
    seating_sd_deg: float = 0.01

    def __post_init__(self) -> None:
        serial = self.serial
        if not (serial.isascii() and serial.isprintable() and 1 <= len(serial) <= LONGEST_SERIAL):
            message = (
                f"serial must be 1 to {LONGEST_SERIAL} printable ASCII characters; "
                f"instead received {serial!r}"
            )
            raise ValueError(message)
        if not 0 <= self.address <= 0xFD:
            message = f"address must be within 0 and 253; instead received {self.address}"
            raise ValueError(message)
        if self.address == self.reference_address:
            message = (
                "reference_address must not be the module's address; "
                f"instead received {self.address} for both"
            )
            raise ValueError(message)
        if not 0.0 <= self.seating_sd_deg <= 1.0:
            message = f"seating_sd_deg must be within 0 and 1 deg; instead {self.seating_sd_deg}"
            raise ValueError(message)
        if self.seed < 0:
            message = f"seed must be at least 0; instead received {self.seed}"
            raise ValueError(message)
        if self.part not in PARTS:
            message = f"part must be {' or '.join(PARTS)}; instead received {self.part!r}"
            raise ValueError(message)
        for specification in self.faults:
            fault = parse_fault(specification).fault
            if self.replay is not None and fault.kind in (
                FaultKind.SENSOR,
                FaultKind.ACCELEROMETER,
            ):
                message = (
                    f"fault {fault.name} breaks the sensor model, which a recording replaces; "
                    "leave out the fault or the recording"
                )
                raise ValueError(message)


class FaultSchedule:
    """Starts each fault at its tick, in the part of the simulator that it breaks."""

    def __init__(
        self,
        faults: Sequence[ActiveFault],
        world: World,
        sensors: object,
        module: CompassModule,
        reference: ReferenceMagnetometer | None = None,
    ) -> None:
        self._pending = sorted(map(timed, faults), key=lambda fault: fault.tick)
        self._world = world
        self._sensors = sensors
        self._module = module
        self._reference = reference
        self(0)

    def __call__(self, tick: int) -> None:
        """Start what is due at a tick."""
        while self._pending and self._pending[0].tick <= tick:
            self._start(self._pending.pop(0))

    def _start(self, active: ActiveFault) -> None:
        name = active.fault.name
        if name == "lost_write":
            self._module.firmware.lost_write = active.strength
        elif name == "module_silent":
            self._module.silence(*_silent_span(active))
        elif name == "reference_silent":
            if self._reference is not None:
                self._reference.silence(*_silent_span(active))
        elif active.fault.kind is FaultKind.SEAT:
            self._world.seat = worse_seat(self._world.seat, active)
        elif active.fault.kind is FaultKind.FIELD:
            if active.strength > 0.0:
                self._world.drive_up(vehicle_of(active))
        elif not self._world.rig.apply(active) and isinstance(self._sensors, Sensors):
            self._sensors.apply(active)


def worse_seat(seat: Seat, active: ActiveFault) -> Seat:
    """Return a seat with a fault of it at its strength."""
    if active.fault.name == "seat_turned":
        return replace(seat, index_deg=seat.index_deg + TURNED_DEG * active.strength)
    x, y, z = (
        own + more * active.strength
        for own, more in zip(seat.iron_mg, FIXTURE_IRON_MG, strict=True)
    )
    return replace(seat, iron_mg=(x, y, z))


def _silent_span(active: ActiveFault) -> tuple[int, int]:
    """Return the times from which and until which a node is silent."""
    from_ns = active.tick * TICK_NS
    ticks = int(SILENT_TICKS * active.strength)
    return from_ns, _NEVER_NS if active.strength >= 1.0 else from_ns + ticks * TICK_NS


def build_world(options: SimulatorOptions) -> World:
    """Return the site's field and the rig of these options."""
    field = EarthField(
        horizontal_mg=options.horizontal_mg,
        dip_deg=options.dip_deg,
        declination_deg=options.declination_deg,
    )
    drift = SlowDrift() if options.drift else None
    return World(field, draw_rig(options.seed), drift=drift, seat=options.seat)


def build_module(
    options: SimulatorOptions, world: World
) -> tuple[CompassModule, Sensors | ReplaySensors]:
    """Return the module of these options in a world, and what it measures with.

    Raises
    ------
    ValueError, OSError
        If a recording was asked for and is none, or cannot be read.
    """
    serial, seed = options.serial, options.seed
    store = CoefficientStore(options.nvm)
    if options.replay is not None:
        rng = unit_stream(serial, seed, _FIRMWARE)
        replay = ReplaySensors(options.replay)
        firmware = Firmware(
            serial,
            replay,
            store,
            rng,
            converters=replay.converters,
            replay=replay,
            part=options.part,
        )
        return CompassModule(firmware, address=options.address), replay
    unit = draw_unit(serial, seed, site=world.earth, part=options.part)
    return module_of(unit, world, store, options.address)


def build_drives(world: World, seed: int) -> list[Drive]:
    """Return the drives of a world's rig, in the order azimuth, pitch, roll."""
    return [
        Drive(node_id, axis, serial=seed * 8 + node_id & 0xFFFFFFFF)
        for node_id, axis in zip(AXIS_NODES, world.rig.axes, strict=True)
    ]


def module_of(
    unit: ModuleUnit, world: World, store: CoefficientStore, address: int
) -> tuple[CompassModule, Sensors]:
    """Return a module of a unit's parameters in a world, and its sensors."""
    serial, seed = unit.serial, unit.seed
    sensors = Sensors(unit, world, unit_stream(serial, seed, _NOISE))
    converters = Converters(
        mag_mg_per_count=unit.mag_mg_per_count,
        accel_g_per_count=unit.accel_g_per_count,
        mag_count_limit=2 ** (unit.bits - 1) - 1,
    )
    rng = unit_stream(serial, seed, _FIRMWARE)
    firmware = Firmware(serial, sensors, store, rng, converters=converters, part=unit.part)
    return CompassModule(firmware, address=address), sensors


def build_host(options: SimulatorOptions, links: Link | Sequence[Link]) -> Host:
    """Return the host: three drives, module, reference magnetometer, and the virtual operator.

    Parameters
    ----------
    options : SimulatorOptions
        What to build.
    links : Link or sequence of Link
        One for all nodes, or one for each device in that order; the operator, who is no device,
        is on the last one's.
    """
    world = build_world(options)
    module, sensors = build_module(options, world)
    reference = build_reference(options, world)
    faults = [parse_fault(specification) for specification in options.faults]
    schedule = FaultSchedule(faults, world, sensors, module, reference)
    at_tick = schedule if options.faults else None
    rng = np.random.default_rng((_OPERATOR_STREAM, options.seed))
    operator = VirtualOperator(world, rng, seating_sd_deg=options.seating_sd_deg)
    nodes: list[Node] = [*build_drives(world, options.seed), module]
    nodes += [operator] if reference is None else [reference, operator]
    if isinstance(links, Sequence):
        links = [*links, links[-1]]
    return Host(world, nodes, links, at_tick=at_tick)


def build_reference(options: SimulatorOptions, world: World) -> ReferenceMagnetometer | None:
    """Return the station's reference magnetometer, if it has one."""
    if options.reference_address is None:
        return None
    rng = np.random.default_rng((_REFERENCE_STREAM, options.seed))
    return ReferenceMagnetometer(world, rng, address=options.reference_address)


def simulate(
    options: SimulatorOptions,
    link: Link,
    *,
    free_running: bool,
    stop: Callable[[], bool],
    seconds: float | None = None,
    clock: Clock | None = None,
) -> Host:
    """Run a virtual station on a link until `stop()` or for some seconds of `clock`.

    The clock is the machine's monotonic one by default; lock-step uses it for `seconds` only.

    Returns the host, whose `tick_count` says how long it ran.

    Raises
    ------
    LinkError
        If the link breaks.
    """
    clock = clock or MonotonicClock()
    host = build_host(options, link)
    end_ns = None if seconds is None else clock.now_ns() + int(seconds * 1e9)

    def ended() -> bool:
        return stop() or (end_ns is not None and clock.now_ns() >= end_ns)

    if free_running:
        host.run_free(clock, ended)
    else:
        host.run_lockstep(ended)
    return host
