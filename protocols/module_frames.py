"""Layout of the compass module's frames: SAE J1939 identifiers, E2E, and UDS' raw bytes."""

from __future__ import annotations

from typing import Final

from protocols import compass, j1939, uds
from protocols.frame_layout import FrameLayout, SignalLayout, raw_bytes, unsigned
from protocols.rig_frames import BENCH
from protocols.sync import TICK_DONE_ID

MODULE: Final = "CompassModule"
SIMULATOR: Final = "Simulator"

E2E_SIGNALS: Final = (
    unsigned("E2eCrc", 0, 8, comment="AUTOSAR E2E profile 1A, data ID = low 16 identifier bits"),
    unsigned("E2eCounter", 8, 4, comment="0..14"),
    unsigned("Group", 12, 4, comment="the same in all frames of one measuring cycle"),
)
_QUALITIES: Final = {
    compass.QUALITY_UNUSABLE: "unusable",
    compass.QUALITY_UNCALIBRATED: "uncalibrated",
    compass.QUALITY_CALIBRATED: "calibrated",
}
_FLAGS: Final = {
    "Synthesised": compass.FLAG_SYNTHESISED,
    "Saturated": compass.FLAG_SATURATED,
    "DefaultCoefficients": compass.FLAG_DEFAULT_COEFFICIENTS,
    "ReplayEnded": compass.FLAG_REPLAY_ENDED,
    "NoAcceleration": compass.FLAG_NO_ACCELERATION,
    "TwoAxis": compass.FLAG_TWO_AXIS,
}
_ABSENT: Final = {0xFFFF: "not available"}


def module_frames(address: int = j1939.MODULE_ADDRESS) -> tuple[FrameLayout, ...]:
    """Return the layout of every 29-bit frame of a module at a source address."""
    nominal = "nominal scale; data identifier 0104h holds the module's own"
    mag, g = compass.MAG_MG_PER_COUNT, compass.ACCEL_G_PER_COUNT
    return (
        _axes(compass.mag_set_id(address), "MagSet", mag, "mG", nominal),
        _axes(compass.mag_reset_id(address), "MagReset", mag, "mG", nominal),
        _axes(compass.acceleration_id(address), "Acceleration", g, "g", nominal),
        _heading(address),
        _status(address),
        _vehicle_direction(address),
        address_claimed_frame(j1939.address_claimed_id(address), "AddressClaimed", MODULE),
        request_frame(j1939.request_id(address), "Request"),
        *_diagnostics(address),
        _tick_done(),
    )


def _axes(can_id: int, name: str, scale: float, unit: str, comment: str) -> FrameLayout:
    axes = tuple(
        SignalLayout(name=axis, start=start, length=16, signed=True, scale=scale, unit=unit)
        for axis, start in (("X", 16), ("Y", 32), ("Z", 48))
    )
    return FrameLayout(
        can_id=can_id,
        name=name,
        length=8,
        sender=MODULE,
        cycle_ms=10,
        comment=comment,
        signals=(*E2E_SIGNALS, *axes),
    )


def _heading(address: int) -> FrameLayout:
    return FrameLayout(
        can_id=compass.heading_id(address),
        name="Heading",
        length=8,
        sender=MODULE,
        cycle_ms=10,
        comment="magnetic heading by the module's own coefficients",
        signals=(
            *E2E_SIGNALS,
            _angle("Heading", 16, 16, compass.HEADING_DEG_PER_COUNT, signed=False),
            _angle("Pitch", 32, 14, compass.PITCH_DEG_PER_COUNT, signed=True),
            _angle("Roll", 46, 14, compass.ROLL_DEG_PER_COUNT, signed=True),
            SignalLayout(name="Quality", start=60, length=4, values=_QUALITIES),
        ),
    )


def _angle(name: str, start: int, length: int, scale: float, *, signed: bool) -> SignalLayout:
    return SignalLayout(
        name=name, start=start, length=length, signed=signed, scale=scale, unit="deg"
    )


