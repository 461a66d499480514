"""How the signals of a frame are laid out: the words in which the bus is described the bus."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from protocols.frame import EXTENDED

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalLayout:
    """One little-endian signal.

    physical value = raw * scale + offset, in `unit`. `start` and `length` are bits;
    `values` names single raw values; `spn` is the suspect parameter number of SAE J1939-71.
    """

    name: str
    start: int
    length: int
    signed: bool = False
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    values: Mapping[int, str] = field(default_factory=dict)
    spn: int | None = None
    comment: str = ""

    @property
    def minimum(self) -> float:
        """Least physical value that the raw range holds."""
        raw = -(1 << self.length - 1) if self.signed else 0
        return raw * self.scale + self.offset

    @property
    def maximum(self) -> float:
        """Greatest physical value that the raw range holds."""
        raw = (1 << self.length - self.signed) - 1
        return raw * self.scale + self.offset


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameLayout:
    """One frame of the bus.

    `can_id` has `EXTENDED` set for 29 bits, `length` is bytes, `sender` a node of
    `database.NODES`, `cycle_ms` the usual period, 0 for frames sent when needed. `receiver` names
    the node that reads it, where it is not the bench or, for what the bench sends, the module.
    """

    can_id: int
    name: str
    length: int
    sender: str
    signals: tuple[SignalLayout, ...]
    cycle_ms: int = 0
    comment: str = ""
    receiver: str = ""

    @property
    def extended(self) -> bool:
        """Whether the identifier has 29 bits."""
        return bool(self.can_id & EXTENDED)


def unsigned(name: str, start: int, length: int, *, comment: str = "") -> SignalLayout:
    """Return the layout of a plain unsigned number."""
    return SignalLayout(name=name, start=start, length=length, comment=comment)


def raw_bytes(count: int) -> tuple[SignalLayout, ...]:
    """Return `count` signals of one byte each, for what another protocol fills."""
    return tuple(unsigned(f"Byte{index}", 8 * index, 8) for index in range(count))
