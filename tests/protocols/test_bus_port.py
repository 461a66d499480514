"""Own frames that a bus gives back are known again and left out, foreign ones are not."""

from __future__ import annotations

from protocols.bus_port import EchoFilter


def test_an_echo_is_recognised_once() -> None:
    echoes = EchoFilter()
    echoes.sent(0x080, b"\x01")

    assert echoes.is_echo(0x080, b"\x01")
    assert not echoes.is_echo(0x080, b"\x01")


def test_foreign_frames_are_no_echoes() -> None:
    echoes = EchoFilter()
    echoes.sent(0x080, b"\x01")

    assert not echoes.is_echo(0x080, b"\x02")
    assert not echoes.is_echo(0x081, b"\x01")


def test_a_lost_echo_does_not_hide_the_later_ones() -> None:
    echoes = EchoFilter()
    for counter in range(1, 6):
        echoes.sent(0x080, bytes((counter,)))

    assert echoes.is_echo(0x080, b"\x03")  # 1 and 2 were lost
    assert not echoes.is_echo(0x080, b"\x02")
    assert echoes.is_echo(0x080, b"\x04")


def test_echoes_that_never_come_take_no_more_and_more_memory() -> None:
    echoes = EchoFilter()
    for number in range(10_000):
        echoes.sent(0x080, number.to_bytes(2, "little"))

    assert not echoes.is_echo(0x080, (0).to_bytes(2, "little"))
    assert echoes.is_echo(0x080, (9_999).to_bytes(2, "little"))
