"""The reproduced papers as files: README.md, results.json and one SVG a figure."""

from __future__ import annotations

import json
import math
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from bench.errors import ConfigError
from bench.record.plain import plain
from bench.reproduction.figures import drawing_style, svg_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from bench.reproduction.result import Published, Reproduction

SCHEMA: Final = "compass-bench/reproduction/1"
DIGITS: Final = 9
"""Significant digits of results.json: below them machines may differ."""
_HEAD: Final = """\
# The four papers, reproduced

Our numbers and the dots in the figures were measured on the virtual bench: the rig turned, the
module sent its readings over CAN, and the product's own calibration worked on them. Exact values,
exact lines, the dips of (25) and the geomagnetic pole are computed.
`make papers` writes the page anew, with the same bytes; `make test` holds every number.

A number holds where ours differs from the published one by no more than the tolerance. Where
the paper itself is off, or prints a limit or nothing (–), the exact value stands beside it and
ours is held against that. All numbers for programs: [results.json](results.json).
"""


def document_of(reproductions: Iterable[Reproduction]) -> dict[str, Any]:
    """Return the JSON object of papers; numbers that are not finite are null."""
    papers = [_rounded(plain(reproduction.entry())) for reproduction in reproductions]
    return {
        "schema": SCHEMA,
        "holds": all(paper["holds"] for paper in papers),
        "papers": papers,
    }


def json_of(reproductions: Iterable[Reproduction]) -> str:
    """Return results.json."""
    return json.dumps(document_of(reproductions), indent=1, allow_nan=False) + "\n"


def markdown_of(reproductions: Sequence[Reproduction]) -> str:
    """Return README.md: for each paper its setup, its figures and its numbers."""
    summary = ["| paper | numbers | hold | figures |", "|---|---|---|---|"]
    for one in reproductions:
        held = sum(number.holds for number in one.numbers)
        link = f"[{one.title}](#{_anchor(one.title)})"
        summary.append(f"| {link} | {len(one.numbers)} | {held} | {len(one.figures)} |")
    parts = [_HEAD, "\n".join(summary) + "\n", *(_section(one) for one in reproductions)]
    return "\n".join(parts)


def files_of(reproductions: Sequence[Reproduction]) -> dict[str, bytes]:
    """Return the page's files by name; every figure is drawn."""
    files = {
        "README.md": markdown_of(reproductions).encode(),
        "results.json": json_of(reproductions).encode(),
    }
    with drawing_style():
        for reproduction in reproductions:
            for figure in reproduction.figures:
                files[f"{figure.name}.svg"] = svg_of(figure.draw())
    return files


def require_folder(folder: Path) -> Path:
    """Make a folder and see that it takes files.

    Raises
    ------
    ConfigError
        If it cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        message = (
            f"--out must be a folder that can be written; instead received {folder}: "
            f"{error.strerror or error}"
        )
        raise ConfigError(message) from error
    return folder


def write_page(folder: Path, reproductions: Sequence[Reproduction]) -> Path:
    """Write the page into a folder and return the path of README.md.

    All is drawn before the first file is written, and each file is replaced as a whole.
    """
    for name, content in files_of(reproductions).items():
        handle, temporary = tempfile.mkstemp(dir=folder, prefix=f".{name}.")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            Path(temporary).chmod(0o644)
            Path(temporary).replace(folder / name)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    return folder / "README.md"


def printed_text(value: float | None) -> str:
    """Return a number as short as it is given; a dash where the paper prints none.

    >>> printed_text(48.72), printed_text(None), printed_text(0.1 + 0.2), printed_text(math.nan)
    ('48.72', '', '0.3', '–')
    """
    if value is None:
        return ""
    return f"{value:.7g}" if math.isfinite(value) else "–"


def value_text(number: Published, value: float | None) -> str:
    """Return one of a number's values with the digits that its tolerance and the paper give."""
    if value is None:
        return ""
    if not math.isfinite(value):
        return "none"
    digits = len(printed_text(number.published).partition(".")[2])
    if number.tolerance > 0.0:
        digits = max(digits, 1 - math.floor(math.log10(number.tolerance)))
    return f"{value:.{min(max(digits, 0), 9)}f}"


def _section(one: Reproduction) -> str:
    lines = [f"## {one.title}", ""]
    for remark in one.remarks:
        lines += [remark, ""]
    for figure in one.figures:
        lines += [f"![{figure.title}]({figure.name}.svg)", ""]
        lines += [f"**{figure.title}.** {figure.caption}", ""]
    remarks = list(dict.fromkeys(_remark(number) for number in one.numbers))
    lines += [
        "| where | quantity | published | exact | ours | tolerance | holds |",
        "|---|---|---:|---:|---:|---:|---|",
        *(_row(number, remarks.index(_remark(number)) + 1) for number in one.numbers),
        "",
        "Why these tolerances, and notes:",
        "",
        *(f"{index}. {remark}" for index, remark in enumerate(remarks, start=1)),
        "",
    ]
    return "\n".join(lines)


def _row(number: Published, remark: int) -> str:
    unit = f" ({number.unit})" if number.unit else ""
    cells = (
        number.where,
        f"{number.quantity}{unit}",
        printed_text(number.published),
        value_text(number, number.exact),
        value_text(number, number.ours),
        f"{number.tolerance:.2g} [{remark}]",
        "yes" if number.holds else "**no**",
    )
    return f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"


def _remark(number: Published) -> str:
    sentences = (part.strip() for part in (number.reason, number.note))
    return " ".join(f"{part[0].upper()}{part[1:].rstrip('.')}." for part in sentences if part)


def _anchor(title: str) -> str:
    kept = "".join(c for c in title.lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


def _rounded(value: Any) -> Any:
    """Return a JSON value with floats of `DIGITS` significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, list):
        return [_rounded(entry) for entry in value]
    if isinstance(value, dict):
        return {key: _rounded(entry) for key, entry in value.items()}
    return value
