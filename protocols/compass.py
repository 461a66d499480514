"""The compass module's cyclic frames: 29-bit, proprietary B, E2E protected.

```
byte      0        1            2..3    4..5    6..7
MagSet    CRC-8    group|count  X       Y       Z        counts of the converter, set state
MagReset  CRC-8    group|count  X       Y       Z        counts of the converter, reset state
Accel     CRC-8    group|count  X       Y       Z        counts of the accelerometer
Heading   CRC-8    group|count  heading u16 | pitch s14 | roll s14 | quality u4
Status    temperature s16, supply u16, flags u8, boots u8, dtc count u8, reserved   (10 Hz)
VDS       PGN 65256: bearing u16, ground speed (n/a), pitch u16, altitude (n/a)      (10 Hz)
```
All values are little-endian. Set and reset readings, acceleration and heading of one
measuring cycle carry the same group.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final, NamedTuple

from protocols.errors import FrameError
from protocols.j1939 import PGN_VEHICLE_DIRECTION, pdu_id

if TYPE_CHECKING:
    from protocols.e2e import E2eSender

PGN_MAG_SET: Final = 0xFF10
PGN_MAG_RESET: Final = 0xFF11
PGN_ACCELERATION: Final = 0xFF12
PGN_HEADING: Final = 0xFF14
PGN_STATUS: Final = 0xFF20

MAG_MG_PER_COUNT: Final = 1600.0 / 16384.0
"""Nominal scale: 14 bits over +-800 mG."""
MAG_COUNT_LIMIT: Final = 8191
"""Converter's end of scale at the nominal resolution."""
ACCEL_G_PER_COUNT: Final = 1.0 / 16384.0
"""Nominal scale: +-2 g in 16 bits."""
HEADING_DEG_PER_COUNT: Final = 360.0 / 65536.0
PITCH_DEG_PER_COUNT: Final = 0.0125
ROLL_DEG_PER_COUNT: Final = 0.025

STATUS_PERIOD_TICKS: Final = 10

_COUNTS = struct.Struct("<2x3h")
_PAYLOAD = struct.Struct("<3h")
_HEADING = struct.Struct("<2xHI")
_HEADING_PAYLOAD = struct.Struct("<HI")
_STATUS = struct.Struct("<hHBBBB")
_VDS = struct.Struct("<HHHH")

TEMPERATURE_C_PER_COUNT: Final = 0.01
SUPPLY_V_PER_COUNT: Final = 0.001

FLAG_SYNTHESISED: Final = 0x01
"""Set and reset readings were made from one recorded value (+v and -v)."""
FLAG_SATURATED: Final = 0x02
FLAG_DEFAULT_COEFFICIENTS: Final = 0x04
FLAG_REPLAY_ENDED: Final = 0x08
FLAG_NO_ACCELERATION: Final = 0x10
"""The module has no accelerometer readings to send (a replayed recording without them)."""
FLAG_TWO_AXIS: Final = 0x20
"""The heading takes x and y alone: z of the field is measured only to check the estimate, and
z of the acceleration is not measured but completed as -sqrt(1 g^2 - ax^2 - ay^2)."""

PART_THREE_AXIS: Final = "CB-AMR3"
PART_TWO_AXIS: Final = "CB-AMR2"
"""Two magnetometers and two accelerometers make the heading (Cho & Park 2005, Fig. 3)."""
PARTS: Final = (PART_THREE_AXIS, PART_TWO_AXIS)
"""Part numbers of the modules that there are."""

QUALITY_UNUSABLE: Final = 0
QUALITY_UNCALIBRATED: Final = 1
QUALITY_CALIBRATED: Final = 3


def mag_set_id(source: int) -> int:
    """Return the identifier of the set reading."""
    return pdu_id(6, PGN_MAG_SET, source)


def mag_reset_id(source: int) -> int:
    """Return the identifier of the reset reading."""
    return pdu_id(6, PGN_MAG_RESET, source)


def acceleration_id(source: int) -> int:
    """Return the identifier of the acceleration."""
    return pdu_id(6, PGN_ACCELERATION, source)


