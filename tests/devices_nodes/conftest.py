"""Stations for the tests of the nodes: a drive alone, and a whole simulator on a wire."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from devices.drive import Drive
from devices.mechanics import AxisMechanics
from devices.simulator import SimulatorOptions, build_host
from protocols import canopen, uds
from protocols.link import Wire
from protocols.sync import SYNC_DATA, SYNC_ID, TICK_DONE_ID, TICK_NS, TICK_S, sync_counter

if TYPE_CHECKING:
    from collections.abc import Callable

    from protocols.frame import Frame


class DriveStation:
    """One drive and its axis, ticked by hand."""

    node_id = 2

    def __init__(self, start_deg: float = 0.0) -> None:
        self.axis = AxisMechanics(
            "pitch", max_velocity_dps=45.0, max_acceleration_dps2=90.0, start_deg=start_deg
        )
        self.drive = Drive(self.node_id, self.axis, serial=77)
        self.t_ns = 0
        self.statusword = 0
        self.position = 0
        self.emergencies: list[int] = []

    def tick(self, count: int = 1) -> list[tuple[int, bytes]]:
        """Let ticks pass; return all frames sent."""
        frames: list[tuple[int, bytes]] = []
        for _ in range(count):
            self.t_ns += TICK_NS
            self.axis.step(TICK_S)
            self.drive.tick(self.t_ns, 0, lambda can_id, data: frames.append((can_id, data)))
            self.drive.sync(lambda can_id, data: frames.append((can_id, data)))
        for can_id, data in frames:
            if can_id == canopen.tpdo1_id(self.node_id):
                self.statusword, self.position = canopen.unpack_tpdo1(data)
            elif can_id == canopen.emergency_id(self.node_id):
                self.emergencies.append(int.from_bytes(data[:2], "little"))
        return frames

    def send(self, can_id: int, data: bytes) -> None:
        self.drive.receive(self.t_ns, can_id, data)

    def nmt(self, command: int, node_id: int = 0) -> None:
        self.send(canopen.NMT_ID, canopen.nmt_frame(command, node_id))

    def command(self, controlword: int, target: int = 0) -> None:
        """Send RPDO1 and let one tick pass."""
        self.send(canopen.rpdo1_id(self.node_id), canopen.pack_rpdo1(controlword, target))
        self.tick()

    def write(self, index: int, subindex: int, value: int, length: int) -> None:
        """Write an object; raise `SdoAbort` if the drive refuses."""
        data = value.to_bytes(length, "little", signed=value < 0)
        request = canopen.pack_sdo_download(index, subindex, data)
        canopen.unpack_sdo_response(self.node_id, self.drive.objects.answer(request))

    def read(self, index: int, subindex: int = 0) -> int:
        """Read an object as a signed number."""
        request = canopen.pack_sdo_upload(index, subindex)
        answer = canopen.unpack_sdo_response(self.node_id, self.drive.objects.answer(request))
        return int.from_bytes(answer[2], "little", signed=True)

    def enable(self) -> None:
        """Start the node and enable the drive."""
        self.nmt(canopen.NMT_START)
        for word in (0x06, 0x07, 0x0F):
            self.command(word)


class SimulatorStation:
    """A whole simulator on a wire, in lock-step."""

    def __init__(self, options: SimulatorOptions, wire: Wire | None = None) -> None:
        self.options = options
        self.wire = wire or Wire()
        self.host = build_host(options, self.wire.attach())
        self.wire.add_server(self.host.serve)
        self.port = self.wire.attach()
        self.ticks = 0

    def send(self, can_id: int, data: bytes) -> None:
        self.port.send(can_id, data)

    def tick(self, count: int = 1) -> list[Frame]:
        """Let ticks pass; return the frames without the tick-done frames."""
        frames: list[Frame] = []
        for _ in range(count):
            self.ticks += 1
            self.wire.now_ns += TICK_NS
            self.port.send(SYNC_ID, SYNC_DATA[sync_counter(self.ticks)])
            while (frame := self.port.poll()) is not None and frame.can_id != TICK_DONE_ID:
                frames.append(frame)
            assert frame is not None, "no tick-done frame"
        return frames

    def request(self, payload: bytes, ticks: int = 60) -> bytes:
        """Ask the module over UDS with plain ISO-TP frames; return the final answer."""
        request_id = uds.physical_request_id(self.options.address)
        response_id = uds.physical_response_id(self.options.address)
        for data in segments(payload):
            self.send(request_id, data)
        answer, expected = b"", 0
        for _ in range(ticks):
            for frame in self.tick():
                if frame.can_id != response_id:
                    continue
                kind, data = frame.data[0] >> 4, frame.data
                if kind == 0:
                    answer, expected = data[1 : 1 + data[0]], data[0]
                elif kind == 1:
                    expected = (data[0] & 15) << 8 | data[1]
                    answer = data[2:]
                    self.send(request_id, b"\x30\0\0".ljust(8, b"\xcc"))
                elif kind == 2:
                    answer = (answer + data[1:])[:expected]
                pending = answer[:1] == b"\x7f" and answer[2:3] == b"\x78"
                if expected and len(answer) == expected and not pending:
                    return answer
        return b""

    def unlock(self) -> None:
        """Enter the extended session and pass security access."""
        assert self.request(b"\x10\x03")[0] == 0x50
        seed = self.request(b"\x27\x01")[2:]
        assert self.request(b"\x27\x02" + uds.security_key(seed)) == b"\x67\x02"


def segments(payload: bytes) -> list[bytes]:
    """Return the ISO-TP frames of a message, sent without waiting for flow control."""
    if len(payload) <= 7:
        return [(bytes((len(payload),)) + payload).ljust(8, b"\xcc")]
    frames = [bytes((0x10 | len(payload) >> 8, len(payload) & 0xFF)) + payload[:6]]
    for number, start in enumerate(range(6, len(payload), 7), start=1):
        frames.append((bytes((0x20 | number & 15,)) + payload[start : start + 7]).ljust(8, b"\xcc"))
    return frames


@pytest.fixture
def drive_station() -> DriveStation:
    """Return a drive in power-on state."""
    return DriveStation()


@pytest.fixture
def make_drive_station() -> Callable[..., DriveStation]:
    """Return the class of drive stations."""
    return DriveStation


@pytest.fixture
def make_station() -> Callable[..., SimulatorStation]:
    """Return what makes a simulator from its options."""

    def make(wire: Wire | None = None, **options: object) -> SimulatorStation:
        return SimulatorStation(SimulatorOptions(**options), wire)  # type: ignore[arg-type]

    return make


@pytest.fixture
def booted(make_station: Callable[..., SimulatorStation]) -> SimulatorStation:
    """Return a simulator whose module has booted."""
    station = make_station()
    station.tick(40)
    return station
