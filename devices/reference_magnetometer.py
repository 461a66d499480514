"""The station's reference magnetometer: a fluxgate that stands still and says its field.

It stands beside the rig, so that what comes near the rig is felt by it too, and far enough away
not to feel the rig. It knows neither the rig nor the module: it turns the world's field at its
place into its own axes, which are not aligned with anything, and sends it every 10 ms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from devices.noise import NormalStream
from devices.rotation import apply, ned_from_body
from protocols import j1939
from protocols.compass import data_id
from protocols.e2e import E2eSender
from protocols.reference_field import (
    REFERENCE_ADDRESS,
    pack_reference_field,
    reference_field_id,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

    from devices.rotation import Vector
    from devices.world import World

BOOT_S: Final = 0.2
PLACE_NED_M: Final[Vector] = (0.0, 1.5, 0.0)
"""Where it stands from the crossing of the rig's axes."""
NOISE_MG: Final = 0.02
"""Standard deviation of one reading; a fluxgate has 10 pT/sqrt(Hz), and its converter more."""
OFFSET_SD_MG: Final = 0.5
MISALIGNMENT_SD_DEG: Final = 1.0
_NS_PER_S: Final = 1_000_000_000
_NEVER_NS: Final = 1 << 62


class ReferenceMagnetometer:
    """One reference magnetometer on the bus.

    Parameters
    ----------
    world : World
        Whose field it measures.
    rng : Generator
        Draws its offset and misalignment, then its noise.
    address : int
        J1939 source address.
    place_ned_m : (float, float, float)
        Where it stands from the crossing of the rig's axes, m.
    """

    def __init__(
        self,
        world: World,
        rng: np.random.Generator,
        *,
        address: int = REFERENCE_ADDRESS,
        place_ned_m: Vector = PLACE_NED_M,
    ) -> None:
        self.address = address
        self.place_ned_m = place_ned_m
        self._world = world
        x, y, z = rng.normal(0.0, OFFSET_SD_MG, 3).tolist()
        self._offset_mg: Vector = (x, y, z)
        yaw_deg, pitch_deg, roll_deg = rng.normal(0.0, MISALIGNMENT_SD_DEG, 3).tolist()
        self._own_from_ned = ned_from_body(yaw_deg, pitch_deg, roll_deg)
        self._noise = NormalStream(rng)
        self._name = j1939.pack_name(f"REF{address:03d}")
        self._field_id = reference_field_id(address)
        self._claim_id = j1939.address_claimed_id(address)
        self._sender = E2eSender(data_id(self._field_id))
        self._claims = 0
        self._awake = False
        self._silent_from_ns = _NEVER_NS
        self._silent_until_ns = _NEVER_NS

    @property
    def accepts(self) -> frozenset[int]:
        """Identifiers that the node listens to: requests to it and to everybody."""
        return frozenset(
            j1939.request_id(destination, source)
            for destination in (self.address, j1939.GLOBAL_ADDRESS)
            for source in range(256)
        )

    def silence(self, from_ns: int, until_ns: int) -> None:
        """Neither send nor answer within a span of time (fault `reference_silent`)."""
        self._silent_from_ns, self._silent_until_ns = from_ns, until_ns

    def receive(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Take one frame from the bus; the answer leaves with the next `tick`."""
        del t_ns, can_id
        if self._awake and data[:3] == j1939.pack_request(j1939.PGN_ADDRESS_CLAIMED):
            self._claims += 1

    def tick(self, t_ns: int, group: int, emit: Callable[[int, bytes], None]) -> None:
        """Send address claims that are due, and the field."""
        if t_ns < BOOT_S * _NS_PER_S or self._silent_from_ns <= t_ns < self._silent_until_ns:
            self._claims = 0
            return
        if not self._awake:
            self._awake = True
            self._claims = 1
        for _ in range(self._claims):
            emit(self._claim_id, self._name)
        self._claims = 0
        emit(self._field_id, pack_reference_field(self._sender, group, self.field_mg()))

    def sync(self, emit: Callable[[int, bytes], None]) -> None:
        """Do nothing: the node keeps its own time."""

    def field_mg(self) -> Vector:
        """Return one noisy reading along its own axes, mG."""
        x, y, z = apply(self._own_from_ned, self._world.field_at_ned_mg(self.place_ned_m))
        offset, noise = self._offset_mg, self._noise
        return (
            x + offset[0] + NOISE_MG * noise(),
            y + offset[1] + NOISE_MG * noise(),
            z + offset[2] + NOISE_MG * noise(),
        )
