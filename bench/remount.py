"""Asks the operator to put the unit into the seat in another way."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from bench.calibration.mountings import Mounting
from bench.errors import BenchNotReady, BusFault, ConfigError
from protocols.remounting import (
    REMOUNT_DONE_ID,
    REMOUNT_ID,
    MountCode,
    RemountResult,
    pack_remount,
    unpack_remount_done,
)

if TYPE_CHECKING:
    from bench.bus import BenchBus
    from bench.run_context import RunContext
    from protocols.frame import Frame

REMOUNT_TIMEOUT_S: Final = 60.0
"""Simulated time that the virtual operator has."""
CODES: Final = {
    Mounting.AS_MARKED: MountCode.AS_MARKED,
    Mounting.TURNED: MountCode.TURNED,
    Mounting.TURNED_OVER: MountCode.TURNED_OVER,
}
SENTENCES: Final = {
    Mounting.AS_MARKED: "put the golden unit into the seat as marked, then press Enter",
    Mounting.TURNED: "turn the golden unit by 180 deg about its vertical axis in the seat, then "
    "press Enter",
    Mounting.TURNED_OVER: "turn the golden unit over by 180 deg about its forward axis, upside "
    "down and nose to the front, then press Enter",
}


def remount(context: RunContext, mounting: Mounting) -> None:
    """Have the unit remounted: by the virtual operator in lock-step, else by a person.

    Raises
    ------
    ConfigError
        If a person is needed and nobody is there to answer.
    BenchNotReady
        If the virtual operator cannot.
    BusFault
        If the simulator has no operator, or its answer cannot be read.
    """
    if context.bus.mode == "lockstep":
        _by_simulator(context.bus, mounting)
        return
    if context.ask is None:
        message = (
            f"step {context.step_name} needs an operator to mount the unit "
            f"{mounting.replace('_', ' ')}; instead received --no-input or no terminal: "
            "run it on a terminal"
        )
        raise ConfigError(message)
    context.event("prompt", text=SENTENCES[mounting], answer=context.ask(SENTENCES[mounting]))


def _by_simulator(bus: BenchBus, mounting: Mounting) -> None:
    answers: list[bytes] = []

    def heard(frame: Frame) -> None:
        answers.append(frame.data)

    bus.subscribe(REMOUNT_DONE_ID, heard)
    try:
        bus.send(REMOUNT_ID, pack_remount(CODES[mounting]))
        bus.run_until(
            lambda: bool(answers),
            REMOUNT_TIMEOUT_S,
            "the virtual operator has not remounted the unit",
            error=BusFault,
        )
    finally:
        bus.unsubscribe(REMOUNT_DONE_ID, heard)
    try:
        done, result = unpack_remount_done(answers[0])
    except ValueError as error:
        message = f"the virtual operator's answer cannot be read: {error}"
        raise BusFault(message) from error
    if result is not RemountResult.DONE or done is not CODES[mounting]:
        message = (
            f"the virtual operator must mount the unit {mounting.replace('_', ' ')}; instead it "
            f"answered {result.name.lower().replace('_', ' ')}, {done.name.lower()}"
        )
        raise BenchNotReady(message)
