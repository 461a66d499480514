"""The object dictionary of a rig drive, as its EDS lists it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from devices.object_dictionary import ABORT_VALUE, ObjectDictionary, SdoRefused
from protocols import canopen, cia402
from protocols.axis_objects import DEVICE_TYPE, SUPPORTED_MODES
from protocols.sync import SYNC_COUNTER_OVERFLOW, SYNC_ID

if TYPE_CHECKING:
    from collections.abc import Callable

    from devices.drive import Drive

VENDOR_ID: Final = 0x000000CB
NO_RTR: Final = 0x40000000
"""Bit 30 of a TPDO's COB-ID: it answers no remote frame."""

_PROFILE_OBJECTS: Final = (
    (cia402.FOLLOWING_ERROR_WINDOW, 0, "u32", "following_error_window", 0),
    (cia402.POSITION_WINDOW, 0, "u32", "position_window", 0),
    (cia402.TARGET_POSITION, 0, "i32", "target", None),
    (cia402.SOFTWARE_LIMIT, 1, "i32", "limit_low", None),
    (cia402.SOFTWARE_LIMIT, 2, "i32", "limit_high", None),
    (cia402.PROFILE_VELOCITY, 0, "u32", "profile_velocity", 1),
    (cia402.PROFILE_ACCELERATION, 0, "u32", "profile_acceleration", 1),
)
"""Index, subindex, kind, attribute of the profile and least value."""


def _writer(target: object, name: str, least: int | None) -> Callable[[int], None]:
    def write(value: int) -> None:
        if least is not None and value < least:
            raise SdoRefused(ABORT_VALUE)
        setattr(target, name, value)

    return write


def _reader(target: object, name: str) -> Callable[[], int]:
    def read() -> int:
        return int(getattr(target, name))

    return read


def drive_objects(drive: Drive) -> ObjectDictionary:
    """Return the objects of one drive, bound to its state."""
    objects = ObjectDictionary()
    _add_communication(objects, drive)
    _add_pdo_parameters(objects, drive.node_id)
    _add_profile(objects, drive)
    return objects


def _add_communication(objects: ObjectDictionary, drive: Drive) -> None:
    objects.constant(0x1000, 0, "u32", DEVICE_TYPE)
    objects.add(cia402.ERROR_REGISTER, 0, "u8", lambda: drive.error_register)
    objects.constant(0x1005, 0, "u32", SYNC_ID)
    objects.constant(0x1014, 0, "u32", canopen.emergency_id(drive.node_id))
    objects.constant(cia402.CONSUMER_HEARTBEAT, 0, "u8", 1)
    objects.add(cia402.CONSUMER_HEARTBEAT, 1, "u32", lambda: drive.consumer, drive.set_consumer)
    objects.add(
        cia402.PRODUCER_HEARTBEAT, 0, "u16", lambda: drive.heartbeat_ms, drive.set_heartbeat
    )
    identity = (VENDOR_ID, cia402.PRODUCT_CODE, cia402.REVISION_NUMBER, drive.serial)
    objects.constant(0x1018, 0, "u8", len(identity))
    for subindex, value in enumerate(identity, start=1):
        objects.constant(0x1018, subindex, "u32", value)
    objects.constant(0x1019, 0, "u8", SYNC_COUNTER_OVERFLOW)


def _add_pdo_parameters(objects: ObjectDictionary, node_id: int) -> None:
    pdos = (
        (0x1400, canopen.rpdo1_id(node_id), 255, (cia402.CONTROLWORD, cia402.TARGET_POSITION)),
        (
            0x1800,
            NO_RTR | canopen.tpdo1_id(node_id),
            1,
            (cia402.STATUSWORD, cia402.POSITION_ACTUAL),
        ),
    )
    for index, can_id, transmission, (word, position) in pdos:
        objects.constant(index, 0, "u8", 2)
        objects.constant(index, 1, "u32", can_id)
        objects.constant(index, 2, "u8", transmission)
        objects.constant(index + 0x200, 0, "u8", 2)
        objects.constant(index + 0x200, 1, "u32", word << 16 | 16)
        objects.constant(index + 0x200, 2, "u32", position << 16 | 32)


def _add_profile(objects: ObjectDictionary, drive: Drive) -> None:
    profile = drive.profile
    objects.add(
        cia402.ABORT_CONNECTION_OPTION,
        0,
        "i16",
        lambda: drive.abort_option,
        _choice(drive, "abort_option", range(4)),
    )
    objects.add(cia402.ERROR_CODE, 0, "u16", lambda: profile.error_code)
    objects.add(cia402.CONTROLWORD, 0, "u16", lambda: profile.controlword, profile.control)
    objects.add(cia402.STATUSWORD, 0, "u16", lambda: profile.statusword)
    objects.add(cia402.MODE_OF_OPERATION, 0, "i8", lambda: profile.mode, profile.set_mode)
    objects.add(cia402.MODE_DISPLAY, 0, "i8", lambda: profile.mode)
    objects.add(cia402.POSITION_ACTUAL, 0, "i32", lambda: profile.position)
    objects.constant(cia402.SOFTWARE_LIMIT, 0, "u8", 2)
    for index, subindex, kind, name, least in _PROFILE_OBJECTS:
        reader, writer = _reader(profile, name), _writer(profile, name, least)
        objects.add(index, subindex, kind, reader, writer)
    methods = (cia402.HOMING_ON_INDEX_PULSE, cia402.HOMING_AT_CURRENT_POSITION)
    objects.add(
        cia402.HOMING_METHOD,
        0,
        "i8",
        lambda: profile.homing_method,
        _choice(profile, "homing_method", methods),
    )
    objects.add(
        cia402.TARGET_VELOCITY,
        0,
        "i32",
        lambda: profile.target_velocity,
        profile.set_target_velocity,
    )
    objects.constant(cia402.SUPPORTED_DRIVE_MODES, 0, "u32", SUPPORTED_MODES)


def _choice(target: object, name: str, allowed: range | tuple[int, ...]) -> Callable[[int], None]:
    def write(value: int) -> None:
        if value not in allowed:
            raise SdoRefused(ABORT_VALUE)
        setattr(target, name, value)

    return write
