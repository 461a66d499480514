"""Section `bridge_terms` of the record."""

from __future__ import annotations

from bench.record.section import StrictSection


class BridgeTermEntry(StrictSection):
    """One term of the bridges that the run saw (`bridge_terms.BridgeTerm`), by axis or for all."""

    value: list[float | None]
    sd: list[float | None]
    corrected: bool
    why_not: str