def _status(address: int) -> FrameLayout:
    flags = tuple(unsigned(name, 32 + mask.bit_length() - 1, 1) for name, mask in _FLAGS.items())
    temperature = SignalLayout(
        name="Temperature",
        start=0,
        length=16,
        signed=True,
        scale=compass.TEMPERATURE_C_PER_COUNT,
        unit="degC",
    )
    supply = SignalLayout(
        name="Supply", start=16, length=16, scale=compass.SUPPLY_V_PER_COUNT, unit="V"
    )
    return FrameLayout(
        can_id=compass.status_id(address),
        name="Status",
        length=8,
        sender=MODULE,
        cycle_ms=100,
        signals=(temperature, supply, *flags, unsigned("Boots", 40, 8), unsigned("Dtcs", 48, 8)),
    )


def _vehicle_direction(address: int) -> FrameLayout:
    return FrameLayout(
        can_id=compass.vehicle_direction_id(address),
        name="VehicleDirectionSpeed",
        length=8,
        sender=MODULE,
        cycle_ms=100,
        comment="PGN 65256 of SAE J1939-71, for other tools; the bench does not judge by it",
        signals=(
            _j1939("CompassBearing", 0, 1 / 128, 0.0, "deg", 165),
            _j1939("NavigationBasedVehicleSpeed", 16, 1 / 256, 0.0, "km/h", 517),
            _j1939("Pitch", 32, 1 / 128, -200.0, "deg", 583),
            _j1939("Altitude", 48, 0.125, -2500.0, "m", 580),
        ),
    )


def _j1939(name: str, start: int, scale: float, offset: float, unit: str, spn: int) -> SignalLayout:
    return SignalLayout(
        name=name,
        start=start,
        length=16,
        scale=scale,
        offset=offset,
        unit=unit,
        values=_ABSENT,
        spn=spn,
    )


def address_claimed_frame(can_id: int, name: str, sender: str) -> FrameLayout:
    """Return the layout of a node's address claim."""
    return FrameLayout(
        can_id=can_id,
        name=name,
        length=8,
        sender=sender,
        comment="PGN 60928 of SAE J1939-81: the 64-bit NAME",
        signals=(
            unsigned("IdentityNumber", 0, 21, comment="from the serial number"),
            unsigned("ManufacturerCode", 21, 11),
            unsigned("EcuInstance", 32, 3),
            unsigned("FunctionInstance", 35, 5),
            unsigned("Function", 40, 8),
            unsigned("VehicleSystem", 49, 7),
            unsigned("VehicleSystemInstance", 56, 4),
            unsigned("IndustryGroup", 60, 3),
            unsigned("ArbitraryAddressCapable", 63, 1),
        ),
    )


def request_frame(can_id: int, name: str, receiver: str = MODULE) -> FrameLayout:
    """Return the layout of the bench's request for a parameter group of a node."""
    return FrameLayout(
        can_id=can_id,
        name=name,
        length=3,
        sender=BENCH,
        receiver=receiver,
        comment="PGN 59904 of SAE J1939-21",
        signals=(unsigned("ParameterGroup", 0, 24),),
    )


def _diagnostics(address: int) -> tuple[FrameLayout, FrameLayout]:
    comment = "ISO 15765-2 frame of ISO 14229-1 diagnostics, as raw bytes"
    return (
        FrameLayout(
            can_id=uds.physical_request_id(address),
            name="UdsRequest",
            length=8,
            sender=BENCH,
            comment=comment,
            signals=raw_bytes(8),
        ),
        FrameLayout(
            can_id=uds.physical_response_id(address),
            name="UdsResponse",
            length=8,
            sender=MODULE,
            comment=comment,
            signals=raw_bytes(8),
        ),
    )


def _tick_done() -> FrameLayout:
    return FrameLayout(
        can_id=TICK_DONE_ID,
        name="TickDone",
        length=8,
        sender=SIMULATOR,
        cycle_ms=10,
        comment="lock-step only: the simulator's devices have all spoken",
        signals=(unsigned("Tick", 0, 32), unsigned("SyncCounter", 32, 8)),
    )
