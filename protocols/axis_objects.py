"""Object dictionary of one axis of the rig (`axis_eds` writes its data sheet).

The table holds what CiA 301 and CiA 402 ask of a servo drive that is commanded by RPDO 1,
answers SYNC with TPDO 1 and watches the bench's heartbeat. All objects fit an expedited SDO.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from protocols import cia402


class DataType(IntEnum):
    """Data types of CiA 301, table 44, that the drives use."""

    INTEGER8 = 0x02
    INTEGER16 = 0x03
    INTEGER32 = 0x04
    UNSIGNED8 = 0x05
    UNSIGNED16 = 0x06
    UNSIGNED32 = 0x07

    @property
    def size(self) -> int:
        """Length in bytes."""
        return {2: 1, 3: 2, 4: 4, 5: 1, 6: 2, 7: 4}[self.value]

    @property
    def signed(self) -> bool:
        """Whether the type holds negative numbers."""
        return self.value <= DataType.INTEGER32


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One variable of the object dictionary.

    `access` is "ro", "rw", "const" or "rww" (written by an RPDO); `default` is a number, or
    text with $NODEID; physical value = raw * factor, in `unit`.
    """

    name: str
    kind: DataType
    access: str
    default: int | str = 0
    mappable: bool = False
    unit: str = ""
    factor: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisObject:
    """One object: a variable (one entry), or an array or record (entries from subindex 1)."""

    index: int
    name: str
    entries: tuple[Entry, ...]
    object_type: int = 0x07


_ARRAY: Final = 0x08
_RECORD: Final = 0x09
_DEG: Final = 1.0 / cia402.COUNTS_PER_DEG

DEVICE_TYPE: Final = 0x0002_0192
"""Object 1000h: device profile 402, servo drive."""
SUPPORTED_MODES: Final = 0x25
"""Object 6502h: profile position (bit 0), profile velocity (bit 2), homing (bit 5)."""


def _variable(
    index: int,
    name: str,
    kind: DataType,
    access: str,
    default: int | str = 0,
    *,
    mappable: bool = False,
    unit: str = "",
    factor: float = 1.0,
) -> AxisObject:
    entry = Entry(
        name=name,
        kind=kind,
        access=access,
        default=default,
        mappable=mappable,
        unit=unit,
        factor=factor,
    )
    return AxisObject(index=index, name=name, entries=(entry,))


def _group(index: int, name: str, object_type: int, *entries: Entry) -> AxisObject:
    return AxisObject(index=index, name=name, entries=entries, object_type=object_type)


def _u32(name: str, access: str, default: int | str) -> Entry:
    return Entry(name=name, kind=DataType.UNSIGNED32, access=access, default=default)


def _u8(name: str, access: str, default: int) -> Entry:
    return Entry(name=name, kind=DataType.UNSIGNED8, access=access, default=default)


def _position(name: str, default: int) -> Entry:
    return Entry(
        name=name, kind=DataType.INTEGER32, access="rw", default=default, unit="deg", factor=_DEG
    )


_COMMUNICATION: Final = (
    _variable(0x1000, "Device type", DataType.UNSIGNED32, "const", DEVICE_TYPE),
    _variable(cia402.ERROR_REGISTER, "Error register", DataType.UNSIGNED8, "ro"),
    _variable(0x1005, "COB-ID SYNC message", DataType.UNSIGNED32, "const", 0x80),
    _variable(0x1014, "COB-ID EMCY", DataType.UNSIGNED32, "const", "$NODEID+0x80"),
    _group(
        cia402.CONSUMER_HEARTBEAT,
        "Consumer heartbeat time",
        _ARRAY,
        _u32("Node-ID << 16 | time in ms", "rw", 0),
    ),
    _variable(
        cia402.PRODUCER_HEARTBEAT, "Producer heartbeat time", DataType.UNSIGNED16, "rw", unit="ms"
    ),
    _group(
        0x1018,
        "Identity object",
        _RECORD,
        _u32("Vendor-ID", "const", 0),
        _u32("Product code", "const", cia402.PRODUCT_CODE),
        _u32("Revision number", "const", cia402.REVISION_NUMBER),
        _u32("Serial number", "ro", 0),
    ),
    _variable(0x1019, "Synchronous counter overflow value", DataType.UNSIGNED8, "const", 240),
    _group(
        0x1400,
        "RPDO 1 communication",
        _RECORD,
        _u32("COB-ID", "const", "$NODEID+0x200"),
        _u8("Transmission type", "const", 255),
    ),
    _group(
        0x1600,
        "RPDO 1 mapping",
        _RECORD,
        _u32("Controlword", "const", 0x6040_0010),
        _u32("Target position", "const", 0x607A_0020),
    ),
    _group(
        0x1800,
        "TPDO 1 communication",
        _RECORD,
        _u32("COB-ID", "const", "$NODEID+0x40000180"),
        _u8("Transmission type", "const", 1),
    ),
    _group(
        0x1A00,
        "TPDO 1 mapping",
        _RECORD,
        _u32("Statusword", "const", 0x6041_0010),
        _u32("Position actual value", "const", 0x6064_0020),
    ),
)

