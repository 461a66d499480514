"""The record's section `uncertainty` held against the one that the samples give again."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

from bench.acceptance.catalogue import BUDGETED
from bench.acceptance.heading_uncertainty import uncertainty_section

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from bench.acceptance.measurement import Measurement
    from bench.acceptance.site import SiteField
    from bench.uncertainty.heading_budget import HeadingBudget

LARGEST_DIFFERENCE: Final = 1e-9
"""Relative difference up to which a number is the recorded one."""
SMALLEST: Final = 1e-12


def differing_uncertainty(
    recorded: Mapping[str, Any],
    verifications: Iterable[tuple[NDArray[np.void], HeadingBudget]],
    judged: Sequence[Measurement],
    site: SiteField,
) -> list[str]:
    """Return the place of the first number of the section that the samples do not give.

    Parameters
    ----------
    recorded : mapping
        Section `uncertainty`; an empty one differs where a computed uncertainty was judged by.
    verifications : iterable of (readings, budget)
        Every verification of the run, computed anew.
    judged : sequence of Measurement
        All measurements of the run, judged anew.

    Returns
    -------
    list of str
        Empty, or one entry such as ``uncertainty.headings.3.u_deg``.
    """
    if not recorded.get("headings"):
        computed = any(True for _ in verifications)
        claimed = any(one.name in BUDGETED and one.tur is not None for one in judged)
        return ["uncertainty"] if computed and claimed else []
    positions = [row["position"] for row in recorded["headings"]]
    for readings, budget in verifications:
        if [int(position) for position in readings["position"]] == positions:
            again = uncertainty_section(readings, budget, judged, site)
            place = _first_difference(again, recorded, "uncertainty")
            return [place] if place else []
    return ["uncertainty.headings"]


def _first_difference(again: object, recorded: object, place: str) -> str:
    if isinstance(again, dict) and isinstance(recorded, dict):
        pairs = [(key, again.get(key), recorded.get(key)) for key in {**again, **recorded}]
    elif isinstance(again, list) and isinstance(recorded, list):
        if len(again) != len(recorded):
            return place
        pairs = [(k, a, r) for k, (a, r) in enumerate(zip(again, recorded, strict=True))]
    else:
        return "" if _same(again, recorded) else place
    found = (_first_difference(a, r, f"{place}.{key}") for key, a, r in pairs)
    return next(filter(None, found), "")


def _same(again: object, recorded: object) -> bool:
    if isinstance(again, float) and isinstance(recorded, int | float):
        return math.isclose(again, recorded, rel_tol=LARGEST_DIFFERENCE, abs_tol=SMALLEST)
    return again == recorded
