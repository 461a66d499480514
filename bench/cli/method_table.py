"""All methods of a run in a few lines of a terminal: claimed, expected and achieved error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from bench.record.method_study import error_words, method_rows, no_model

if TYPE_CHECKING:
    from collections.abc import Mapping

    from bench.record.method_study import MethodRow

HEAD: Final = (
    "RMS, deg (level / tilted)", "own claim", "expected", "achieved", "the claim is",
)  # fmt: skip
WIDTHS: Final = (26, 9, 16, 16)


def method_table(record: Mapping[str, Any]) -> list[str]:
    """Return a head, a line for raw and each accepted method by rank, and what the marks mean.

    Where there are both, an error is ``level / tilted``. Empty where the run achieved nothing on
    verification poses.
    """
    rows = [row for row in method_rows(record) if not row.cause and _achieved(row).strip(" –/")]
    if not rows:
        return []
    lines = [_line(*HEAD), *(_of(row) for row in rows)]
    if any(row.unsaid for row in rows):
        lines.append("! wrong without saying so: over twice what claim and reading noise explain")
    missing = no_model(record)
    if missing:
        lines.append(f"no expected error: {missing}")
    return lines


def _of(row: MethodRow) -> str:
    name = f"{row.name}, written" if row.written else row.name
    claim = f"{error_words(row.claimed_rms_deg)} {'!' if row.unsaid else ' '}"
    expected = _pair(row.expected.get("level_rms_deg"), row.expected.get("tilt_rms_deg"))
    return _line(name, claim, expected, _achieved(row), row.claim_without)


def _line(name: str, claim: str, expected: str, achieved: str, without: str) -> str:
    first, second, third, fourth = WIDTHS
    cells = f"{name:<{first}}{claim:>{second}}  {expected:>{third}}  {achieved:>{fourth}}"
    return f"{cells}   {without}".rstrip()


def _achieved(row: MethodRow) -> str:
    return _pair(row.level_rms_deg, row.tilt_rms_deg)


def _pair(level_deg: float | None, tilt_deg: float | None) -> str:
    if level_deg is not None and tilt_deg is not None:
        return f"{error_words(level_deg)} / {error_words(tilt_deg)}"
    return error_words(tilt_deg if level_deg is None else level_deg)