def heading_id(source: int) -> int:
    """Return the identifier of the module's own heading."""
    return pdu_id(6, PGN_HEADING, source)


def status_id(source: int) -> int:
    """Return the identifier of temperature, supply and status."""
    return pdu_id(6, PGN_STATUS, source)


def vehicle_direction_id(source: int) -> int:
    """Return the identifier of PGN 65256."""
    return pdu_id(6, PGN_VEHICLE_DIRECTION, source)


def data_id(can_id: int) -> int:
    """Return the E2E data ID of a frame, from its group number's low byte and its source.

    >>> hex(data_id(mag_set_id(0x80)))
    '0x1080'
    """
    return can_id & 0xFFFF


def pack_counts(sender: E2eSender, group: int, x: int, y: int, z: int) -> bytes:
    """Return a protected frame of three 16-bit readings."""
    return sender.protect(group, _PAYLOAD.pack(x, y, z))


def unpack_counts(data: bytes) -> tuple[int, int, int]:
    """Return the three readings of MagSet, MagReset or Accel, in counts."""
    return _COUNTS.unpack(data)


def group_of(data: bytes) -> int:
    """Return the group 0..15 of a protected frame."""
    return data[1] >> 4


class HeadingCounts(NamedTuple):
    """The module's own heading, as on the wire."""

    heading: int
    pitch: int
    roll: int
    quality: int


def pack_heading(
    sender: E2eSender,
    group: int,
    heading_deg: float,
    pitch_deg: float,
    roll_deg: float,
    quality: int,
) -> bytes:
    """Return the protected heading frame; the heading wraps in counts, so 359.999 sends 0."""
    heading = round(heading_deg / HEADING_DEG_PER_COUNT) & 0xFFFF
    pitch = round(pitch_deg / PITCH_DEG_PER_COUNT) & 0x3FFF
    roll = round(roll_deg / ROLL_DEG_PER_COUNT) & 0x3FFF
    return sender.protect(group, _HEADING_PAYLOAD.pack(heading, pitch | roll << 14 | quality << 28))


def unpack_heading(data: bytes) -> HeadingCounts:
    """Return heading, pitch, roll and quality in counts; pitch and roll are signed."""
    heading, rest = _HEADING.unpack(data)
    pitch = rest & 0x3FFF
    roll = rest >> 14 & 0x3FFF
    return HeadingCounts(
        heading,
        pitch - 0x4000 if pitch & 0x2000 else pitch,
        roll - 0x4000 if roll & 0x2000 else roll,
        rest >> 28,
    )


class Status(NamedTuple):
    """Temperature, supply and state of the module."""

    temperature_c: float
    supply_v: float
    flags: int
    boots: int
    dtc_count: int


def pack_status(status: Status) -> bytes:
    """Return the status frame."""
    return _STATUS.pack(
        round(status.temperature_c / TEMPERATURE_C_PER_COUNT),
        round(status.supply_v / SUPPLY_V_PER_COUNT),
        status.flags,
        status.boots & 0xFF,
        status.dtc_count,
        0xFF,
    )


def unpack_status(data: bytes) -> Status:
    """Return temperature, supply, flags, boot count and number of trouble codes.

    Raises
    ------
    FrameError
        If the frame has not 8 bytes.
    """
    if len(data) != _STATUS.size:
        sentence = f"module status must be {_STATUS.size} bytes; instead received {len(data)}"
        raise FrameError(sentence)
    temperature, supply, flags, boots, dtc_count, _ = _STATUS.unpack(data)
    return Status(
        temperature * TEMPERATURE_C_PER_COUNT, supply * SUPPLY_V_PER_COUNT, flags, boots, dtc_count
    )


def pack_vehicle_direction(heading_deg: float, pitch_deg: float) -> bytes:
    """Return PGN 65256: bearing 1/128 deg, pitch 1/128 deg with offset -200; rest not available."""
    bearing = round(heading_deg * 128.0) % (360 * 128)
    pitch = round((pitch_deg + 200.0) * 128.0)
    return _VDS.pack(bearing, 0xFFFF, pitch, 0xFFFF)
