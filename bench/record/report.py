"""report.html: one page for operator, engineer and customer, without network or scripts."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from bench.acceptance.catalogue import CHECKS, MEASUREMENTS
from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import last_attempts
from bench.record.bridge_words import adaptive_words, bridge_rows
from bench.record.certainty import certainty, probability_words, share_words
from bench.record.charts import Band, heading_error_chart, limit_bar, xy_chart
from bench.record.document import RecordDocument, read_record
from bench.record.entries import measurement_entry, measurement_of
from bench.record.field_watch_words import field_watch
from bench.record.method_section import method_section
from bench.record.method_study import error_words, method_words
from bench.record.swing import swing_of
from protocols.compass import PART_TWO_AXIS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from bench.record.swing import Swing

TEMPLATE: Final = "report.html.j2"
SYMBOLS: Final = {
    Outcome.PASS: "✓",
    Outcome.MARGINAL: "≈",
    Outcome.FAIL: "✕",
    Outcome.ABORTED: "■",
    Outcome.ERROR: "!",
}
_VERDICT_OF_NONE: Final = {
    "outcome": "ERROR",
    "reason": "the run did not end",
    "next_action": "Do not judge the unit: run it again.",
    "rule": "",
}


def write_report(path: Path, record: Mapping[str, Any]) -> None:
    """Write the report of a record; plots come from the samples that lie beside it."""
    path.write_text(report_of(path.parent, record), encoding="utf-8")


def rewrite_report(run_dir: Path) -> Path:
    """Write the report of a finished run again and return its path.

    Raises
    ------
    ConfigError
        If the folder holds no record.
    """
    path = run_dir / "report.html"
    write_report(path, read_record(run_dir))
    return path


def report_of(run_dir: Path, record: Mapping[str, Any]) -> str:
    """Return the report as HTML."""
    swing = swing_of(run_dir, record)
    rows = report_rows(record)
    bands = _bands(rows)
    missed = [row for row in rows if row["outcome"] in (Outcome.FAIL, Outcome.ERROR)]
    close = [row for row in rows if row["outcome"] == Outcome.MARGINAL]
    verdict = record["verdict"] or _VERDICT_OF_NONE
    return (
        _environment()
        .get_template(TEMPLATE)
        .render(
            record=RecordDocument.model_validate(record).model_dump(mode="json", by_alias=True),
            verdict=verdict,
            symbol=SYMBOLS[Outcome(verdict["outcome"])],
            symbols=SYMBOLS,
            rows=rows,
            judged=sum(row["limited"] for row in rows),
            attention=sorted(missed, key=lambda r: r["name"] != record["first_failure"]) + close,
            steps=list(dict.fromkeys(row["step"] for row in rows)),
            charts=_charts(swing, record, bands),
            computed_by=method_words(swing.compensated_by) if swing.compensated_by else "",
            shown=_headlines(rows),
            two_axis=record["module"].get("part") == PART_TWO_AXIS,
            **method_section(swing, record, {band.name: band.limit_deg for band in bands}),
            sure=certainty(record, {band.name: band for band in bands}),
            watch=field_watch(record),
            bridge=bridge_rows(record),
            adaptive=adaptive_words(record),
            repeated=[entry for entry in record["steps"] if entry["attempt"] > 1],
        )
    )


def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        number=number,
        degrees=error_words,
        limits=limits_text,
        distance=distance,
        bar=_bar,
        words=words,
        when=when,
        value=value_text,
        spoken=spoken,
        rounded=rounded,
        probability=probability_words,
        share=share_words,
    )
    return environment


def report_rows(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the last attempt of each measurement with the words that stand beside it."""
    rows = []
    for measurement in last_attempts(measurement_of(e) for e in record["measurements"]):
        entry = measurement_entry(measurement)
        kind = MEASUREMENTS.get(measurement.name)
        meaning = kind.meaning if kind else entry["description"]
        limited = entry["low"] is not None or entry["high"] is not None
        rows.append({**entry, "meaning": meaning, "limited": limited})
    return rows


def _bands(rows: Sequence[Mapping[str, Any]]) -> list[Band]:
    """Return the limits of the heading on verification poses, level and tilted."""
    by_name = {row["name"].removeprefix("achieved_"): row for row in rows}
    return [
        Band(limit_deg=row["high"], guard_deg=row["guard_band"] or 0.0, name=name)
        for name, row in (("level", by_name.get("level_max")), ("tilted", by_name.get("tilt_max")))
        if row is not None and row["high"] is not None
    ]


