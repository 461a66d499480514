"""Drive profile CiA 402 (IEC 61800-7-201): objects, control and status words."""

from __future__ import annotations

from enum import Enum
from typing import Final

CONTROLWORD: Final = 0x6040
STATUSWORD: Final = 0x6041
MODE_OF_OPERATION: Final = 0x6060
MODE_DISPLAY: Final = 0x6061
POSITION_ACTUAL: Final = 0x6064
FOLLOWING_ERROR_WINDOW: Final = 0x6065
POSITION_WINDOW: Final = 0x6067
TARGET_POSITION: Final = 0x607A
SOFTWARE_LIMIT: Final = 0x607D
PROFILE_VELOCITY: Final = 0x6081
PROFILE_ACCELERATION: Final = 0x6083
HOMING_METHOD: Final = 0x6098
ABORT_CONNECTION_OPTION: Final = 0x6007
TARGET_VELOCITY: Final = 0x60FF
CONSUMER_HEARTBEAT: Final = 0x1016
PRODUCER_HEARTBEAT: Final = 0x1017
ERROR_REGISTER: Final = 0x1001
ERROR_CODE: Final = 0x603F
SUPPORTED_DRIVE_MODES: Final = 0x6502

PRODUCT_CODE: Final = 0x0000_0402
"""Object 1018h.02h of the shipped axes."""
REVISION_NUMBER: Final = 0x0001_0000
"""Object 1018h.03h of the shipped axes: 1.0."""

ABORT_QUICK_STOP: Final = 3
HOMING_AT_CURRENT_POSITION: Final = 37
HOMING_ON_INDEX_PULSE: Final = 33

COUNTS_PER_DEG: Final = 1000.0
"""Scale of the shipped axes: one position count is a thousandth of a degree."""

CW_SHUTDOWN: Final = 0x0006
CW_SWITCH_ON: Final = 0x0007
CW_ENABLE: Final = 0x000F
CW_QUICK_STOP: Final = 0x0002
CW_FAULT_RESET: Final = 0x0080
CW_NEW_SET_POINT: Final = 0x0010
CW_CHANGE_IMMEDIATELY: Final = 0x0020
CW_HOMING_START: Final = 0x0010
CW_HALT: Final = 0x0100

SW_FAULT: Final = 0x0008
SW_TARGET_REACHED: Final = 0x0400
SW_INTERNAL_LIMIT: Final = 0x0800
SW_SET_POINT_ACKNOWLEDGE: Final = 0x1000
SW_HOMING_ATTAINED: Final = 0x1000
SW_FOLLOWING_ERROR: Final = 0x2000
SW_HOMING_ERROR: Final = 0x2000

EMCY_FOLLOWING_ERROR: Final = 0x8611
EMCY_HEARTBEAT: Final = 0x8130
EMCY_SOFTWARE_LIMIT: Final = 0x8612


class Mode(int, Enum):
    """Modes of operation that the rig's drives have."""

    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6


class DriveState(Enum):
    """States of the power state machine; the value is (mask, pattern) of the status word."""

    NOT_READY = (0x4F, 0x00)
    SWITCH_ON_DISABLED = (0x4F, 0x40)
    READY_TO_SWITCH_ON = (0x6F, 0x21)
    SWITCHED_ON = (0x6F, 0x23)
    OPERATION_ENABLED = (0x6F, 0x27)
    QUICK_STOP_ACTIVE = (0x6F, 0x07)
    FAULT_REACTION = (0x4F, 0x0F)
    FAULT = (0x4F, 0x08)


def drive_state(statusword: int) -> DriveState:
    """Return the state that a status word shows."""
    for state in DriveState:
        mask, pattern = state.value
        if statusword & mask == pattern:
            return state
    return DriveState.NOT_READY
