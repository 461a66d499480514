"""The in-process wire: order, time stamps, filters and turns of the servers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from protocols.frame import Frame
from protocols.link import Wire

if TYPE_CHECKING:
    from protocols.link import Link


def test_every_other_port_hears_a_frame_once_and_the_sender_does_not() -> None:
    wire = Wire()
    sender, first, second = wire.attach(), wire.attach(), wire.attach()

    sender.send(0x123, b"\x01")

    assert [port.poll() for port in (sender, first, second)] == [
        None,
        Frame(0, 0x123, b"\x01"),
        Frame(0, 0x123, b"\x01"),
    ]
    assert first.poll() is None


def test_frames_arrive_in_the_order_in_which_they_were_sent_by_anyone() -> None:
    wire = Wire()
    a, b, listener = wire.attach(), wire.attach(), wire.attach()

    for number in range(6):
        (a if number % 2 else b).send(number, b"")

    heard = [listener.poll() for _ in range(6)]
    assert [frame.can_id for frame in heard if frame] == list(range(6))


def test_frames_carry_the_time_of_the_wire() -> None:
    wire = Wire()
    sender, listener = wire.attach(), wire.attach()

    sender.send(1, b"")
    wire.now_ns = 10_000_000
    sender.send(2, b"")

    assert [listener.poll(), listener.poll()] == [Frame(0, 1, b""), Frame(10_000_000, 2, b"")]


def test_a_port_with_a_filter_hears_only_what_it_accepts() -> None:
    wire = Wire()
    sender, listener = wire.attach(), wire.attach(accepts={0x181, 0x182})

    for can_id in (0x80, 0x181, 0x201, 0x182):
        sender.send(can_id, b"")

    assert [frame.can_id for frame in listener.queue] == [0x181, 0x182]
    assert listener.hears(0x181)
    assert not listener.hears(0x80)


def test_a_port_that_comes_later_hears_known_identifiers_too() -> None:
    wire = Wire()
    sender, early = wire.attach(), wire.attach()
    sender.send(1, b"")
    late = wire.attach()

    sender.send(1, b"")

    assert (len(early.queue), len(late.queue)) == (2, 1)


def test_a_closed_port_hears_nothing_and_may_be_closed_twice() -> None:
    wire = Wire()
    sender, listener = wire.attach(), wire.attach()
    sender.send(1, b"")

    listener.close()
    listener.close()
    sender.send(1, b"")

    assert len(listener.queue) == 1


def echo_server(wire: Wire) -> tuple[Link, list[int]]:
    """Return a port that answers each frame with its identifier plus one, and its turns."""
    port = wire.attach()
    turns: list[int] = []

    def serve() -> None:
        turns.append(len(port.queue))
        while (frame := port.poll()) is not None:
            port.send(frame.can_id + 1, frame.data)

    wire.add_server(serve)
    return port, turns


def test_a_server_gets_its_turn_when_a_port_finds_nothing() -> None:
    wire = Wire()
    port = wire.attach()
    echo_server(wire)
    port.send(0x600, b"\x40")

    assert port.wait(1.0) == Frame(0, 0x601, b"\x40")
    assert port.poll() is None


def test_a_server_that_polls_starts_no_second_turn() -> None:
    wire = Wire()
    port = wire.attach()
    _, turns = echo_server(wire)

    port.send(1, b"")
    port.poll()

    assert turns == [1]


def test_a_server_gets_its_turns_again_after_one_of_them_has_failed() -> None:
    wire = Wire()
    port = wire.attach()
    turns: list[bool] = []

    def serve() -> None:
        turns.append(True)
        if len(turns) == 1:
            raise ZeroDivisionError

    wire.add_server(serve)
    try:
        port.poll()
    except ZeroDivisionError:
        turns.append(False)
    port.poll()

    assert turns == [True, False, True]


def test_a_removed_server_gets_no_turn() -> None:
    wire = Wire()
    port = wire.attach()
    turns: list[bool] = []

    def serve() -> None:
        turns.append(True)

    wire.add_server(serve)
    wire.remove_server(serve)
    wire.remove_server(serve)
    port.poll()

    assert turns == []
