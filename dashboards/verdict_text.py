"""The verdict, the methods and the deviation of a run in Markdown."""

from __future__ import annotations

from typing import Any, Final

from bench.record.certainty import (
    budget_rows,
    dominant_words,
    has_certainty,
    probability_words,
    share_words,
    unseen_words,
)
from bench.record.field_watch_words import field_watch
from bench.record.method_study import (
    ORDER_REASON,
    error_words,
    method_rows,
    no_model,
    order_rows,
)

_MARKS: Final = {
    "PASS": "pass",
    "MARGINAL": "**marginal**",
    "FAIL": "**FAIL**",
    "ERROR": "**ERROR**",
}
_HEADINGS: Final = frozenset(
    {
        "level_max",
        "level_rms",
        "tilt_max",
        "tilt_rms",
        "repeatability",
        "closing_error",
        "bench_against_module",
    }
)
_LETTERS: Final = ("A", "B", "C", "D", "E")
_MEANINGS: Final = {
    "A": "index, rotation",
    "B": "hard iron fore-aft",
    "C": "hard iron athwart",
    "D": "soft iron, axes",
    "E": "soft iron, diagonal",
}


def verdict_markdown(record: dict[str, Any]) -> str:
    """Return outcome, reason, next action and every limit: missed ones, then the headings'."""
    verdict = record.get("verdict") or {"outcome": "ERROR", "reason": "the run was broken off"}
    run = record.get("run", {})
    lines = [
        f"# {verdict['outcome']}  `{run.get('serial', '?')}`",
        verdict.get("reason", ""),
        "",
        verdict.get("next_action", ""),
        "",
        "| measurement | value | limits | unit | U | conforming | result |",
        "|---|---:|---:|---|---:|---:|:--:|",
    ]
    judged = [m for m in record.get("measurements", []) if _limits(m)]
    judged.sort(key=lambda m: (m.get("outcome") == "PASS", m["name"] not in _HEADINGS))
    for measurement in judged:
        mark = _MARKS.get(str(measurement.get("outcome")), str(measurement.get("outcome")))
        lines.append(
            f"| {measurement['name']} | {_number(measurement['value'])} | {_limits(measurement)} "
            f"| {measurement.get('unit', '')} | {_uncertainty(measurement)} "
            f"| {probability_words(measurement.get('conformity'))} | {mark} |"
        )
    watch = field_watch(record)
    if watch is not None and watch["spoiled"]:
        lines += ["", watch["words"]]
    faults = record.get("injected_faults") or []
    if faults:
        lines += ["", f"Injected faults: {', '.join(map(str, faults))}"]
    return "\n".join(lines)


def _uncertainty(measurement: dict[str, Any]) -> str:
    return _number(measurement.get("uncertainty") or None)


def methods_markdown(record: dict[str, Any]) -> str:
    """Return raw and every method by its heading error on the verification poses, best first."""
    lines = [
        "# Methods on the same readings",
        "",
        "RMS heading error (°), level / tilted: claimed by the method, expected before the "
        "verification, achieved there",
        "",
        "| method | claimed | expected | achieved | largest | tilt from | the claim is |",
        "|---|---:|---:|---:|---:|---|---|",
    ]
    for row in method_rows(record):
        name = f"**{row.name}**, written" if row.written else row.name
        if row.cause:
            lines.append(f"| {name} | refused: {row.cause} | | | | | |")
            continue
        claimed = error_words(row.claimed_rms_deg)
        cells = [
            f"**{claimed} !**" if row.unsaid else claimed,
            _pair(row.expected.get("level_rms_deg"), row.expected.get("tilt_rms_deg")),
            _pair(row.level_rms_deg, row.tilt_rms_deg),
            _pair(row.level_max_deg, row.tilt_max_deg),
            row.tilt_from,
            row.claim_without,
        ]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join([*lines, *_method_notes(record), *_orders(record)])


def _method_notes(record: dict[str, Any]) -> list[str]:
    notes = []
    if any(row.unsaid for row in method_rows(record)):
        notes.append("**!** wrong without saying so: over twice what claim and noise explain.")
    missing = no_model(record)
    notes += [f"No expected error: {missing}."] if missing else []
    return ["", *notes] if notes else []


