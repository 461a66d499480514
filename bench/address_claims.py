"""Who claims a node's J1939 address: one node may."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.errors import BusFault
from protocols.j1939 import (
    PGN_ADDRESS_CLAIMED,
    address_claimed_id,
    identity_of_name,
    pack_request,
    request_id,
)

if TYPE_CHECKING:
    from bench.bus import BenchBus
    from protocols.frame import Frame


class AddressClaims:
    """Names that were heard to claim an address.

    Parameters
    ----------
    bus : BenchBus
    address : int
        J1939 source address.
    nodes, remedy : str
        What claims it, in the plural, and what to do where two do, for the fault's sentence.
    """

    def __init__(self, bus: BenchBus, address: int, *, nodes: str, remedy: str) -> None:
        self._bus = bus
        self._address = address
        self._nodes = nodes
        self._remedy = remedy
        self._names: set[bytes] = set()
        bus.subscribe(address_claimed_id(address), self._on_claim)

    @property
    def contested(self) -> bool:
        """Whether more than one node claims the address."""
        return len(self._names) > 1

    def request(self) -> None:
        """Ask whoever has the address to claim it."""
        self._bus.send(request_id(self._address), pack_request(PGN_ADDRESS_CLAIMED))

    def fault(self) -> BusFault:
        """Return the fault of a contested address."""
        identities = sorted(identity_of_name(name) for name in self._names)
        return BusFault(
            f"address {self._address:#04x} is claimed by {len(identities)} {self._nodes} "
            f"(identity numbers {identities}): {self._remedy}"
        )

    def _on_claim(self, frame: Frame) -> None:
        self._names.add(bytes(frame.data))
