"""E2E profile 1A against an independent implementation (autosar-e2e) and its state rules."""

from __future__ import annotations

import pytest
from e2e import p01
from hypothesis import given
from hypothesis import strategies as st

from protocols.e2e import (
    COUNTER_MODULUS,
    MAX_DELTA_COUNTER,
    E2eReceiver,
    E2eSender,
    E2eState,
    crc8,
    data_id_seed,
)

DATA_ID = 0x1080
payloads = st.binary(min_size=6, max_size=6)


def frames(count: int, group: int = 3) -> list[bytes]:
    sender = E2eSender(DATA_ID)
    return [sender.protect(group, bytes(6)) for _ in range(count)]


@given(st.integers(0, 0xFFFF), st.integers(0, 15), payloads)
def test_what_we_protect_the_independent_implementation_accepts(
    data_id: int, group: int, payload: bytes
) -> None:
    frame = E2eSender(data_id).protect(group, payload)

    assert p01.e2e_p01_check(bytearray(frame), data_id, data_id_mode=p01.E2E_P01_DATAID_BOTH)


@given(st.integers(0, 0xFFFF), st.binary(min_size=7, max_size=7))
def test_what_the_independent_implementation_protects_we_accept(data_id: int, tail: bytes) -> None:
    frame = bytearray(b"\0" + tail)
    p01.e2e_p01_protect(
        frame, data_id, data_id_mode=p01.E2E_P01_DATAID_BOTH, increment_counter=False
    )

    assert E2eReceiver(data_id).check(bytes(frame)) is E2eState.OK


def test_the_other_data_id_modes_are_told_apart() -> None:
    frame = bytearray(8)
    p01.e2e_p01_protect(
        frame, DATA_ID, data_id_mode=p01.E2E_P01_DATAID_LOW, increment_counter=False
    )

    assert E2eReceiver(DATA_ID).check(bytes(frame)) is E2eState.ERROR


@given(payloads, st.integers(0, 63))
def test_every_single_bit_error_is_seen(payload: bytes, bit: int) -> None:
    frame = bytearray(E2eSender(DATA_ID).protect(9, payload))
    frame[bit // 8] ^= 1 << bit % 8

    receiver = E2eReceiver(DATA_ID)

    assert receiver.check(bytes(frame)) is E2eState.ERROR
    assert receiver.errors == 1


def test_a_frame_of_another_module_is_an_error() -> None:
    frame = E2eSender(0x1081).protect(0, bytes(6))

    assert E2eReceiver(0x1080).check(frame) is E2eState.ERROR


@pytest.mark.parametrize("length", [0, 7, 9])
def test_a_frame_of_another_length_is_an_error(length: int) -> None:
    assert E2eReceiver(DATA_ID).check(bytes(length)) is E2eState.ERROR


def test_the_counter_runs_0_to_14_and_the_group_is_beside_it() -> None:
    sent = frames(31, group=0xA)

    assert [frame[1] & 0x0F for frame in sent] == [n % COUNTER_MODULUS for n in range(31)]
    assert {frame[1] >> 4 for frame in sent} == {0xA}


def test_an_unbroken_stream_is_ok_across_the_wrap_of_the_counter() -> None:
    receiver = E2eReceiver(DATA_ID)

    assert {receiver.check(frame) for frame in frames(40)} == {E2eState.OK}
    assert (receiver.lost, receiver.errors, receiver.repeated) == (0, 0, 0)


@pytest.mark.parametrize(
    ("missing", "state"),
    [
        (1, E2eState.OK_SOME_LOST),
        (MAX_DELTA_COUNTER - 1, E2eState.OK_SOME_LOST),
        (MAX_DELTA_COUNTER, E2eState.WRONG_SEQUENCE),
        (13, E2eState.WRONG_SEQUENCE),
    ],
)
def test_missing_frames_are_counted_and_judged(missing: int, state: E2eState) -> None:
    sent = frames(missing + 3)
    receiver = E2eReceiver(DATA_ID)
    receiver.check(sent[0])

    assert receiver.check(sent[missing + 1]) is state
    assert receiver.lost == missing
    assert receiver.check(sent[missing + 2]) is E2eState.OK


def test_a_repeated_frame_is_told_and_not_usable() -> None:
    frame = frames(1)[0]
    receiver = E2eReceiver(DATA_ID)
    receiver.check(frame)

    state = receiver.check(frame)

    assert state is E2eState.REPEATED
    assert not state.usable
    assert (receiver.repeated, receiver.lost) == (1, 0)


def test_a_corrupted_frame_does_not_move_the_expected_counter() -> None:
    first, second, third = frames(3)
    receiver = E2eReceiver(DATA_ID)
    receiver.check(first)

    assert receiver.check(b"\xff" + bytes(7)) is E2eState.ERROR
    assert receiver.check(second) is E2eState.OK
    assert receiver.check(third) is E2eState.OK


def test_after_a_restart_any_counter_is_accepted() -> None:
    sent = frames(12)
    receiver = E2eReceiver(DATA_ID)
    receiver.check(sent[0])
    receiver.restart()

    assert receiver.check(sent[11]) is E2eState.OK
    assert receiver.lost == 0


def test_only_ok_and_ok_some_lost_are_usable() -> None:
    assert {state for state in E2eState if state.usable} == {E2eState.OK, E2eState.OK_SOME_LOST}


def test_crc_is_not_the_sae_j1850_crc_with_its_initial_value() -> None:
    # SAE J1850 starts with FFh and inverts; profile 1 does neither, so zeros stay zero
    assert crc8(data_id_seed(0), bytes(7)) == 0
    assert crc8(data_id_seed(0), bytes.fromhex("01")) == 0x1D
