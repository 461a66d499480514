"""What the report says of the bridges' own terms and of poses that were added until it sufficed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeRow:
    """One term of the bridges, ready to print; `seen` has one text an axis, or one for all.

    `done` says whether it was corrected, or why not.
    """

    name: str
    unit: str
    seen: tuple[str, ...]
    done: str


_TERMS: Final = {
    "hk_mg": ("cross-axis, anisotropy field Hk", "G", 1e-3),
    "hysteresis_mg": ("hysteresis, half play", "mG", 1.0),
    "offset_tempco_mg_per_c": ("bridge offset by temperature", "mG/\N{DEGREE SIGN}C", 1.0),
    "sensitivity_tempco_per_c": ("sensitivity by temperature", "%/\N{DEGREE SIGN}C", 100.0),
    "accel_drift_mg_per_c": ("accelerometer by temperature", "mg/\N{DEGREE SIGN}C", 1.0),
}
_ENDED: Final = {
    "wanted_reached": "what was wanted is reached",
    "most_poses": "no more poses are allowed",
    "fit_refused": "the fit refused the readings",
}


def bridge_rows(record: Mapping[str, Any]) -> list[BridgeRow]:
    """Return the terms that the run looked for; none of a record that has no such section."""
    terms = record.get("bridge_terms") or {}
    rows = []
    for key, (name, unit, factor) in _TERMS.items():
        entry = terms.get(key)
        if entry is None:
            continue
        pairs = zip(entry["value"], entry["sd"], strict=True)
        seen = tuple(_seen(value, sd, factor) for value, sd in pairs)
        done = "corrected, in bench and module" if entry["corrected"] else entry["why_not"]
        rows.append(BridgeRow(name=name, unit=unit, seen=_if_any(seen), done=done))
    return rows


def _seen(value: float | None, sd: float | None, factor: float) -> str:
    """Return value and standard deviation to two digits of the latter."""
    if value is None:
        return "\N{EN DASH}"
    if not sd:
        return _with_minus(f"{factor * value:.3g}")
    places = max(0, 1 - math.floor(math.log10(factor * sd)))
    both = f"{factor * value:.{places}f} \N{PLUS-MINUS SIGN} {factor * sd:.{places}f}"
    return _with_minus(both)


def _with_minus(text: str) -> str:
    return text.replace("-", "\N{MINUS SIGN}")


def _if_any(seen: Sequence[str]) -> tuple[str, ...]:
    missing = all(text == "\N{EN DASH}" for text in seen)
    return ("not seen",) if missing else tuple(seen)


def adaptive_words(record: Mapping[str, Any]) -> str:
    """Return how poses were added and why no more; empty where the procedure adds none.

    Examples
    --------
    >>> claims = [{"poses": 8, "largest_deg": 0.26}, {"poses": 9, "largest_deg": 0.19}]
    >>> adaptive_words(
    ...     {"adaptive": {"wanted_deg": 0.2, "ended": "wanted_reached", "claims": claims}}
    ... )
    '9 poses: from 8 on, the claimed largest error fell from 0.260 to 0.190 deg, where 0.2 deg was \
wanted; what was wanted is reached.'
    """
    adaptive = record.get("adaptive") or {}
    claims = adaptive.get("claims") or []
    if not claims:
        return ""
    first, last = claims[0], claims[-1]
    course = (
        f"from {first['poses']} on, the claimed largest error fell from "
        f"{first['largest_deg']:.3f} to {last['largest_deg']:.3f} deg"
    )
    if len(claims) == 1:
        course = f"the claimed largest error is {last['largest_deg']:.3f} deg"
    ended = _ENDED.get(adaptive.get("ended", ""), "the run ended")
    wanted = f"where {adaptive['wanted_deg']:g} deg was wanted"
    return f"{last['poses']} poses: {course}, {wanted}; {ended}."
