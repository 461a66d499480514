"""What the report says of how sure a verified heading is: budget, decision, and what is not seen.

Read from the record's section `uncertainty`; a record without it has no such part of the report.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from bench.record.certainty_charts import VerifiedPose, budget_bar, verified_chart
from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from markupsafe import Markup

    from bench.record.charts import Band

KINDS: Final = ("level", "tilted")
LEVEL_DEG: Final = 1.0
"""Poses of which pitch and roll are both smaller count as level."""
NEARLY_ALL: Final = 0.999
NEARLY_SURE: Final = 0.9999
"""Probabilities from which a reader is told four digits, and 'more than' in place of nines."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetRow:
    """One contribution: standard uncertainty of the quantity, and what it costs the heading.

    Attributes
    ----------
    group : str
        "unit" or "bench".
    shared : bool
        Whether all poses share the same draw, so that more poses do not help.
    level_deg, tilted_deg : float
        RMS over the poses of its standard contribution to the heading.
    share : float
        Its part of the variance, in percent, of level poses, without such of tilted ones.
    """

    name: str
    source: str
    distribution: str
    group: str
    shared: bool
    value: float
    unit: str
    level_deg: float
    tilted_deg: float
    share: float = 0.0


def has_certainty(record: Mapping[str, Any]) -> bool:
    """Return whether a record tells the uncertainty of its verified headings."""
    return bool((record.get("uncertainty") or {}).get("headings"))


def certainty(record: Mapping[str, Any], bands: Mapping[str, Band]) -> dict[str, Any] | None:
    """Return what the template shows, None where the record has no uncertainty.

    Parameters
    ----------
    bands : mapping of str to Band
        Limits of the largest error with their guard band, under "level" and "tilted".
    """
    if not has_certainty(record):
        return None
    section = record["uncertainty"]
    rows = budget_rows(record)
    poses = verified_poses(record)
    factor = float(section.get("coverage_factor") or 2.0)
    return {
        "kinds": [_kind(section, name, poses[name], bands) for name in KINDS if poses[name]],
        "budget": _with_bars(rows),
        "sums": _sums(rows, factor),
        "has_level": bool(poses["level"]),
        "has_tilted": bool(poses["tilted"]),
        "factor": factor,
        "dominant": dominant_words(rows),
        "unseen": unseen_words(record),
        "left_out": left_out_words(record),
        "rule": section.get("rule") or "",
    }


def budget_rows(record: Mapping[str, Any]) -> list[BudgetRow]:
    """Return the contributions, the largest first; those of nothing are in `left_out_words`."""
    rows = [
        BudgetRow(
            name=str(entry["name"]).replace("_", " "),
            source=str(entry.get("source", "")),
            distribution=str(entry.get("distribution", "")),
            group=str(entry.get("group", "")),
            shared=bool(entry.get("shared")),
            value=float(entry.get("value") or 0.0),
            unit=str(entry.get("unit", "")),
            level_deg=float(entry.get("level_deg") or 0.0),
            tilted_deg=float(entry.get("tilt_deg") or 0.0),
        )
        for entry in _budget(record)
        if _costs(entry)
    ]
    rows.sort(key=lambda row: -math.hypot(row.level_deg, row.tilted_deg))
    level = any(row.level_deg for row in rows)
    squares = [(row.level_deg if level else row.tilted_deg) ** 2 for row in rows]
    total = sum(squares) or 1.0
    return [
        replace(row, share=100.0 * square / total)
        for row, square in zip(rows, squares, strict=True)
    ]


def left_out_words(record: Mapping[str, Any]) -> str:
    """Return what the budget names without a contribution, and why; empty where there is none."""
    reasons: dict[str, list[str]] = {}
    for entry in _budget(record):
        if not _costs(entry):
            reasons.setdefault(str(entry["distribution"]), []).append(str(entry["name"]))
    return "".join(
        f" Not in U: {' and '.join(names)} ({reason})." for reason, names in reasons.items()
    )


