"""The catalogue of faults that the simulator can be given.

A fault has a name, what it breaks in one sentence, and the measurement that is expected to
miss its limit first. Strength 1 is the full fault and 0 none; between, it scales as the
physics does.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final


class FaultKind(StrEnum):
    """Which part of the simulator a fault belongs to."""

    SENSOR = "sensor"
    ACCELEROMETER = "accelerometer"
    FIRMWARE = "firmware"
    RIG = "rig"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One entry of the catalogue.

    Attributes
    ----------
    breaks : str
        What is broken at strength 1, in one sentence.
    detects : str
        Measurement or error of the bench that is expected first.
    """

    name: str
    kind: FaultKind
    breaks: str
    detects: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ActiveFault:
    """A fault with its strength, from 0 (none) to 1 (full), and the tick of its start."""

    fault: Fault
    strength: float = 1.0
    tick: int = 0


def _of_axes() -> list[Fault]:
    faults = []
    for axis in "xyz":
        faults += [
            Fault(
                name=f"dead_strap_{axis}",
                kind=FaultKind.SENSOR,
                breaks=f"The set/reset strap of the {axis} bridge no longer flips its film.",
                detects=f"set_reset_amplitude_{axis}",
            ),
            Fault(
                name=f"stuck_axis_{axis}",
                kind=FaultKind.SENSOR,
                breaks=f"The {axis} bridge gives its offset whatever the field is.",
                detects=f"set_reset_amplitude_{axis}",
            ),
            Fault(
                name=f"inverted_axis_{axis}",
                kind=FaultKind.SENSOR,
                breaks=f"The {axis} bridge is connected the wrong way round.",
                detects=f"axis_sense_{axis}",
            ),
            Fault(
                name=f"accel_sign_{axis}",
                kind=FaultKind.ACCELEROMETER,
                breaks=f"The accelerometer's {axis} axis has the wrong sign.",
                detects=f"accel_sense_{axis}",
            ),
        ]
    return faults


def _of_axis_names() -> list[Fault]:
    return [
        Fault(
            name=f"axis_stalled_{axis}",
            kind=FaultKind.RIG,
            breaks=f"The rig's {axis} axis is stuck and no longer follows its drive.",
            detects="rig_fault",
        )
        for axis in ("azimuth", "pitch", "roll")
    ]


def _single() -> list[Fault]:
    return [
        Fault(
            name="swapped_axes",
            kind=FaultKind.SENSOR,
            breaks="The x and the y bridge are exchanged.",
            detects="axis_sense_x",
        ),
        Fault(
            name="excess_noise",
            kind=FaultKind.SENSOR,
            breaks="The bridges are twenty times as noisy as the data sheet says.",
            detects="noise_x",
        ),
        Fault(
            name="saturated_axis",
            kind=FaultKind.SENSOR,
            breaks="A magnetised part drives the converter of the x bridge to its end of scale.",
            detects="peak_reading",
        ),
        Fault(
            name="lost_write",
            kind=FaultKind.FIRMWARE,
            breaks="The module accepts new coefficients and does not store them.",
            detects="read_back",
        ),
        Fault(
            name="module_silent",
            kind=FaultKind.FIRMWARE,
            breaks="The module stops sending and answering.",
            detects="module_silent",
        ),
    ]


FAULTS: Final[dict[str, Fault]] = {
    fault.name: fault for fault in (*_of_axes(), *_single(), *_of_axis_names())
}


def parse_fault(specification: str) -> ActiveFault:
    """Return the fault of NAME[=strength][@tick].

    Raises
    ------
    ValueError
        If the name is not in the catalogue, the strength not within [0, 1], or the tick
        not a whole number of at least 0.

    >>> active = parse_fault("dead_strap_x=0.5@300")
    >>> active.fault.name, active.strength, active.tick
    ('dead_strap_x', 0.5, 300)
    """
    rest, at, tick_text = specification.strip().partition("@")
    name, equals, strength_text = rest.partition("=")
    fault = FAULTS.get(name.strip())
    if fault is None:
        raise ValueError(_unknown(name.strip()))
    strength = _strength(specification, strength_text) if equals else 1.0
    tick = _tick(specification, tick_text) if at else 0
    return ActiveFault(fault=fault, strength=strength, tick=tick)


def _unknown(name: str) -> str:
    close = difflib.get_close_matches(name, FAULTS, n=1, cutoff=0.4)
    hint = f"; did you mean {close[0]}?" if close else ""
    return f"fault must be a name of the catalogue; instead received {name!r}{hint}"


def _strength(specification: str, text: str) -> float:
    try:
        strength = float(text)
    except ValueError:
        strength = math.nan
    if not 0.0 <= strength <= 1.0:
        message = f"strength of {specification!r} must be within 0 and 1; instead received {text!r}"
        raise ValueError(message)
    return strength


def _tick(specification: str, text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        message = f"tick of {specification!r} must be a whole number; instead received {text!r}"
        raise ValueError(message)
    return int(text)
