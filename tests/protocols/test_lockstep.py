"""python-can's view of a wire, with the tools that users bring: cantools, canopen, UDS."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import can
import canopen as canopen_library
import cantools
import cantools.tester
import isotp
import pytest
import udsoncan
from udsoncan.client import Client
from udsoncan.connections import PythonIsoTpConnection

from protocols import canopen, compass, uds
from protocols.database import DBC_PATH, EDS_PATH
from protocols.e2e import E2eSender
from protocols.frame import EXTENDED, Frame
from protocols.lockstep import LockstepBus, wire_named

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def bus(request: pytest.FixtureRequest) -> Iterator[LockstepBus]:
    """Return a bus on a wire of the test's own."""
    bus = LockstepBus(request.node.name)
    yield bus
    bus.shutdown()


def test_a_port_hears_a_bus_and_a_bus_hears_a_port(bus: LockstepBus) -> None:
    port = bus.wire.attach()

    bus.send(can.Message(arbitration_id=0x18FF1080, is_extended_id=True, data=b"\x01\x02"))
    port.send(0x181, b"\x03")
    message = bus.recv(0)

    assert port.poll() == Frame(0, EXTENDED | 0x18FF1080, b"\x01\x02")
    assert message is not None
    assert (message.arbitration_id, message.is_extended_id, bytes(message.data)) == (
        0x181,
        False,
        b"\x03",
    )


def test_messages_carry_simulated_time(bus: LockstepBus) -> None:
    port = bus.wire.attach()
    bus.wire.now_ns = 2_500_000_000
    port.send(1, b"")

    message = bus.recv(0)

    assert message is not None
    assert message.timestamp == 2.5


def test_data_are_copied_so_that_a_sender_may_reuse_its_buffer(bus: LockstepBus) -> None:
    port = bus.wire.attach()
    buffer = bytearray(b"\x0f\x00")
    message = can.Message(arbitration_id=1, is_extended_id=False, data=buffer)

    bus.send(message)
    message.data[0] = 0x3F

    assert port.poll() == Frame(0, 1, b"\x0f\x00")


def test_two_receivers_do_not_share_their_data(bus: LockstepBus) -> None:
    other = LockstepBus(bus.channel)
    bus.wire.attach().send(1, b"\x01")

    first, second = bus.recv(0), other.recv(0)
    other.shutdown()

    assert first is not None
    assert second is not None
    first.data[0] = 9
    assert second.data == b"\x01"


def test_devices_on_the_wire_get_their_turn_after_a_send_and_on_an_empty_receive(
    bus: LockstepBus,
) -> None:
    device = bus.wire.attach()

    def serve() -> None:
        while (frame := device.poll()) is not None:
            device.send(frame.can_id + 1, frame.data)

    bus.wire.add_server(serve)

    bus.send(can.Message(arbitration_id=0x600, is_extended_id=False, data=b"\x40"))
    message = bus.recv(0)

    assert message is not None
    assert message.arbitration_id == 0x601


def test_another_thread_only_listens(bus: LockstepBus) -> None:
    served: list[int] = []
    bus.wire.add_server(lambda: served.append(threading.get_ident()))
    heard: list[can.Message | None] = []
    thread = threading.Thread(target=lambda: heard.append(bus.recv(10.0)))
    thread.start()

    bus.wire.attach().send(1, b"\x05")
    thread.join(10.0)

    assert [message and message.arbitration_id for message in heard] == [1]
    assert thread.ident not in served


def test_an_empty_receive_ends_after_its_timeout(bus: LockstepBus) -> None:
    start_s = time.monotonic()

    assert bus.recv(0.05) is None
    assert time.monotonic() - start_s >= 0.05


def test_filters_of_the_bus_are_obeyed(bus: LockstepBus) -> None:
    bus.set_filters([{"can_id": 0x181, "can_mask": 0x7FF, "extended": False}])
    port = bus.wire.attach()
    for can_id in (0x80, 0x181):
        port.send(can_id, b"")

    message = bus.recv(0.5)

    assert message is not None
    assert message.arbitration_id == 0x181


