"""Status words of CiA 402, table 30: which bits make which state."""

from __future__ import annotations

import pytest

from protocols import cia402
from protocols.cia402 import DriveState, drive_state

# xxxx xxxx x0xx 0000 and so on, with every bit that may be anything both clear and set
TABLE = {
    DriveState.NOT_READY: (0b0000_0000, 0b1011_0000),
    DriveState.SWITCH_ON_DISABLED: (0b0100_0000, 0b1111_0000),
    DriveState.READY_TO_SWITCH_ON: (0b0010_0001, 0b1011_0001),
    DriveState.SWITCHED_ON: (0b0010_0011, 0b1011_0011),
    DriveState.OPERATION_ENABLED: (0b0010_0111, 0b1011_0111),
    DriveState.QUICK_STOP_ACTIVE: (0b0000_0111, 0b1001_0111),
    DriveState.FAULT_REACTION: (0b0000_1111, 0b1011_1111),
    DriveState.FAULT: (0b0000_1000, 0b1011_1000),
}


@pytest.mark.parametrize("state", TABLE)
@pytest.mark.parametrize("upper_byte", [0x00, 0xFF])
def test_state_is_read_from_its_bits_whatever_the_others_are(
    state: DriveState, upper_byte: int
) -> None:
    for lower_byte in TABLE[state]:
        assert drive_state(upper_byte << 8 | lower_byte) is state


def test_no_status_word_is_two_states() -> None:
    for word in range(0x80):
        matches = [state for state in DriveState if word & state.value[0] == state.value[1]]
        assert len(matches) <= 1


def test_a_word_of_no_state_counts_as_not_ready() -> None:
    assert drive_state(0x0001) is DriveState.NOT_READY


def test_commands_are_the_bits_of_table_27() -> None:
    switch_on, voltage, quick_stop, operation = 0x1, 0x2, 0x4, 0x8
    assert voltage | quick_stop == cia402.CW_SHUTDOWN
    assert switch_on | voltage | quick_stop == cia402.CW_SWITCH_ON
    assert switch_on | voltage | quick_stop | operation == cia402.CW_ENABLE
    assert voltage == cia402.CW_QUICK_STOP
    assert cia402.CW_FAULT_RESET == 0x80


def test_modes_are_numbered_as_in_object_6060h() -> None:
    assert [mode.value for mode in cia402.Mode] == [1, 3, 6]
