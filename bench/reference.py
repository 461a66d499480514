"""The station's reference magnetometer as the bench hears it.

A fixed node that sends the field at its place every 10 ms (`protocols.reference_field`). Each
frame is checked end to end; what does not pass is not used. Its axes are its own: only changes
of its readings say anything about the field at the rig.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.address_claims import AddressClaims
from bench.errors import ReferenceSilent
from protocols.compass import data_id, unpack_counts
from protocols.e2e import E2eReceiver, E2eState
from protocols.reference_field import REFERENCE_MG_PER_COUNT, reference_field_id
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.bus import BenchBus
    from protocols.frame import Frame

Counts = tuple[int, int, int]

SILENCE_S: Final = 0.5
"""Without a usable frame for so long, the node is silent."""
FROZEN_S: Final = 10.0
"""A sensor that is alive does not send one and the same reading for so long."""
FRESH_S: Final = 0.1
"""An older reading stands beside no cycle of the module."""
NO_COUNTS: Final[Counts] = (-(2**15),) * 3
"""Stands where there is no reading; the node never sends it."""

_SILENCE_TICKS: Final = round(SILENCE_S / TICK_S)
_FROZEN_TICKS: Final = round(FROZEN_S / TICK_S)
_FRESH_TICKS: Final = round(FRESH_S / TICK_S)
_WHAT_TO_DO: Final = "check its supply and its plug, or take it out of the station file"


class Reference:
    """Client of the reference magnetometer.

    Parameters
    ----------
    bus : BenchBus
    address : int
        Source address that the station file names.
    """

    def __init__(self, bus: BenchBus, address: int) -> None:
        self.bus = bus
        self.address = address
        self._claims = AddressClaims(
            bus, address, nodes="nodes", remedy="leave only the reference magnetometer there"
        )
        can_id = reference_field_id(address)
        self._receiver = E2eReceiver(data_id(can_id))
        self._state = E2eState.NOT_AVAILABLE
        self._counts = NO_COUNTS
        self._last_tick: int | None = None
        self._changed_tick = 0
        self._watched = False
        bus.subscribe(can_id, self._on_field)
        bus.add_hook(self._end_tick)

    @property
    def counts(self) -> Counts:
        """The newest reading in counts, `NO_COUNTS` where it is too old or there is none."""
        return self._counts if self._age_ticks() <= _FRESH_TICKS else NO_COUNTS

    @property
    def field_mg(self) -> NDArray[np.float64]:
        """The newest reading along the node's own axes, shape (3,); not-a-number without one."""
        return field_mg_of(np.array(self.counts))

    @property
    def silent(self) -> bool:
        """Whether no usable frame has come for `SILENCE_S`."""
        return self._age_ticks() > _SILENCE_TICKS

    @property
    def watched(self) -> bool:
        """Whether the node has been heard and its silence ends the run."""
        return self._watched

    @property
    def e2e(self) -> dict[str, dict[str, int | str]]:
        """State and counters of its frame, as `Module.e2e` gives them for the module's."""
        receiver = self._receiver
        return {
            "reference_field": {
                "state": (E2eState.NOT_AVAILABLE if self.silent else self._state).value,
                "lost": receiver.lost,
                "errors": receiver.errors,
                "repeated": receiver.repeated,
                "wrong_sequence": receiver.wrong_sequence,
            }
        }

    def wait_ready(self, timeout_s: float = 2.0) -> None:
        """Wait for a reading; from then on silence ends the run.

        Raises
        ------
        ReferenceSilent
            If none comes in time.
        BusFault
            If two nodes claim the address.
        """
        self._claims.request()
        self.bus.run_until(
            lambda: self._age_ticks() <= 1,
            timeout_s,
            f"the station's reference magnetometer {self.address:#04x} has sent no reading",
            error=lambda start: ReferenceSilent(f"{start}: {_WHAT_TO_DO}"),
        )
        self._watched = True

    def _age_ticks(self) -> int:
        last = self._last_tick
        return _SILENCE_TICKS + 1 if last is None else self.bus.tick_count - last

    def _on_field(self, frame: Frame) -> None:
        self._state = self._receiver.check(frame.data)
        if self._state.usable:
            counts = unpack_counts(frame.data)
            if counts != self._counts:
                self._changed_tick = self.bus.tick_count
            self._counts = counts
            self._last_tick = self.bus.tick_count

    def _end_tick(self) -> None:
        if not self._watched:
            return
        if self.silent:
            self._watched = False  # told once; teardown goes on
            message = (
                f"the station's reference magnetometer {self.address:#04x} has sent nothing "
                f"usable for {SILENCE_S:g} s: {_WHAT_TO_DO}"
            )
            raise ReferenceSilent(message)
        if self.bus.tick_count - self._changed_tick > _FROZEN_TICKS:
            self._watched = False
            message = (
                f"the station's reference magnetometer {self.address:#04x} has sent one and the "
                f"same reading for {FROZEN_S:g} s, without any noise: it is frozen or at the end "
                f"of its scale; {_WHAT_TO_DO}"
            )
            raise ReferenceSilent(message)
        if self._claims.contested:
            self._watched = False
            raise self._claims.fault()


def field_mg_of(counts: NDArray[np.integer]) -> NDArray[np.float64]:
    """Return readings in mG from counts, both of shape (..., 3); NaN where there was none.

    >>> field_mg_of(np.array([[20, -4, 0], [-32768, -32768, -32768]])).tolist()
    [[1.0, -0.2, 0.0], [nan, nan, nan]]
    """
    field_mg = counts * REFERENCE_MG_PER_COUNT
    return np.asarray(np.where(counts == NO_COUNTS[0], np.nan, field_mg))
