"""Layout of the rig's frames: CANopen (CiA 301) with drives of CiA 402."""

from __future__ import annotations

from typing import Final

from protocols import canopen, cia402
from protocols.frame_layout import FrameLayout, SignalLayout, unsigned
from protocols.sync import SYNC_ID

BENCH: Final = "Bench"
AXES: Final = {
    canopen.AZIMUTH_NODE: "Azimuth",
    canopen.PITCH_NODE: "Pitch",
    canopen.ROLL_NODE: "Roll",
}

_NMT_STATES: Final = {
    canopen.STATE_BOOT: "boot-up",
    canopen.STATE_STOPPED: "stopped",
    canopen.STATE_OPERATIONAL: "operational",
    canopen.STATE_PRE_OPERATIONAL: "pre-operational",
}
_NMT_COMMANDS: Final = {
    canopen.NMT_START: "start",
    canopen.NMT_STOP: "stop",
    canopen.NMT_PRE_OPERATIONAL: "pre-operational",
    canopen.NMT_RESET_NODE: "reset node",
    canopen.NMT_RESET_COMMUNICATION: "reset communication",
}
_EMERGENCIES: Final = {
    0x0000: "no error",
    cia402.EMCY_HEARTBEAT: "heartbeat of the bench lost",
    cia402.EMCY_FOLLOWING_ERROR: "following error",
    cia402.EMCY_SOFTWARE_LIMIT: "software limit",
}


def drive_node(node_id: int) -> str:
    """Return the name of a drive as a node of the bus."""
    return f"{AXES[node_id]}Drive"


def rig_frames() -> tuple[FrameLayout, ...]:
    """Return the layout of every 11-bit frame; SYNC comes after NMT and EMCY.

    A tool that masks the low byte of identifiers (for the 29-bit source addresses) takes
    the last frame of each group of 256 for all of them, and SYNC is the most frequent.
    """
    drives = [
        frame for node_id in canopen.AXIS_NODES for frame in (*_pdo(node_id), *_service(node_id))
    ]
    return (_nmt(), *drives, _heartbeat(canopen.BENCH_NODE, "Bench", BENCH), _sync())


def _nmt() -> FrameLayout:
    return FrameLayout(
        can_id=canopen.NMT_ID,
        name="Nmt",
        length=2,
        sender=BENCH,
        signals=(
            SignalLayout(name="Command", start=0, length=8, values=_NMT_COMMANDS),
            SignalLayout(name="NodeId", start=8, length=8, values={0: "all"}),
        ),
    )


def _sync() -> FrameLayout:
    return FrameLayout(
        can_id=SYNC_ID,
        name="Sync",
        length=1,
        sender=BENCH,
        cycle_ms=10,
        signals=(unsigned("Counter", 0, 8, comment="1..240, object 1019h"),),
    )


def _pdo(node_id: int) -> tuple[FrameLayout, FrameLayout]:
    axis = AXES[node_id]
    scale = 1.0 / cia402.COUNTS_PER_DEG
    sent = FrameLayout(
        can_id=canopen.tpdo1_id(node_id),
        name=f"Tpdo1{axis}",
        length=6,
        sender=drive_node(node_id),
        cycle_ms=10,
        comment="Answer to each SYNC: objects 6041h and 6064h",
        signals=(unsigned("Statusword", 0, 16), _position("Position", scale)),
    )
    received = FrameLayout(
        can_id=canopen.rpdo1_id(node_id),
        name=f"Rpdo1{axis}",
        length=6,
        sender=BENCH,
        comment="Taken at once: objects 6040h and 607Ah",
        signals=(unsigned("Controlword", 0, 16), _position("TargetPosition", scale)),
    )
    return sent, received


def _position(name: str, scale: float) -> SignalLayout:
    return SignalLayout(name=name, start=16, length=32, signed=True, scale=scale, unit="deg")


def _service(node_id: int) -> tuple[FrameLayout, ...]:
    axis, node = AXES[node_id], drive_node(node_id)
    emergency = FrameLayout(
        can_id=canopen.emergency_id(node_id),
        name=f"Emergency{axis}",
        length=8,
        sender=node,
        signals=(
            SignalLayout(name="ErrorCode", start=0, length=16, values=_EMERGENCIES),
            unsigned("ErrorRegister", 16, 8),
            unsigned("ManufacturerError", 24, 40),
        ),
    )
    return (
        emergency,
        _sdo(canopen.sdo_request_id(node_id), f"SdoRequest{axis}", BENCH),
        _sdo(canopen.sdo_response_id(node_id), f"SdoResponse{axis}", node),
        _heartbeat(node_id, axis, node),
    )


def _sdo(can_id: int, name: str, sender: str) -> FrameLayout:
    signals = (
        unsigned("Command", 0, 8),
        unsigned("Index", 8, 16),
        unsigned("Subindex", 24, 8),
        unsigned("Data", 32, 32, comment="value, or the abort code where Command is 80h"),
    )
    return FrameLayout(can_id=can_id, name=name, length=8, sender=sender, signals=signals)


def _heartbeat(node_id: int, name: str, sender: str) -> FrameLayout:
    return FrameLayout(
        can_id=canopen.heartbeat_id(node_id),
        name=f"Heartbeat{name}",
        length=1,
        sender=sender,
        cycle_ms=100,
        signals=(SignalLayout(name="State", start=0, length=8, values=_NMT_STATES),),
    )
