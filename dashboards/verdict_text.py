"""The verdict, the methods and the deviation of a run in Markdown."""

from __future__ import annotations

from typing import Any, Final

from bench.record.method_study import ORDER_REASON, method_rows, order_rows

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
        "| measurement | value | limits | unit | result |",
        "|---|---:|---:|---|:--:|",
    ]
    judged = [m for m in record.get("measurements", []) if _limits(m)]
    judged.sort(key=lambda m: (m.get("outcome") == "PASS", m["name"] not in _HEADINGS))
    for measurement in judged:
        mark = _MARKS.get(str(measurement.get("outcome")), str(measurement.get("outcome")))
        lines.append(
            f"| {measurement['name']} | {_number(measurement['value'])} | {_limits(measurement)} "
            f"| {measurement.get('unit', '')} | {mark} |"
        )
    faults = record.get("injected_faults") or []
    if faults:
        lines += ["", f"Injected faults: {', '.join(map(str, faults))}"]
    return "\n".join(lines)


def methods_markdown(record: dict[str, Any]) -> str:
    """Return raw and every method by its heading error on the verification poses, best first."""
    lines = [
        "# Methods on the same readings",
        "",
        "| method | level max (°) | level rms | tilt max | tilt rms | predicted | residual (mG) "
        "| tilt from |",
        "|---|---:|---:|---:|---:|---:|---:|---|",
    ]
    for row in method_rows(record):
        name = f"**{row.name}**, written" if row.written else row.name
        if row.cause:
            lines.append(f"| {name} | refused: {row.cause} | | | | | | |")
            continue
        cells = [
            row.level_max_deg,
            row.level_rms_deg,
            row.tilt_max_deg,
            row.tilt_rms_deg,
            row.predicted_rms_deg,
            row.residual_mg,
        ]
        numbers = " | ".join(_number(cell) for cell in cells)
        lines.append(f"| {name} | {numbers} | {row.tilt_from} |")
    return "\n".join([*lines, *_orders(record)])


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
        cells = [f"{_number(e.level_max_deg)} / {_number(e.tilt_max_deg)}" for e in row.effects]
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
