"""Whether a lock-step simulator or free-running devices are on the bus."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from bench.errors import BusFault, ModuleSilent
from protocols.errors import LinkError
from protocols.sync import SYNC_DATA, SYNC_ID, TICK_DONE_ID

if TYPE_CHECKING:
    from bench.bus import Mode
    from protocols.clock import Clock
    from protocols.link import Link

PROBE_S: Final = 1.0
"""Wall time that the probe listens."""
_SLICE_S: Final = 0.1


def detect_mode(link: Link, clock: Clock, *, probe_s: float = PROBE_S) -> Mode:
    """Send one SYNC and say who answers: "lockstep" if a simulator's host does, else "free".

    A lock-step simulator makes one tick of this SYNC, whose frames are not kept: do it
    always or never where two runs are to be the same.

    Parameters
    ----------
    link : Link
        The bus on which SYNC is sent.
    clock : Clock
        The link's clock; not advanced.
    probe_s : float
        Wall time to listen; an in-process link answers at once.

    Raises
    ------
    ModuleSilent
        If nothing at all is on the bus.
    BusFault
        If the channel fails.
    """
    del clock
    try:
        link.send(SYNC_ID, SYNC_DATA[1])
        heard = _listen(link, probe_s)
    except LinkError as error:
        raise BusFault(str(error)) from error
    if heard is None:
        message = (
            f"nothing was heard on the bus for {probe_s:g} s: start the simulator or check "
            "power, wiring and bit rate"
        )
        raise ModuleSilent(message)
    return heard


def _listen(link: Link, probe_s: float) -> Mode | None:
    heard: Mode | None = None
    quiet_slices = 0
    deadline_s = time.monotonic() + probe_s
    while quiet_slices < round(probe_s / _SLICE_S) and time.monotonic() < deadline_s:
        frame = link.poll() or link.wait(_SLICE_S)
        if frame is None:
            quiet_slices += 1
        elif frame.can_id == TICK_DONE_ID:
            return "lockstep"
        else:
            heard = "free"
    return heard