def _pair(level_deg: float | None, tilt_deg: float | None) -> str:
    return f"{error_words(level_deg)} / {error_words(tilt_deg)}"


def certainty_markdown(record: dict[str, Any]) -> str:
    """Return U, conformity and budget of the verified headings, the largest contribution first."""
    section = record.get("uncertainty") or {}
    lines = ["# How sure", ""]
    if not has_certainty(record):
        return "\n".join([*lines, "The record has no uncertainty of the verified headings."])
    lines += [
        "| | U of the test (°) | test uncertainty ratio | conforming |",
        "|---|---:|---:|---:|",
    ]
    for kind, name in (("level", "level"), ("tilt", "tilted")):
        found = section.get(kind) or {}
        if found.get("u_max_deg") is not None:
            lines.append(
                f"| {name} | {_number(found['u_max_deg'])} | {_number(found.get('tur'))} "
                f"| {probability_words(found.get('conformity'))} |"
            )
    rows = budget_rows(record)
    lines += ["", dominant_words(rows), "", unseen_words(record), ""]
    lines += ["| contribution | of | standard | level (°) | tilted (°) | variance |"]
    lines += ["|---|---|---:|---:|---:|---:|"]
    lines += [
        f"| {row.name} | {row.group} | {_number(row.value)} {row.unit} | {row.level_deg:.3f} "
        f"| {row.tilted_deg:.3f} | {share_words(row.share)} |"
        for row in rows
    ]
    return "\n".join(lines)


def _orders(record: dict[str, Any]) -> list[str]:
    """Return what the order of compensation costs: level / tilted maximum of each method."""
    rows = order_rows(record)
    if not rows:
        return []
    names = [effect.name.replace(" iron", "") for effect in rows[0].effects]
    lines = [
        "",
        "## Order of compensation",
        "",
        "Largest error, level / tilted (°), by what is taken out in which order: hard iron, soft "
        f"iron, tilt. {ORDER_REASON}",
        "",
        "| method | " + " | ".join(names) + " |",
        "|---|" + "---:|" * len(names),
    ]
    for row in rows:
        cells = [_pair(e.level_max_deg, e.tilt_max_deg) for e in row.effects]
        lines.append(f"| {row.name} | " + " | ".join(cells) + " |")
    return lines


def deviation_markdown(record: dict[str, Any]) -> str:
    """Return the coefficients A-E before and after, with standard errors and words."""
    deviation = record.get("deviation") or {}
    lines = ["# Deviation A to E (°)", "", "| | raw | compensated | from |", "|---|---:|---:|---|"]
    raw, compensated = deviation.get("raw") or {}, deviation.get("compensated") or {}
    for letter in _LETTERS:
        cells = [_with_error(part, letter) for part in (raw, compensated)]
        lines.append(f"| {letter} | {cells[0]} | {cells[1]} | {_MEANINGS[letter]} |")
    for name, part in (("Raw", raw), ("Compensated", compensated)):
        words = part.get("words")
        if words:
            text = words if isinstance(words, str) else "; ".join(map(str, words))
            lines += ["", f"**{name}:** {text}"]
    return "\n".join(lines)


def _with_error(part: dict[str, Any], letter: str) -> str:
    if part.get(letter) is None:
        return "–"
    se = part.get("se")
    error = se.get(letter) if isinstance(se, dict) else None
    return _number(part[letter]) + (f" ± {_number(error)}" if error is not None else "")


def _limits(measurement: dict[str, Any]) -> str:
    low, high = measurement.get("low"), measurement.get("high")
    if low is None and high is None:
        return ""
    if low is None:
        return f"≤ {_number(high)}"
    if high is None:
        return f"≥ {_number(low)}"
    return f"{_number(low)} … {_number(high)}"


def _number(value: object) -> str:
    if value is None:
        return "–"
    return f"{float(value):.3g}" if abs(float(value)) < 1000 else f"{float(value):.0f}"  # type: ignore[arg-type]
