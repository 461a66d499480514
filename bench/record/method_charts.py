"""Inline SVG of the comparison of methods: errors over three decades, and curves side by side."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from bench.record.method_study import CLAIM_COVERS
from bench.record.svg import circle, diamond, frame, line, polygon, polyline, words

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from markupsafe import Markup

    from bench.record.method_study import MethodRow, OrderRow
    from bench.record.swing import ExpectedPoint, HeadingPoint

SMALLEST_DEG: Final = 0.05
LARGEST_DEG: Final = 60.0
"""Ends of the logarithmic scale; what lies beyond them points outwards."""
_DECADES: Final = (0.1, 1.0, 10.0)
_MARGIN: Final = 8.0
_DOTS_WIDTH: Final = 206.0
_ROW: Final = 16.0
_LANES: Final = {"level": 7.0, "tilt": 18.0}
_TWO_LANES: Final = 25.0
"""Height of a strip with a lane of level and one of tilted errors, and where these lie."""
_BEND_DEG: Final = 0.02
"""Where the axis of a panel turns from linear to logarithmic."""
_TOPS_DEG: Final = (1.0, 3.0, 10.0, 30.0, 60.0, 180.0)
_WIDTH, _HEIGHT = 260.0, 150.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 34.0, 6.0, 6.0, 18.0


def error_scale() -> Markup:
    """Return the head of the column of `error_dots`: the decades of its scale."""
    parts = [words(_scale_x(value), 11.0, f"{value:g}", "middle") for value in _DECADES]
    parts.append(words(_scale_x(LARGEST_DEG), 11.0, "deg", "end"))
    return frame(_DOTS_WIDTH, _ROW, "logarithmic scale of heading error, deg", parts, "dots")


def error_dots(row: MethodRow, limits_deg: Mapping[str, float]) -> Markup:
    """Return a method's largest errors, level above tilted, on the logarithmic scale.

    A bar is the method's own claim on the poses that it covers, a hollow mark the expected
    error, a filled one what was achieved.

    Parameters
    ----------
    limits_deg : mapping
        Upper limits under "level" and "tilted", where there are such limits.
    """
    parts = [line(_scale_x(v), 0.0, _scale_x(v), _TWO_LANES, "grid") for v in _DECADES]
    for kind, achieved_deg in (("level", row.level_max_deg), ("tilt", row.tilt_max_deg)):
        y = _LANES[kind]
        name = "tilted" if kind == "tilt" else kind
        parts.append(line(_MARGIN, y, _DOTS_WIDTH - _MARGIN, y, "track"))
        if name in limits_deg:
            x = _scale_x(limits_deg[name])
            parts.append(line(x, y - 5.5, x, y + 5.5, f"limit {name}"))
        parts += _claim(row, kind, y)
        expected_deg = row.expected.get(f"{kind}_max_deg")
        if expected_deg is not None and achieved_deg is not None:
            parts.append(line(_scale_x(expected_deg), y, _scale_x(achieved_deg), y, "between"))
        parts += _mark(name, expected_deg, y, "expected")
        parts += _mark(name, achieved_deg, y, "")
    title = f"{row.name}: largest heading errors claimed, expected and achieved"
    return frame(_DOTS_WIDTH, _TWO_LANES, title, parts, "dots two")


def order_dots(row: OrderRow) -> Markup:
    """Return a method's largest error in every order, tilted where there are tilted poses.

    The product's own order is filled.
    """
    parts = _scale_lines()
    for effect in reversed(row.effects):
        other = "" if effect is row.effects[0] else " other"
        if effect.tilt_max_deg is not None:
            tip = f"{effect.name}: tilted {effect.tilt_max_deg:.3g} deg"
            x = _scale_x(effect.tilt_max_deg)
            parts.append(diamond(x, _ROW / 2, 4.5, f"mark tilted{other}", tip))
        elif effect.level_max_deg is not None:
            tip = f"{effect.name}: level {effect.level_max_deg:.3g} deg"
            x = _scale_x(effect.level_max_deg)
            parts.append(circle(x, _ROW / 2, 3.6, f"mark{other or ' level'}", tip))
    title = f"{row.name}: largest error by order of compensation"
    return frame(_DOTS_WIDTH, _ROW, title, parts, "dots")


def method_panel(
    points: Sequence[HeadingPoint],
    raw: Sequence[HeadingPoint],
    expected: Sequence[ExpectedPoint] = (),
    *,
    top_deg: float,
    limit_deg: float | None,
    title: str,
) -> Markup:
    """Return heading error against heading of one method, the curve of `raw` faint behind it.

    The band is what was expected, two standard deviations wide on each side. The axis is linear
    next to zero and logarithmic on both sides of it, so that one scale holds all methods.
    """

    def x_of(heading_deg: float) -> float:
        return _LEFT + (_WIDTH - _LEFT - _RIGHT) * heading_deg / 360.0

    def y_of(error_deg: float) -> float:
        share = _signed_log(error_deg) / _signed_log(top_deg)
        return _TOP + (_HEIGHT - _TOP - _BOTTOM) * (1.0 - share) / 2.0

    parts = _panel_axes(x_of, y_of, top_deg)
    for limit in () if limit_deg is None or limit_deg > top_deg else (limit_deg, -limit_deg):
        parts.append(line(_LEFT, y_of(limit), _WIDTH - _RIGHT, y_of(limit), "limit"))
    parts += _band(expected, x_of, y_of)
    own = () if expected else ((points, "curve after" if raw else "curve before"),)
    for rows, style in ((raw, "curve before"), *own):
        ordered = sorted(rows, key=lambda p: p.heading_deg)
        path = [(x_of(p.heading_deg), y_of(p.error_deg)) for p in ordered]
        parts += [polyline(path, style)] if len(path) > 2 else []
    style = "mark level" if raw else "mark raw"
    for p in points:
        tip = f"{p.heading_deg:.1f} deg: {p.error_deg:+.3f} deg"
        parts.append(circle(x_of(p.heading_deg), y_of(p.error_deg), 2.1, style, tip))
    return frame(_WIDTH, _HEIGHT, title, parts)


def panel_top_deg(points: Sequence[HeadingPoint]) -> float:
    """Return the end of the axis that holds all points."""
    largest = max((abs(point.error_deg) for point in points), default=0.0)
    return next((top for top in _TOPS_DEG if top >= 1.05 * largest), _TOPS_DEG[-1])


def _panel_axes(
    x_of: Callable[[float], float], y_of: Callable[[float], float], top_deg: float
) -> list[str]:
    parts = []
    for heading in (0, 90, 180, 270, 360):
        parts.append(line(x_of(heading), _TOP, x_of(heading), _HEIGHT - _BOTTOM, "grid"))
        anchor = {0: "start", 360: "end"}.get(heading, "middle")
        parts.append(words(x_of(heading), _HEIGHT - 5, f"{heading}", anchor))
    for value in (0.0, *_DECADES):
        for sign in (1.0, -1.0) if 0.0 < value <= top_deg else (1.0,) if not value else ():
            y = y_of(sign * value)
            parts.append(line(_LEFT, y, _WIDTH - _RIGHT, y, "grid" if value else "zero"))
            parts.append(words(_LEFT - 4, y + 3.5, f"{sign * value:g}".replace("-", "−"), "end"))
    return parts


def _signed_log(error_deg: float) -> float:
    return math.copysign(math.log10(1.0 + abs(error_deg) / _BEND_DEG), error_deg)


def _scale_x(value_deg: float) -> float:
    """Return the place of an error on the logarithmic scale, held to its ends."""
    held = min(max(value_deg, SMALLEST_DEG), LARGEST_DEG)
    share = math.log(held / SMALLEST_DEG) / math.log(LARGEST_DEG / SMALLEST_DEG)
    return _MARGIN + (_DOTS_WIDTH - 2.0 * _MARGIN) * share


def _scale_lines() -> list[str]:
    base = line(_MARGIN, _ROW / 2, _DOTS_WIDTH - _MARGIN, _ROW / 2, "track")
    return [base, *(line(_scale_x(v), 0.0, _scale_x(v), _ROW, "grid") for v in _DECADES)]


def _mark(name: str, error_deg: float | None, y: float, kind: str) -> list[str]:
    """Return the mark of a level or a tilted error, hollow where it is the expected one."""
    if error_deg is None:
        return []
    tip = f"{name}{', ' if kind else ''}{kind} {error_deg:.3g} deg"
    style = f"mark {name}{' other' if kind else ''}"
    if name == "tilted":
        return [diamond(_scale_x(error_deg), y, 4.5, style, tip)]
    return [circle(_scale_x(error_deg), y, 3.6, style, tip)]


def _claim(row: MethodRow, kind: str, y: float) -> list[str]:
    if row.claimed_max_deg is None or kind not in CLAIM_COVERS.get(row.claim_without, ()):
        return []
    x = _scale_x(row.claimed_max_deg)
    return [line(x, y - 5.0, x, y + 5.0, "claim unsaid" if row.unsaid else "claim")]


def _band(
    expected: Sequence[ExpectedPoint],
    x_of: Callable[[float], float],
    y_of: Callable[[float], float],
) -> list[str]:
    """Return what was expected: a band of two standard deviations, and its middle."""
    if len(expected) <= 2:
        return []
    ordered = sorted(expected, key=lambda p: p.heading_deg)
    upper = [(x_of(p.heading_deg), y_of(p.error_deg + 2.0 * p.sd_deg)) for p in ordered]
    lower = [(x_of(p.heading_deg), y_of(p.error_deg - 2.0 * p.sd_deg)) for p in ordered]
    middle = [(x_of(p.heading_deg), y_of(p.error_deg)) for p in ordered]
    return [polygon([*upper, *reversed(lower)], "expected"), polyline(middle, "curve expected")]
