"""One measurement as a bar between its limits, for a terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from bench.acceptance.measurement import Measurement

_WIDTH: Final = 24
_INSIDE: Final = "-"
_GUARD: Final = "~"
_MARK: Final = "#"


def limit_bar(measurement: Measurement, width: int = _WIDTH) -> str:
    """Return ``[---#------~~]``: the limits at the brackets, the value at the mark.

    A one-sided limit starts at zero or ends at twice its value; the guard band is drawn with
    ``~``. A value outside the limits stands before or behind the brackets as ``<`` or ``>``, one
    that could not be measured as ``?``.
    """
    limit = measurement.limit
    if limit is None or (limit.low is None and limit.high is None):
        return " " * (width + 4)
    low = limit.low if limit.low is not None else min(0.0, limit.high or 0.0)
    high = limit.high if limit.high is not None else max(2.0 * low, low + 1.0)
    span = high - low
    if span <= 0.0:
        inside = measurement.value == low
        return ("=" if inside else "x").center(width + 4)
    cells = [_INSIDE] * width
    guard = min(width // 2, round(limit.guard_band / span * width))
    for index in range(guard):
        if limit.low is not None:
            cells[index] = _GUARD
        if limit.high is not None:
            cells[width - 1 - index] = _GUARD
    before, behind = " ", " "
    if math.isnan(measurement.value):
        behind = "?"
    elif measurement.value < low:
        before = "<"
    elif measurement.value > high:
        behind = ">" if limit.high is not None else " "
        cells[-1] = _MARK if limit.high is None else cells[-1]
    else:
        cells[min(width - 1, int((measurement.value - low) / span * width))] = _MARK
    return f"{before}[{''.join(cells)}]{behind}"


def limits_text(measurement: Measurement) -> str:
    """Return the limits with their unit, ``0.2 .. 0.5 deg`` or ``<= 0.5 deg``."""
    limit = measurement.limit
    if limit is None:
        return measurement.unit
    if limit.low is None and limit.high is None:
        return limit.unit
    if limit.low is None:
        return f"<= {limit.high:g} {limit.unit}".rstrip()
    if limit.high is None:
        return f">= {limit.low:g} {limit.unit}".rstrip()
    if limit.low == limit.high:
        return f"= {limit.low:g} {limit.unit}".rstrip()
    return f"{limit.low:g} .. {limit.high:g} {limit.unit}".rstrip()
