"""What the channels of a run report without an exception: lost frames, bus off, full queues.

The links count such faults (`protocols.link_faults`); here they end the run, because what was
measured over a channel that loses frames cannot be judged.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Final

from bench.errors import BusFault

if TYPE_CHECKING:
    from collections.abc import Sequence

    from protocols.link import Link

_WIRING: Final = "check wiring, termination, bit rate and that another node acknowledges"
_BUSY: Final = "free this computer of other work and raise its net.core.rmem_max"
SENTENCES: Final = {
    "bus_off": f"channel {{channel}} is bus-off: {_WIRING}, then bring it up again",
    "error_passive": f"channel {{channel}} is error-passive: {_WIRING}",
    "bus_error": f"channel {{channel}} reports {{count}} bus errors: {_WIRING}",
    "controller_overflow": (
        "channel {channel} lost frames {count} times because its adapter's buffer was full: "
        "use a faster adapter or lower the load of the bus"
    ),
    "receive_dropped": (
        "channel {channel} lost {count} frames because this computer did not read them in time: "
        f"{_BUSY}"
    ),
    "send_blocked": (
        "channel {channel} had no room to send {count} times (ENOBUFS): "
        f"{_WIRING}, or raise its txqueuelen"
    ),
}
"""By fault that makes a run an ERROR, what says most first; `error_warning` is only recorded."""


class LinkWatch:
    """Looks after the faults that links count.

    Parameters
    ----------
    links : sequence of Link
        Those that count none, on simulated wires, have none.
    """

    def __init__(self, links: Sequence[Link]) -> None:
        self._links = tuple(link for link in links if hasattr(link, "fault_counts"))
        self._told: set[tuple[int, str]] = set()

    @property
    def faults(self) -> dict[str, int]:
        """How often each kind of fault was seen on any link; nothing where all was well."""
        total: Counter[str] = Counter()
        for link in self._links:
            total.update(getattr(link, "fault_counts", {}))
        return dict(total)

    @property
    def dropped(self) -> int:
        """Frames that the kernel threw away because nobody read them in time."""
        return sum(getattr(link, "dropped", 0) for link in self._links)

    def check(self) -> None:
        """Raise for the first fault that is new; each kind is told once for each link.

        Raises
        ------
        BusFault
        """
        for number, link in enumerate(self._links):
            counts: dict[str, int] = getattr(link, "fault_counts", {})
            for fault, sentence in SENTENCES.items():
                if fault in counts and (number, fault) not in self._told:
                    self._told.add((number, fault))
                    channel = getattr(link, "channel", "")
                    raise BusFault(sentence.format(channel=channel, count=counts[fault]))
