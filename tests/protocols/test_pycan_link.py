"""A link over python-can: adapters that work, that are missing and that fail in use."""

from __future__ import annotations

import errno
import os
import threading
import time
from collections import deque
from typing import TYPE_CHECKING

import can
import pytest

from protocols import bus_opening, pycan_link
from protocols.clock import SimulatedClock
from protocols.errors import LinkError
from protocols.frame import EXTENDED, Frame
from protocols.pycan_link import PyCanLink

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from protocols.link import Link


class AdapterBus(can.BusABC):
    """An adapter whose failures are scripted: what `send` raises, what `recv` gives."""

    def __init__(self) -> None:
        self.refusals: deque[can.CanError] = deque()
        self.sent: list[can.Message] = []
        self.arriving: deque[can.Message | can.CanError] = deque()
        self.channel_info = "adapter 1"
        super().__init__("adapter 1")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.refusals:
            raise self.refusals.popleft()
        self.sent.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self.arriving:
            time.sleep(min(timeout or 0.0, 0.005))
            return None, False
        next_one = self.arriving.popleft()
        if isinstance(next_one, can.CanError):
            raise next_one
        return next_one, False


@pytest.fixture
def adapter() -> Iterator[AdapterBus]:
    bus = AdapterBus()
    yield bus
    bus.shutdown()


@pytest.fixture
def link(adapter: AdapterBus) -> Iterator[PyCanLink]:
    with PyCanLink.on_bus(adapter) as link:
        yield link