def _budget(record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return (record.get("uncertainty") or {}).get("budget") or []


def _costs(entry: Mapping[str, Any]) -> bool:
    return bool(entry.get("value") or entry.get("level_deg") or entry.get("tilt_deg"))


def verified_poses(record: Mapping[str, Any]) -> dict[str, list[VerifiedPose]]:
    """Return the verified poses of a record, level and tilted apart, by heading."""
    north_deg = float((record.get("station") or {}).get("field_azimuth_deg") or 0.0)
    found: dict[str, list[VerifiedPose]] = {name: [] for name in KINDS}
    for entry in (record.get("uncertainty") or {}).get("headings") or []:
        tilt_deg = max(abs(entry["pitch_deg"]), abs(entry["roll_deg"]))
        found["level" if tilt_deg < LEVEL_DEG else "tilted"].append(
            VerifiedPose(
                position=int(entry["position"]),
                heading_deg=float(wrap_360_deg(entry["azimuth_deg"] - north_deg)),
                pitch_deg=float(entry["pitch_deg"]),
                roll_deg=float(entry["roll_deg"]),
                error_deg=float(entry["error_deg"]),
                u_deg=float(entry["u_deg"]),
                u_test_deg=float(entry["u_test_deg"]),
            )
        )
    return {name: sorted(rows, key=lambda pose: pose.heading_deg) for name, rows in found.items()}


def _kind(
    section: Mapping[str, Any],
    name: str,
    poses: Sequence[VerifiedPose],
    bands: Mapping[str, Band],
) -> dict[str, Any]:
    decision = section.get({"tilted": "tilt"}.get(name, name)) or {}
    band = bands.get(name)
    worst = max(poses, key=lambda pose: abs(pose.error_deg))
    title = f"Verified heading errors, {name}, with their uncertainty"
    return {
        "name": name,
        "chart": verified_chart(poses, band, name, title),
        "largest_deg": abs(worst.error_deg),
        "u_deg": worst.u_deg,
        "u_test_deg": decision.get("u_max_deg"),
        "limit_deg": band.limit_deg if band else None,
        "accept_deg": band.limit_deg - band.guard_deg if band else None,
        "tur": decision.get("tur"),
        "conformity": decision.get("conformity"),
    }


def _with_bars(rows: Sequence[BudgetRow]) -> list[tuple[BudgetRow, Markup]]:
    top_deg = max((max(row.level_deg, row.tilted_deg) for row in rows), default=0.0)
    return [(row, budget_bar(row.name, row.level_deg, row.tilted_deg, top_deg)) for row in rows]


def _sums(rows: Sequence[BudgetRow], factor: float) -> list[dict[str, Any]]:
    """Return the combined standard contributions of unit, bench and both, and U of both."""
    sums: list[dict[str, Any]] = []
    for name, groups in (("unit", ("unit",)), ("bench", ("bench",)), ("all", ("unit", "bench"))):
        chosen = [row for row in rows if row.group in groups]
        level_deg = math.sqrt(sum(row.level_deg**2 for row in chosen))
        tilted_deg = math.sqrt(sum(row.tilted_deg**2 for row in chosen))
        sums.append({"name": name, "level_deg": level_deg, "tilted_deg": tilted_deg})
    expanded = {key: factor * sums[-1][key] for key in ("level_deg", "tilted_deg")}
    return [*sums, {"name": "U", **expanded}]


def dominant_words(rows: Sequence[BudgetRow]) -> str:
    """Return, in one sentence, which contributions make the uncertainty.

    >>> index = BudgetRow(name="seat index", source="B", distribution="normal", group="bench",
    ...     shared=True, value=0.02, unit="deg", level_deg=0.02, tilted_deg=0.0, share=100.0)
    >>> dominant_words([index])
    'Most of the uncertainty is the seat index (100 % of the variance); the bench adds 100 %.'
    """
    ranked = sorted(rows, key=lambda row: -row.share)
    if not ranked or not ranked[0].share:
        return ""
    first, *others = ranked
    text = f"Most of the uncertainty is the {first.name} ({first.share:.0f} % of the variance)"
    if others and others[0].share >= 1.0:
        text += f", then the {others[0].name} ({others[0].share:.0f} %)"
    of_bench = sum(row.share for row in rows if row.group == "bench")
    return f"{text}; the bench adds {of_bench:.0f} %."


def unseen_words(record: Mapping[str, Any]) -> str:
    """Return what the run cannot see, and since when the station knows it."""
    seat = (record.get("station") or {}).get("seat") or {}
    parts = [
        f"{what} (U {seat[key]:g} {unit})" if seat.get(key) is not None else what
        for what, key, unit in (
            ("the seat's index", "u_index_deg", "deg"),
            ("iron in the fixture", "u_iron_mg", "mG"),
        )
    ]
    text = f"No run on this seat can see {parts[0]} or {parts[1]}: unit and verification share them"
    verified = seat.get("verified")
    if not verified:
        return f"{text}. They were never verified by reversal; the station file states them."
    golden = f" with {seat['golden']}" if seat.get("golden") else ""
    return f"{text}. The reversal of {verified}{golden} found them."


def share_words(percent: float) -> str:
    """Return a part of the variance for readers.

    >>> share_words(61.7), share_words(0.2)
    ('62 %', '< 1 %')
    """
    return f"{percent:.0f} %" if percent >= 0.5 else "< 1 %"


def probability_words(probability: float | None) -> str:
    """Return a probability of conformity for readers.

    >>> probability_words(0.987), probability_words(0.99987), probability_words(0.999999)
    ('98.7 %', '99.99 %', '> 99.99 %')
    >>> probability_words(1e-9), probability_words(None)
    ('< 0.01 %', '–')
    """
    if probability is None:
        return "–"
    if probability > NEARLY_SURE:
        return f"> {100.0 * NEARLY_SURE:g} %"
    if probability < 1.0 - NEARLY_SURE:
        return f"< {100.0 * (1.0 - NEARLY_SURE):.2f} %"
    return f"{100.0 * probability:.{4 if probability > NEARLY_ALL else 3}g} %"
