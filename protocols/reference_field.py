"""The station's reference magnetometer on the bus: a fixed node that says its field.

```
byte      0        1            2..3    4..5    6..7
RefField  CRC-8    group|count  X       Y       Z        counts of 0.05 mG, every 10 ms
```
Proprietary B of SAE J1939-21, E2E protected as the module's frames are, with a data ID of its own.
X, Y and Z are the node's own axes, which nobody has aligned: only changes of them are used.
It answers a request for its address claim (SAE J1939-81); it has no diagnostics.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from protocols.compass import pack_counts
from protocols.frame_layout import FrameLayout, SignalLayout
from protocols.j1939 import address_claimed_id, pdu_id, request_id
from protocols.module_frames import E2E_SIGNALS, address_claimed_frame, request_frame

if TYPE_CHECKING:
    from protocols.e2e import E2eSender

REFERENCE: Final = "ReferenceMagnetometer"
REFERENCE_ADDRESS: Final = 0x90
"""Default source address of the reference magnetometer."""
PGN_REFERENCE_FIELD: Final = 0xFF30
REFERENCE_MG_PER_COUNT: Final = 0.05
REFERENCE_COUNT_LIMIT: Final = 32000
"""End of scale: +-1600 mG."""


def reference_field_id(source: int) -> int:
    """Return the identifier of the reference field.

    >>> hex(reference_field_id(REFERENCE_ADDRESS))
    '0x98ff3090'
    """
    return pdu_id(6, PGN_REFERENCE_FIELD, source)


def pack_reference_field(
    sender: E2eSender, group: int, field_mg: tuple[float, float, float]
) -> bytes:
    """Return the protected frame of a field in mG, held at the end of scale where it is beyond."""
    limit = REFERENCE_COUNT_LIMIT
    x, y, z = (
        max(-limit, min(limit, round(value_mg / REFERENCE_MG_PER_COUNT))) for value_mg in field_mg
    )
    return pack_counts(sender, group, x, y, z)


def reference_frames(address: int = REFERENCE_ADDRESS) -> tuple[FrameLayout, ...]:
    """Return the layout of every frame of a reference magnetometer at a source address."""
    axes = tuple(
        SignalLayout(
            name=axis, start=start, length=16, signed=True, scale=REFERENCE_MG_PER_COUNT, unit="mG"
        )
        for axis, start in (("X", 16), ("Y", 32), ("Z", 48))
    )
    field = FrameLayout(
        can_id=reference_field_id(address),
        name="RefField",
        length=8,
        sender=REFERENCE,
        cycle_ms=10,
        comment="field at the station's reference magnetometer, along its own axes",
        signals=(*E2E_SIGNALS, *axes),
    )
    claim = address_claimed_frame(address_claimed_id(address), "RefAddressClaimed", REFERENCE)
    return (field, claim, request_frame(request_id(address), "RefRequest", REFERENCE))