def _charts(swing: Swing, record: Mapping[str, Any], bands: Sequence[Band]) -> dict[str, Any]:
    charts: dict[str, Any] = {"raw": None, "compensated": None, "xy": None}
    if swing.raw:
        charts["raw"] = heading_error_chart(swing.raw, [], "Heading error before calibration")
        horizontal_mg = float(record["station"]["horizontal_mg"])
        charts["xy"] = xy_chart(
            swing.raw_xy_mg, swing.corrected_xy_mg, horizontal_mg, "Level turn before and after"
        )
    if swing.compensated:
        charts["compensated"] = heading_error_chart(
            swing.compensated, bands, "Heading error after calibration"
        )
    return charts


def _headlines(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the figures that a reader looks for first."""
    names = ("level_max", "level_rms", "tilt_max", "tilt_rms", "repeatability")
    by_name = {row["name"].removeprefix("achieved_"): row for row in rows}
    return [by_name[name] for name in names if name in by_name]


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with `digits` significant digits, without a needless exponent.

    >>> number(0.12345), number(12345.6), number(None), number(-0.0004)
    ('0.123', '12346', '–', '−0.0004')
    """
    if value is None:
        return "–"
    size = abs(value)
    if size >= 10.0 ** (digits - 1):
        text = f"{value:.0f}"
    else:
        text = f"{value:#.{digits}g}" if size >= 1e-3 else f"{value:.{digits}g}"
        text = text.rstrip(".") if "e" in text or size >= 1e-3 else text
    return text.replace("-", "−")


def limits_text(row: Mapping[str, Any]) -> str:
    """Return the limits of a row in words."""
    low, high = row["low"], row["high"]
    if row["name"] in CHECKS:
        return "yes" if low is not None else ""
    unit = f" {row['unit']}" if row["unit"] else ""
    if low is not None and high is not None:
        if low == high:
            return f"{low:g}{unit}"
        return f"{low:g} … {high:g}{unit}".replace("-", "−")
    if high is not None:
        return f"≤ {high:g}{unit}"
    return f"≥ {low:g}{unit}" if low is not None else ""


def distance(row: Mapping[str, Any]) -> str:
    """Return how far a value lies inside or outside its nearest limit."""
    value, low, high = row["value"], row["low"], row["high"]
    if value is None or (low is None and high is None) or row["name"] in CHECKS:
        return ""
    rooms = [high - value] if high is not None else []
    rooms += [value - low] if low is not None else []
    room = min(rooms)
    if room == 0.0:
        return "at the limit" if row["uncertainty"] else ""
    unit = f" {row['unit']}" if row["unit"] else ""
    where = "inside" if room >= 0.0 else "outside"
    return f"{rounded(abs(room), row['uncertainty'])}{unit} {where}"


def _bar(row: Mapping[str, Any]) -> str:
    return "" if row["name"] in CHECKS else limit_bar(row)


def value_text(row: Mapping[str, Any]) -> str:
    """Return a row's value with its unit, to the second digit of its uncertainty (GUM 7.2.6)."""
    if row["value"] is None:
        return "not measured"
    if row["name"] in CHECKS:
        return "yes" if row["value"] == 1.0 else "no"
    unit = f" {row['unit']}" if row["unit"] else ""
    return f"{rounded(row['value'], row['uncertainty'])}{unit}"


def rounded(value: float, uncertainty: float | None) -> str:
    """Return a value to the second digit of its uncertainty, without one to three digits.

    >>> rounded(0.09681, 0.08), rounded(2.7e-5, 0.5), rounded(578.117, 2.0), rounded(1.0, 0.0)
    ('0.097', '0.00', '578.1', '1')
    """
    if not uncertainty:
        return f"{value:.0f}" if value == round(value) else number(value)
    places = max(0, 1 - math.floor(math.log10(uncertainty)))
    text = f"{value:.{places}f}"
    return (text.lstrip("-") if float(text) == 0.0 else text).replace("-", "−")


def spoken(sentence: str) -> str:
    """Return a sentence with measurement names in words and a capital first letter.

    >>> spoken("noise_x 0.3 mG is above 0.255 mG")
    'Noise x 0.3 mG is above 0.255 mG'
    """
    for name in MEASUREMENTS:
        sentence = sentence.replace(name, words(name))
    return sentence[:1].upper() + sentence[1:]


def words(name: str) -> str:
    """Return a name with spaces for underscores."""
    return name.replace("_", " ")


def when(stamp: str | None) -> str:
    """Return a time of day for readers."""
    if stamp is None:
        return "–"
    return f"{datetime.fromisoformat(stamp):%Y-%m-%d %H:%M:%S} UTC"
