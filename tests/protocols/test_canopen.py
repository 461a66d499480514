"""CANopen payloads against the canopen library: its server answers us, its client asks us."""

from __future__ import annotations

from typing import TYPE_CHECKING

import canopen as canopen_library
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols import canopen
from protocols.database import EDS_PATH
from protocols.errors import FrameError, SdoAbort
from protocols.lockstep import LockstepBus

if TYPE_CHECKING:
    from collections.abc import Iterator

NODE = 2
sdo_values = st.binary(min_size=1, max_size=4)
indexes = st.integers(0, 0xFFFF)
subindexes = st.integers(0, 0xFF)


@pytest.fixture
def server() -> Iterator[tuple[canopen_library.LocalNode, LockstepBus]]:
    """Return a drive by the library with our data sheet, and a bus that hears its answers."""
    network = canopen_library.Network(LockstepBus("sdo"))
    node = canopen_library.LocalNode(NODE, str(EDS_PATH))
    network.add_node(node)
    tester = LockstepBus("sdo")
    yield node, tester
    network.bus.shutdown()
    tester.shutdown()


def answer_of(node: canopen_library.LocalNode, tester: LockstepBus, request: bytes) -> bytes:
    node.network.notify(canopen.sdo_request_id(NODE), bytearray(request), 0.0)
    message = tester.recv(0)
    assert message is not None
    assert message.arbitration_id == canopen.sdo_response_id(NODE)
    return bytes(message.data)


def test_identifiers_are_those_of_the_predefined_connection_set() -> None:
    # CiA 301, table 39: function code in bits 7..10
    assert canopen.emergency_id(1) == 0b0001 << 7 | 1
    assert canopen.tpdo1_id(1) == 0b0011 << 7 | 1
    assert canopen.rpdo1_id(1) == 0b0100 << 7 | 1
    assert canopen.sdo_response_id(1) == 0b1011 << 7 | 1
    assert canopen.sdo_request_id(1) == 0b1100 << 7 | 1
    assert canopen.heartbeat_id(canopen.BENCH_NODE) == 0b1110 << 7 | 0x7F


@given(st.integers(0, 0xFFFF), st.integers(-(2**31), 2**31 - 1))
def test_process_data_round_trip(word: int, position: int) -> None:
    assert canopen.unpack_tpdo1(canopen.pack_tpdo1(word, position)) == (word, position)
    assert canopen.unpack_rpdo1(canopen.pack_rpdo1(word, position)) == (word, position)


def test_process_data_are_little_endian() -> None:
    assert canopen.pack_tpdo1(0x0637, -1) == bytes.fromhex("3706FFFFFFFF")
    assert canopen.pack_rpdo1(0x001F, 90_000) == bytes.fromhex("1F00905F0100")
    assert canopen.nmt_frame(canopen.NMT_START, 0) == bytes.fromhex("0100")


def test_the_librarys_server_reads_an_object_for_us(
    server: tuple[canopen_library.LocalNode, LockstepBus],
) -> None:
    answer = answer_of(*server, canopen.pack_sdo_upload(0x1018, 2))

    index, subindex, value = canopen.unpack_sdo_response(NODE, answer)

    assert (index, subindex, int.from_bytes(value, "little")) == (0x1018, 2, 0x402)


@pytest.mark.parametrize(
    ("index", "value"),
    [
        (0x6060, b"\x06"),
        (0x6040, b"\x0f\x00"),
        (0x607A, (-90_000).to_bytes(4, "little", signed=True)),
    ],
)
def test_the_librarys_server_takes_what_we_write(
    server: tuple[canopen_library.LocalNode, LockstepBus], index: int, value: bytes
) -> None:
    node, tester = server

    answer = answer_of(node, tester, canopen.pack_sdo_download(index, 0, value))

    assert canopen.unpack_sdo_response(NODE, answer) == (index, 0, b"")
    assert node.get_data(index, 0) == value


def test_the_librarys_abort_reaches_us_as_an_error_with_its_code(
    server: tuple[canopen_library.LocalNode, LockstepBus],
) -> None:
    answer = answer_of(*server, canopen.pack_sdo_upload(0x5FFF, 0))

    with pytest.raises(SdoAbort, match=r"drive 2 refused object 5FFFh\.00h: object does not exist"):
        canopen.unpack_sdo_response(NODE, answer)


@given(indexes, subindexes, sdo_values)
def test_a_written_value_reaches_the_server(index: int, subindex: int, value: bytes) -> None:
    request = canopen.unpack_sdo_request(canopen.pack_sdo_download(index, subindex, value))

    assert request == (index, subindex, value)


@given(indexes, subindexes, sdo_values)
def test_a_read_value_reaches_the_client(index: int, subindex: int, value: bytes) -> None:
    request = canopen.unpack_sdo_request(canopen.pack_sdo_upload(index, subindex))
    answer = canopen.unpack_sdo_response(1, canopen.pack_sdo_uploaded(index, subindex, value))

    assert request == (index, subindex, None)
    assert answer == (index, subindex, value)


@pytest.mark.parametrize("code", sorted(canopen.SDO_SENTENCES))
def test_our_abort_means_to_the_library_what_we_say(code: int) -> None:
    with pytest.raises(SdoAbort) as caught:
        canopen.unpack_sdo_response(3, canopen.pack_sdo_abort(0x607A, 0, code))

    assert (caught.value.node_id, caught.value.index, caught.value.code) == (3, 0x607A, code)
    assert code in canopen_library.SdoAbortedError.CODES
    assert canopen.SDO_SENTENCES[code] in str(caught.value)


def test_an_abort_code_that_nobody_knows_is_still_shown() -> None:
    with pytest.raises(SdoAbort, match=r"unknown reason \(0BADC0DEh\)"):
        canopen.unpack_sdo_response(1, canopen.pack_sdo_abort(0x1000, 0, 0x0BADC0DE))


@pytest.mark.parametrize("length", [0, 5, 8])
def test_a_value_that_is_not_1_to_4_bytes_is_refused(length: int) -> None:
    with pytest.raises(FrameError, match=f"must be 1 to 4 bytes; instead received {length}"):
        canopen.pack_sdo_download(0x607A, 0, bytes(length))
    with pytest.raises(FrameError, match=f"must be 1 to 4 bytes; instead received {length}"):
        canopen.pack_sdo_uploaded(0x607A, 0, bytes(length))


def test_a_size_that_is_not_indicated_is_four_bytes() -> None:
    # CiA 301, 7.2.4.3.3: e = 1 and s = 0, as some drives answer
    assert canopen.unpack_sdo_request(bytes.fromhex("227A600001020304")) == (
        0x607A,
        0,
        b"\x01\x02\x03\x04",
    )
    assert canopen.unpack_sdo_response(1, bytes.fromhex("4264600001020304")) == (
        0x6064,
        0,
        b"\x01\x02\x03\x04",
    )


@pytest.mark.parametrize("data", [b"", bytes(7), bytes.fromhex("6000000000000000")])
def test_a_server_ignores_what_is_no_expedited_request(data: bytes) -> None:
    assert canopen.unpack_sdo_request(data) is None


def test_an_answer_that_is_none_is_refused_with_the_reason() -> None:
    with pytest.raises(FrameError, match="SDO answer of drive 1 must be 8 bytes"):
        canopen.unpack_sdo_response(1, bytes(4))
    with pytest.raises(FrameError, match="SDO answer of drive 1 has an unknown command 41h"):
        canopen.unpack_sdo_response(1, bytes.fromhex("4100100000000000"))
