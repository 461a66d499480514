"""The module's transport against can-isotp, and its time-outs and refusals."""

from __future__ import annotations

from collections import deque

import isotp
import pytest

from devices.isotp import IsoTpServer, separation_ns

SECOND_NS = 1_000_000_000
REQUEST, RESPONSE = 0x18DA80F1, 0x18DAF180


class Pair:
    """A server and can-isotp's transport joined by two queues."""

    def __init__(self, **server_options: int) -> None:
        self.to_server: deque[bytes] = deque()
        self.to_client: deque[bytes] = deque()
        self.server = IsoTpServer(self.to_client.append, **server_options)
        self.received: list[bytes] = []
        self.t_ns = 0
        address = isotp.Address(
            isotp.AddressingMode.NormalFixed_29bits, target_address=0x80, source_address=0xF1
        )
        self.errors: list[Exception] = []
        self.client = isotp.TransportLayerLogic(
            rxfn=self._receive,
            txfn=lambda message: self.to_server.append(bytes(message.data)),
            address=address,
            error_handler=self.errors.append,
            params={"tx_padding": 0xCC, "stmin": 0, "blocksize": 5},
        )

    def _receive(self, timeout: float = 0.0) -> isotp.CanMessage | None:
        del timeout
        if not self.to_client:
            return None
        return isotp.CanMessage(
            arbitration_id=RESPONSE, data=self.to_client.popleft(), extended_id=True
        )

    def run(self, rounds: int = 200) -> None:
        for _ in range(rounds):
            self.client.process()
            while self.to_server:
                message = self.server.receive(self.t_ns, self.to_server.popleft())
                if message is not None:
                    self.received.append(message)
            self.server.poll(self.t_ns)
            self.t_ns += 10_000_000


@pytest.mark.parametrize("length", [1, 6, 7, 8, 13, 14, 62, 63, 115, 200, 512])
@pytest.mark.parametrize("block_size", [0, 1, 8])
def test_every_length_arrives_from_can_isotp(length, block_size):
    pair = Pair(block_size=block_size)
    payload = bytes(index * 7 & 0xFF for index in range(length))

    pair.client.send(payload)
    pair.run()

    assert pair.received == [payload]
    assert pair.errors == []


@pytest.mark.parametrize("length", [1, 7, 8, 13, 14, 62, 63, 115, 512, 4095])
def test_every_length_arrives_at_can_isotp(length):
    pair = Pair()
    payload = bytes(index * 5 & 0xFF for index in range(length))

    pair.server.transmit(0, payload)
    pair.run(700)

    assert bytes(pair.client.recv()) == payload
    assert pair.errors == []


def _server(**options: int) -> tuple[IsoTpServer, list[bytes]]:
    sent: list[bytes] = []
    return IsoTpServer(sent.append, **options), sent


def test_every_frame_is_filled_to_eight_bytes():
    server, sent = _server()
    server.transmit(0, b"abc")
    server.transmit(0, bytes(10))
    server.receive(0, b"\x30\x00\x00")
    server.poll(0)

    assert sent == [
        b"\x03abc\xcc\xcc\xcc\xcc",
        b"\x10\x0a" + bytes(6),
        b"\x21" + bytes(4) + b"\xcc\xcc\xcc",
    ]


def test_the_peers_block_size_and_separation_are_kept():
    server, sent = _server()
    server.transmit(0, bytes(6 + 7 * 4))
    server.receive(0, b"\x30\x02\x14")
    times = []
    for t_ms in range(0, 200, 5):
        before = len(sent)
        server.poll(t_ms * 1_000_000)
        times += [t_ms] * (len(sent) - before)

    assert times == [0, 20], "two frames of the block, 20 ms apart"
    assert server.sending


@pytest.mark.parametrize(
    ("byte", "gap_ns"),
    [(0, 0), (0x7F, 127_000_000), (0xF1, 100_000), (0xF9, 900_000), (0xFA, 127_000_000)],
)
def test_separation_bytes_mean_what_the_standard_says(byte, gap_ns):
    assert separation_ns(byte) == gap_ns


def test_gives_up_after_one_second_without_flow_control():
    server, _ = _server()
    server.transmit(0, bytes(20))
    server.poll(SECOND_NS)
    assert server.sending

    server.poll(SECOND_NS + 1)

    assert not server.sending
    assert server.aborted == ["no flow control within 1.0 s"]


def test_wait_frames_prolong_the_patience_but_not_for_ever():
    server, _ = _server()
    server.transmit(0, bytes(20))
    server.receive(SECOND_NS // 2, b"\x31\0\0")
    server.poll(SECOND_NS + 1)
    assert server.sending

    for _ in range(10):
        server.receive(SECOND_NS, b"\x31\0\0")

    assert not server.sending
    assert server.aborted == ["the receiver asked to wait too often"]


@pytest.mark.parametrize(("status", "reason"), [(2, "overflow"), (7, "invalid flow status")])
def test_refused_messages_are_dropped(status, reason):
    server, _ = _server()
    server.transmit(0, bytes(20))

    server.receive(0, bytes((0x30 | status, 0, 0)))

    assert not server.sending
    assert server.aborted == [reason]


def test_gives_up_after_one_second_without_the_next_frame():
    server, _ = _server()
    server.receive(0, b"\x10\x14" + bytes(6))
    server.receive(SECOND_NS // 2, b"\x21" + bytes(7))
    server.poll(SECOND_NS + SECOND_NS // 2 + 1)

    assert server.aborted == ["no consecutive frame within 1.0 s"]
    assert server.receive(2 * SECOND_NS, b"\x22" + bytes(7)) is None


def test_a_wrong_sequence_number_drops_the_message():
    server, _ = _server()
    server.receive(0, b"\x10\x14" + bytes(6))
    assert server.receive(0, b"\x22" + bytes(7)) is None
    assert server.receive(0, b"\x21" + bytes(7)) is None

    assert server.aborted == ["sequence 2 where 1 was due"]


def test_too_long_a_message_is_answered_with_overflow():
    server, sent = _server(capacity=100)

    server.receive(0, b"\x10\x65" + bytes(6))

    assert sent == [b"\x32\0\0\xcc\xcc\xcc\xcc\xcc"]


def test_a_new_message_displaces_the_unfinished_one():
    server, _ = _server()
    server.receive(0, b"\x10\x14" + bytes(6))

    assert server.receive(0, b"\x02\x3e\x00") == b"\x3e\x00"
    assert server.receive(0, b"\x21" + bytes(7)) is None


@pytest.mark.parametrize(
    "data",
    [b"", b"\x00", b"\x05ab", b"\x0f" + bytes(7), b"\x10\x05" + bytes(6), b"\x21abc", b"\x30\0\0"],
)
def test_frames_that_mean_nothing_are_ignored(data):
    server, sent = _server()

    assert server.receive(0, data) is None
    assert server.idle
    assert sent == []
