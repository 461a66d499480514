"""The bus as other tools read it: `bus.dbc` and `rig_axis.eds`, beside this file.

`python -m protocols.database` writes both from the layouts in `rig_frames`, `module_frames`,
`reference_field` and `remounting` and the objects in `axis_objects`; a test holds the files
against them.

    candump -L vcan0 | cantools decode bus.dbc                   all frames, module at 80h
    candump -L vcan0 | cantools decode -m 0x1fffff00 bus.dbc     modules at any source address

The mask hides the low byte of 11-bit identifiers too: there SYNC is read as SYNC, and the
drives' PDOs, SDOs and heartbeats are read with the right signals under the last drive's name.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from protocols.axis_eds import axis_eds
from protocols.module_frames import MODULE, SIMULATOR, module_frames
from protocols.reference_field import REFERENCE, reference_frames
from protocols.remounting import remount_frames
from protocols.rig_frames import AXES, BENCH, drive_node, rig_frames

if TYPE_CHECKING:
    from collections.abc import Iterator

    from protocols.frame_layout import FrameLayout, SignalLayout

DBC_PATH: Final = Path(__file__).with_name("bus.dbc")
EDS_PATH: Final = Path(__file__).with_name("rig_axis.eds")
NODES: Final = (BENCH, *(drive_node(node_id) for node_id in AXES), MODULE, REFERENCE, SIMULATOR)

_FORMAT_STANDARD: Final = 0
_FORMAT_J1939: Final = 3


def bus_frames() -> tuple[FrameLayout, ...]:
    """Return the layout of every frame on the bus, each node at its default address."""
    operator = remount_frames(BENCH, SIMULATOR)
    return (*rig_frames(), *reference_frames(), *module_frames(), *operator)


def dbc_text() -> str:
    """Return the text of `bus.dbc`."""
    frames = bus_frames()
    sections = [
        'VERSION "compass-bench"',
        "NS_ :",
        "BS_:",
        f"BU_: {' '.join(NODES)}",
        *("\n".join(_frame_lines(frame)) for frame in frames),
        "\n".join(line for frame in frames for line in _comment_lines(frame)),
        "\n".join(_attribute_definitions()),
        "\n".join(line for frame in frames for line in _attribute_lines(frame)),
        "\n".join(line for frame in frames for line in _value_lines(frame)),
    ]
    return "\n\n".join(sections) + "\n"


def _frame_lines(frame: FrameLayout) -> Iterator[str]:
    yield f"BO_ {frame.can_id} {frame.name}: {frame.length} {frame.sender}"
    usual = MODULE if frame.sender == BENCH and frame.extended else BENCH
    receiver = frame.receiver or usual
    receiver = "Vector__XXX" if frame.sender == receiver else receiver
    for signal in frame.signals:
        yield _signal_line(signal, receiver)


def _signal_line(signal: SignalLayout, receiver: str) -> str:
    sign = "-" if signal.signed else "+"
    return (
        f" SG_ {signal.name} : {signal.start}|{signal.length}@1{sign} "
        f"({_number(signal.scale)},{_number(signal.offset)}) "
        f'[{_number(signal.minimum)}|{_number(signal.maximum)}] "{signal.unit}" {receiver}'
    )


def _comment_lines(frame: FrameLayout) -> Iterator[str]:
    if frame.comment:
        yield f'CM_ BO_ {frame.can_id} "{frame.comment}";'
    for signal in frame.signals:
        if signal.comment:
            yield f'CM_ SG_ {frame.can_id} {signal.name} "{signal.comment}";'


def _attribute_definitions() -> tuple[str, ...]:
    return (
        'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;',
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";',
        'BA_DEF_ SG_ "SPN" INT 0 524287;',
        'BA_DEF_DEF_ "GenMsgCycleTime" 0;',
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";',
        'BA_DEF_DEF_ "SPN" 0;',
    )


def _attribute_lines(frame: FrameLayout) -> Iterator[str]:
    if frame.cycle_ms:
        yield f'BA_ "GenMsgCycleTime" BO_ {frame.can_id} {frame.cycle_ms};'
    kind = _FORMAT_J1939 if frame.extended else _FORMAT_STANDARD
    yield f'BA_ "VFrameFormat" BO_ {frame.can_id} {kind};'
    for signal in frame.signals:
        if signal.spn is not None:
            yield f'BA_ "SPN" SG_ {frame.can_id} {signal.name} {signal.spn};'


def _value_lines(frame: FrameLayout) -> Iterator[str]:
    for signal in frame.signals:
        if signal.values:
            names = " ".join(f'{raw} "{name}"' for raw, name in sorted(signal.values.items()))
            yield f"VAL_ {frame.can_id} {signal.name} {names} ;"


def _number(value: float) -> str:
    return f"{value:.15g}"


def write_files() -> None:
    """Write `bus.dbc` and `rig_axis.eds`."""
    DBC_PATH.write_text(dbc_text(), encoding="ascii")
    EDS_PATH.write_text(axis_eds(), encoding="ascii")


if __name__ == "__main__":
    write_files()