def until(condition: Callable[[], bool], timeout_s: float = 10.0) -> bool:
    """Wait for another thread; return whether the condition came true."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline_s:
            return False
        time.sleep(0.002)
    return True


def full() -> can.CanOperationError:
    return can.CanOperationError("Failed to transmit", errno.ENOBUFS)


# ---- two ends of a bus -----------------------------------------------------------------------


def exchange(first: Link, second: Link) -> None:
    """Assert that frames of both lengths of identifier go both ways and do not come back."""
    first.send(0x181, b"\x01\x02")
    first.send(EXTENDED | 0x18FF1080, bytes(8))
    heard = [second.wait(10.0), second.wait(10.0)]
    second.send(0x201, b"")
    answer = first.wait(10.0)

    assert [(frame.can_id, frame.data) for frame in heard if frame] == [
        (0x181, b"\x01\x02"),
        (EXTENDED | 0x18FF1080, bytes(8)),
    ]
    assert answer is not None
    assert (answer.can_id, answer.data) == (0x201, b"")
    assert first.wait(0.05) is None
    assert second.wait(0.05) is None


@pytest.mark.parametrize("interface", ["virtual", "lockstep"])
def test_frames_are_exchanged_inside_the_process(interface: str) -> None:
    with PyCanLink(interface, "exchange") as first, PyCanLink(interface, "exchange") as second:
        exchange(first, second)

        assert threading.active_count() == 1 or not any(
            thread.name == "can exchange" for thread in threading.enumerate()
        )


def test_frames_are_exchanged_by_multicast_without_hearing_oneself() -> None:
    options = {"port": 43_000 + os.getpid() % 2_000}  # no other run hears us
    try:
        first = PyCanLink("udp_multicast", None, **options)
    except LinkError as error:
        pytest.skip(f"no multicast here: {error}")
    with first, PyCanLink("udp_multicast", None, **options) as second:
        exchange(first, second)


def test_frames_are_exchanged_through_serial_adapters(slcan_bus) -> None:  # type: ignore[no-untyped-def]
    left, right = slcan_bus.paths
    with (
        PyCanLink("slcan", left, bitrate=250_000, sleep_after_open=0) as first,
        PyCanLink("slcan", right, sleep_after_open=0) as second,
    ):
        exchange(first, second)

    assert "S5" in slcan_bus.commands[0]  # 250 kbit/s
    assert "S6" in slcan_bus.commands[1]  # 500 kbit/s, the default
    assert until(lambda: slcan_bus.commands[0][-1] == "C")


def test_a_bus_that_hears_its_own_messages_does_not_confuse_the_link() -> None:
    bus = can.Bus(interface="virtual", channel="own", receive_own_messages=True)
    with PyCanLink.on_bus(bus) as first, PyCanLink("virtual", "own") as second:
        exchange(first, second)


def test_a_frame_has_the_time_of_the_injected_clock_at_its_reception() -> None:
    clock = SimulatedClock(5)
    with (
        PyCanLink("virtual", "clocked") as sender,
        PyCanLink("virtual", "clocked", clock=clock) as receiver,
    ):
        sender.send(1, b"")
        clock.advance(10_000_000)

        assert receiver.poll() == Frame(10_000_005, 1, b"")


def test_polling_an_empty_link_returns_at_once(link: PyCanLink) -> None:
    start_s = time.monotonic()

    assert link.poll() is None
    assert time.monotonic() - start_s < 1.0


def test_waiting_ends_after_the_timeout(link: PyCanLink) -> None:
    start_s = time.monotonic()

    assert link.wait(0.05) is None
    assert time.monotonic() - start_s >= 0.049


def test_nothing_is_lost_while_nobody_reads(adapter: AdapterBus, link: PyCanLink) -> None:
    adapter.arriving.extend(
        can.Message(arbitration_id=number % 0x700, is_extended_id=False, data=b"")
        for number in range(2000)
    )

    assert until(lambda: not adapter.arriving)
    assert until(lambda: link.wait(0.0) is not None)
    assert sum(1 for _ in iter(link.poll, None)) == 1999


def test_remote_and_fd_frames_are_not_delivered() -> None:
    bus = can.Bus(interface="virtual", channel="odd")
    with PyCanLink("virtual", "odd") as link:
        bus.send(can.Message(arbitration_id=1, is_remote_frame=True))
        bus.send(can.Message(arbitration_id=2, is_fd=True, data=bytes(12)))
        bus.send(can.Message(arbitration_id=3, is_extended_id=False, data=b"\x07"))
        frame = link.poll()
    bus.shutdown()

    assert frame is not None
    assert (frame.can_id, frame.data) == (3, b"\x07")


# ---- what cannot be opened -------------------------------------------------------------------


def test_an_unknown_interface_is_named_with_a_near_one() -> None:
    with pytest.raises(LinkError, match=r"^interface sockectan does not exist in python-can: did"):
        PyCanLink("sockectan", "can0")


def test_an_interface_like_no_other_lists_those_that_there_are() -> None:
    with pytest.raises(LinkError, match=r"known are .*slcan.*socketcan"):
        PyCanLink("zzzzzz", "can0")


def test_an_adapter_that_is_not_there_is_one_sentence() -> None:
    with pytest.raises(LinkError) as caught:
        PyCanLink("slcan", "/dev/ttyNONE", sleep_after_open=0)

    sentence = str(caught.value)
    assert sentence.startswith("channel /dev/ttyNONE on interface slcan cannot be opened (")
    assert "\n" not in sentence
    assert sentence.endswith("name another with --interface and --channel")


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENODEV, "channel can9 does not exist on interface socketcan: bring it up with `ip"),
        (errno.EAFNOSUPPORT, "because this kernel has no SocketCAN"),
    ],
)
def test_each_failure_of_socketcan_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, number: int, words: str
) -> None:
    def refuse(**_: object) -> can.BusABC:
        raise OSError(number, "refused")

    monkeypatch.setattr(bus_opening, "_require_channel", lambda _: None)
    monkeypatch.setattr(can, "Bus", refuse)

    with pytest.raises(LinkError, match=words):
        PyCanLink("socketcan", "can9")


def test_a_link_error_is_an_os_error_with_its_cause() -> None:
    with pytest.raises(OSError, match="does not exist") as caught:
        PyCanLink("nothing like it", "can0")

    assert isinstance(caught.value, LinkError)


# ---- what fails in use -----------------------------------------------------------------------


def test_a_full_transmit_queue_is_waited_for_and_counted(
    adapter: AdapterBus, link: PyCanLink
) -> None:
    adapter.refusals.extend([full(), full(), full()])

    link.send(0x181, b"\x01")
    link.send(0x182, b"\x02")

    assert [message.arbitration_id for message in adapter.sent] == [0x181, 0x182]
    assert link.faults == ["send_blocked"]
    assert link.fault_counts == {"send_blocked": 1}


def test_several_frames_go_out_in_order_one_by_one_where_the_port_knows_no_batch(
    adapter: AdapterBus, link: PyCanLink
) -> None:
    link.send_all([(0x100, b"\x01"), (0x101, b""), (EXTENDED | 0x102, b"\x02")])

    sent = [(message.arbitration_id, bytes(message.data)) for message in adapter.sent]
    assert sent == [(0x100, b"\x01"), (0x101, b""), (0x102, b"\x02")]


class BatchPort:
    """A port that takes two frames at once, unless it is told to refuse."""

    def __init__(self, *refusals: int) -> None:
        self.refusals = deque(refusals)
        self.sent: list[tuple[int, bytes]] = []

    def send_many(self, frames: list[tuple[int, bytes]]) -> int:
        if self.refusals and (number := self.refusals.popleft()):
            raise OSError(number, os.strerror(number))
        self.sent += frames[:2]
        return len(frames[:2])

    def send(self, can_id: int, data: bytes) -> None:
        self.sent.append((can_id, data))


@pytest.mark.parametrize("refusals", [(), (errno.ENOBUFS,), (0, errno.ENOBUFS)])
def test_a_batch_that_is_taken_in_part_is_sent_to_its_end_once_and_in_order(
    link: PyCanLink, monkeypatch: pytest.MonkeyPatch, refusals: tuple[int, ...]
) -> None:
    frames = [(0x100 + number, bytes((number,))) for number in range(5)]
    port = BatchPort(*refusals)
    with monkeypatch.context() as patch:
        patch.setattr(link, "_port", port)
        with link._reading:  # the reader thread leaves the port alone
            link.send_all(frames)

    assert port.sent == frames
    assert link.fault_counts == ({"send_blocked": 1} if any(refusals) else {})


def test_a_batch_that_is_refused_for_another_reason_is_an_error(
    link: PyCanLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    with link._reading, monkeypatch.context() as patch:
        patch.setattr(link, "_port", BatchPort(errno.ENETDOWN))
        with pytest.raises(LinkError, match="refuses a frame: Network is down"):
            link.send_all([(0x100, b"")])


def test_a_transmit_queue_that_stays_full_is_an_error_after_the_deadline(
    adapter: AdapterBus, link: PyCanLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pycan_link, "SEND_DEADLINE_S", 0.05)
    adapter.refusals.extend(full() for _ in range(10_000))

    with pytest.raises(LinkError, match=r"adapter 1 .* took no frame for 0\.05 s: Failed to trans"):
        link.send(0x181, b"")


def test_any_other_refusal_is_an_error_at_once(adapter: AdapterBus, link: PyCanLink) -> None:
    adapter.refusals.append(can.CanOperationError("Failed to transmit", errno.ENETDOWN))

    with pytest.raises(LinkError, match="refuses a frame: Failed to transmit; check that it is up"):
        link.send(0x181, b"")
    assert link.faults == []


def test_a_reader_that_fails_is_an_error_for_whoever_waits_polls_or_sends(
    adapter: AdapterBus, link: PyCanLink
) -> None:
    adapter.arriving.append(can.Message(arbitration_id=1, is_extended_id=False, data=b""))
    adapter.arriving.append(can.CanOperationError("Failed to receive: Network is down", 100))

    frame = link.wait(10.0)  # what came before the failure is delivered

    assert frame is not None
    assert frame.can_id == 1
    with pytest.raises(LinkError, match="cannot be read: Failed to receive: Network is down"):
        link.wait(10.0)
    with pytest.raises(LinkError, match="cannot be read"):
        link.poll()
    with pytest.raises(LinkError, match="cannot be read"):
        link.send(1, b"")


def test_error_frames_are_counted_and_not_delivered(adapter: AdapterBus, link: PyCanLink) -> None:
    for error_class, state in ((0x004, 0x10), (0x040, 0), (0x004, 0x01), (0x004, 0x40)):
        adapter.arriving.append(
            can.Message(
                arbitration_id=error_class, is_error_frame=True, data=bytes((0, state)) + bytes(6)
            )
        )
    adapter.arriving.append(can.Message(arbitration_id=0x181, is_extended_id=False, data=b""))

    frame = link.wait(10.0)

    assert frame is not None
    assert frame.can_id == 0x181
    assert link.faults == ["error_passive", "bus_off", "controller_overflow"]
    assert link.dropped == 0


def test_a_closed_link_may_be_closed_again_and_sends_no_more(adapter: AdapterBus) -> None:
    link = PyCanLink.on_bus(adapter)
    link.close()
    link.close()

    with pytest.raises(LinkError, match="is closed: open a new link"):
        link.send(1, b"")
    assert not any(thread.name == "can adapter 1" for thread in threading.enumerate())
