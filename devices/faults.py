"""The catalogue of faults that the simulator can be given.

A fault has a name, what it breaks in one sentence, and the measurement that is expected to
miss its limit first. Strength 1 is the full fault and 0 none; between, it scales as the
physics does. A fault of kind `field` that passes is no failure: the run repeats what it spoiled.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

AMID_RUN_TICK: Final = 3000
"""Start of faults that would not be noticed at power-on: in the middle of a run."""


class FaultKind(StrEnum):
    """Which part of the simulator a fault belongs to."""

    SENSOR = "sensor"
    ACCELEROMETER = "accelerometer"
    FIRMWARE = "firmware"
    RIG = "rig"
    FIELD = "field"
    SEAT = "seat"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One entry of the catalogue.

    Attributes
    ----------
    breaks : str
        What is broken at strength 1, in one sentence.
    detects : str
        Measurement or error of the bench that is expected first; where the run goes on and
        passes, the section of the record that says what was repeated.
    from_tick : int
        Tick at which it starts if none is named.
    passes : bool
        Whether a good unit passes all the same.
    """

    name: str
    kind: FaultKind
    breaks: str
    detects: str
    from_tick: int = 0
    passes: bool = False


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
            from_tick=AMID_RUN_TICK,
        ),
    ]


def _of_field() -> list[Fault]:
    return [
        Fault(
            name="forklift",
            kind=FaultKind.FIELD,
            breaks="A forklift drives up to 4 m from the rig, unloads for 20 s and drives on.",
            detects="field_watch",
            from_tick=AMID_RUN_TICK,
            passes=True,
        ),
        Fault(
            name="field_step",
            kind=FaultKind.FIELD,
            breaks="A steel rack is put down 4 m from the rig and stays.",
            detects="field_changed",
            from_tick=AMID_RUN_TICK,
        ),
        Fault(
            name="reference_silent",
            kind=FaultKind.FIELD,
            breaks="The station's reference magnetometer stops sending.",
            detects="reference_silent",
            from_tick=AMID_RUN_TICK,
        ),
    ]


def _of_seat() -> list[Fault]:
    """Return what no run on one seat can see: `bench_verify` does, by reversal."""
    return [
        Fault(
            name="seat_turned",
            kind=FaultKind.SEAT,
            breaks="The seat is turned by half a degree about down against the rig's inner axis.",
            detects="seat_index_change",
        ),
        Fault(
            name="fixture_iron",
            kind=FaultKind.SEAT,
            breaks="Iron of 3 mG sits in the fixture and turns with the seat.",
            detects="fixture_iron_change",
        ),
    ]


FAULTS: Final[dict[str, Fault]] = {
    fault.name: fault
    for fault in (*_of_axes(), *_single(), *_of_axis_names(), *_of_field(), *_of_seat())
}


def timed(active: ActiveFault) -> ActiveFault:
    """Return the fault with its own start where it names none."""
    return replace(active, tick=active.tick or active.fault.from_tick)


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