_PROFILE: Final = (
    _variable(
        cia402.ABORT_CONNECTION_OPTION,
        "Abort connection option code",
        DataType.INTEGER16,
        "rw",
        cia402.ABORT_QUICK_STOP,
    ),
    _variable(cia402.ERROR_CODE, "Error code", DataType.UNSIGNED16, "ro"),
    _variable(cia402.CONTROLWORD, "Controlword", DataType.UNSIGNED16, "rww", mappable=True),
    _variable(cia402.STATUSWORD, "Statusword", DataType.UNSIGNED16, "ro", mappable=True),
    _variable(
        cia402.MODE_OF_OPERATION,
        "Modes of operation",
        DataType.INTEGER8,
        "rw",
        cia402.Mode.PROFILE_POSITION.value,
    ),
    _variable(cia402.MODE_DISPLAY, "Modes of operation display", DataType.INTEGER8, "ro"),
    _variable(
        cia402.POSITION_ACTUAL,
        "Position actual value",
        DataType.INTEGER32,
        "ro",
        mappable=True,
        unit="deg",
        factor=_DEG,
    ),
    _variable(
        cia402.FOLLOWING_ERROR_WINDOW,
        "Following error window",
        DataType.UNSIGNED32,
        "rw",
        2_000,
        unit="deg",
        factor=_DEG,
    ),
    _variable(
        cia402.POSITION_WINDOW,
        "Position window",
        DataType.UNSIGNED32,
        "rw",
        50,
        unit="deg",
        factor=_DEG,
    ),
    _variable(
        cia402.TARGET_POSITION,
        "Target position",
        DataType.INTEGER32,
        "rww",
        mappable=True,
        unit="deg",
        factor=_DEG,
    ),
    _group(
        cia402.SOFTWARE_LIMIT,
        "Software position limit",
        _ARRAY,
        _position("Minimum position limit", -540_000),
        _position("Maximum position limit", 540_000),
    ),
    _variable(
        cia402.PROFILE_VELOCITY,
        "Profile velocity",
        DataType.UNSIGNED32,
        "rw",
        45_000,
        unit="deg/s",
        factor=_DEG,
    ),
    _variable(
        cia402.PROFILE_ACCELERATION,
        "Profile acceleration",
        DataType.UNSIGNED32,
        "rw",
        90_000,
        unit="deg/s2",
        factor=_DEG,
    ),
    _variable(
        cia402.HOMING_METHOD,
        "Homing method",
        DataType.INTEGER8,
        "rw",
        cia402.HOMING_ON_INDEX_PULSE,
    ),
    _variable(
        cia402.TARGET_VELOCITY,
        "Target velocity",
        DataType.INTEGER32,
        "rw",
        unit="deg/s",
        factor=_DEG,
    ),
    _variable(
        cia402.SUPPORTED_DRIVE_MODES,
        "Supported drive modes",
        DataType.UNSIGNED32,
        "const",
        SUPPORTED_MODES,
    ),
)

AXIS_OBJECTS: Final = (*_COMMUNICATION, *_PROFILE)
"""Every object of an axis, by index."""