@pytest.mark.parametrize(
    "message",
    [
        can.Message(arbitration_id=1, is_remote_frame=True),
        can.Message(arbitration_id=1, is_error_frame=True),
        can.Message(arbitration_id=1, is_fd=True, data=bytes(12)),
    ],
    ids=["remote", "error", "fd"],
)
def test_what_is_no_classic_data_frame_is_refused(bus: LockstepBus, message: can.Message) -> None:
    with pytest.raises(can.CanOperationError, match="must be a classic data frame"):
        bus.send(message)


def test_wires_are_told_apart_by_name_and_forgotten_with_their_last_port() -> None:
    first, second = LockstepBus("left"), LockstepBus("right")
    left = first.wire

    assert left is wire_named("left") is not second.wire
    first.shutdown()
    second.shutdown()
    assert wire_named("left") is left


def test_a_bus_that_is_shut_down_twice_leaves_the_wire_once(bus: LockstepBus) -> None:
    other = LockstepBus(bus.channel)
    other.shutdown()
    other.shutdown()

    bus.send(can.Message(arbitration_id=1, data=b""))

    assert other.recv(0) is None


def test_cantools_tester_hears_the_module(bus: LockstepBus) -> None:
    tester_bus = LockstepBus(bus.channel)
    tester = cantools.tester.Tester(
        "CompassModule", cantools.database.load_file(DBC_PATH), tester_bus
    )
    tester.start()
    can_id = compass.mag_set_id(0x80)
    port = bus.wire.attach()
    port.send(can_id, compass.pack_counts(E2eSender(compass.data_id(can_id)), 4, 1024, -1024, 0))

    signals = tester.expect("MagSet", {"X": 100.0, "Y": -100.0, "Group": 4}, timeout=10.0)
    tester.stop()
    tester_bus.shutdown()

    assert signals is not None


def test_canopen_reads_and_writes_an_object_over_the_wire(bus: LockstepBus) -> None:
    """The library's master in this thread, our SDO payloads as the device."""
    device = bus.wire.attach()
    written: dict[int, bytes] = {}

    def serve() -> None:
        while (frame := device.poll()) is not None:
            request = canopen.unpack_sdo_request(frame.data)
            if frame.can_id != canopen.sdo_request_id(1) or request is None:
                continue
            index, subindex, value = request
            if value is None:
                answer = canopen.pack_sdo_uploaded(index, subindex, b"\x40\x02")
            else:
                written[index] = value
                answer = canopen.pack_sdo_downloaded(index, subindex)
            device.send(canopen.sdo_response_id(1), answer)

    bus.wire.add_server(serve)
    network = canopen_library.Network(bus)
    network.connect()
    node = canopen_library.RemoteNode(1, str(EDS_PATH))
    network.add_node(node)

    node.sdo[0x607A].raw = -90_000
    statusword = node.sdo[0x6041].raw
    network.notifier.stop(timeout=5.0)

    assert statusword == 0x0240
    assert written == {0x607A: (-90_000).to_bytes(4, "little", signed=True)}


def test_udsoncan_and_can_isotp_ask_a_server_over_the_wire(bus: LockstepBus) -> None:
    address = isotp.Address(
        isotp.AddressingMode.NormalFixed_29bits, source_address=0xF1, target_address=0x80
    )
    device = bus.wire.attach()

    def serve() -> None:
        while (frame := device.poll()) is not None:
            assert frame.can_id == uds.physical_request_id(0x80)
            device.send(uds.physical_response_id(0x80), bytes.fromhex("0562F18C5331CCCC"))

    bus.wire.add_server(serve)
    stack = isotp.CanStack(bus, address=address, params={"tx_padding": 0xCC})
    config = {"data_identifiers": {uds.DID_SERIAL: udsoncan.AsciiCodec(2)}}
    # the stack's own thread speaks; this one gives the devices their turn
    with Client(PythonIsoTpConnection(stack), request_timeout=10.0, config=config) as client:
        answers: list[object] = []
        asking = threading.Thread(
            target=lambda: answers.append(client.read_data_by_identifier_first(uds.DID_SERIAL))
        )
        asking.start()
        deadline_s = time.monotonic() + 10.0
        while asking.is_alive() and time.monotonic() < deadline_s:
            bus.wire.serve()
            time.sleep(0.001)
        asking.join(1.0)

    assert answers == ["S1"]
