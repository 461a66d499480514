"""Inline SVG of the report. Colours are classes, so that the page's scheme decides them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from markupsafe import Markup

from bench.record.heading_axes import HEIGHT, LEFT, RIGHT, WIDTH, heading_axes, tick_step
from bench.record.svg import circle, diamond, frame, line, polyline, words

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from bench.record.swing import HeadingPoint

LABEL_ROOM = 13.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A symmetric limit drawn into a plot of errors, and the guard band inside it."""

    limit_deg: float
    guard_deg: float
    name: str


def heading_error_chart(
    points: Sequence[HeadingPoint], bands: Sequence[Band], title: str
) -> Markup:
    """Return a plot of heading error against heading, every pose one mark, nothing averaged."""
    largest = max([abs(p.error_deg) for p in points] + [b.limit_deg for b in bands], default=1.0)
    axes = heading_axes(largest)
    x_of, y_of = axes.x_of, axes.y_of
    parts = [*axes.parts(), *_bands(bands, y_of)]
    parts += _curve(points, x_of, y_of)
    parts += [_mark(p, x_of(p.heading_deg), y_of(p.error_deg)) for p in points]
    return frame(WIDTH, HEIGHT, title, parts)


def _bands(bands: Sequence[Band], y_of: Any) -> list[str]:
    parts = []
    for band in bands:
        for sign in (1.0, -1.0):
            y = y_of(sign * band.limit_deg)
            parts.append(line(LEFT, y, WIDTH - RIGHT, y, f"limit {band.name}"))
            inner = y_of(sign * (band.limit_deg - band.guard_deg))
            parts.append(
                f'<rect class="guard" x="{LEFT:.1f}" width="{WIDTH - LEFT - RIGHT:.1f}" '
                f'y="{min(y, inner):.1f}" height="{abs(inner - y):.1f}"/>'
            )
    heights = [y_of(band.limit_deg) for band in bands]
    labels = [f"{band.name} limit {band.limit_deg:g}" for band in bands]
    if len(heights) > 1 and abs(heights[0] - heights[1]) < LABEL_ROOM:
        heights, labels = [min(heights) - LABEL_ROOM - 3.0], [", ".join(labels)]
    for y, label in zip(heights, labels, strict=True):
        parts.append(words(WIDTH - RIGHT - 4, y + 11, label, "end", "limit-label"))
    return parts


def _curve(points: Sequence[HeadingPoint], x_of: Any, y_of: Any) -> list[str]:
    parts = []
    for direction in (1, -1, 0):
        row = sorted(
            (p for p in points if p.level and p.direction == direction),
            key=lambda p: p.heading_deg,
        )
        if len(row) > 2:
            path = [(x_of(p.heading_deg), y_of(p.error_deg)) for p in row]
            parts.append(polyline(path, "curve"))
    return parts


def _mark(point: HeadingPoint, x: float, y: float) -> str:
    where = "level" if point.level else "tilted"
    tip = f"{where}, {point.heading_deg:.1f} deg: {point.error_deg:+.3f} deg"
    if not point.level:
        return diamond(x, y, 4, "mark tilted", tip)
    return circle(x, y, 3, "mark counter" if point.direction < 0 else "mark level", tip)


def xy_chart(
    raw_xy_mg: Sequence[tuple[float, float]],
    corrected_xy_mg: Sequence[tuple[float, float]],
    horizontal_mg: float,
    title: str,
) -> Markup:
    """Return the level turn in the plane of x and y, before and after, with the field's circle."""
    size = HEIGHT
    values = [abs(v) for xy in [*raw_xy_mg, *corrected_xy_mg] for v in xy] + [horizontal_mg]
    top = max(values) * 1.12

    def at(value: float) -> float:
        return size / 2.0 * (1.0 + value / top)

    step = tick_step(2.0 * top, 5)
    parts = []
    for index in range(-int(top / step), int(top / step) + 1):
        style = "zero" if index == 0 else "grid"
        parts.append(line(at(index * step), 0.0, at(index * step), size, style))
        parts.append(line(0.0, at(index * step), size, at(index * step), style))
        if index and 14.0 < at(index * step) < size - 14.0:
            parts.append(words(at(index * step), size / 2 + 12, f"{index * step:g}", "middle"))
    radius = at(horizontal_mg) - at(0.0)
    parts.append(circle(size / 2, size / 2, round(radius, 1), "truth"))
    for style, rows in (("raw", raw_xy_mg), ("level", corrected_xy_mg)):
        parts += [circle(at(y), size - at(x), 2.6, f"mark {style}") for x, y in rows]
    parts.append(words(size - 4, size / 2 - 5, "y, mG", "end"))
    parts.append(words(size / 2 + 5, 11, "x, mG", "start"))
    return frame(size, size, title, parts)


def limit_bar(entry: Mapping[str, Any]) -> Markup:
    """Return the bar of one measurement: limits, guard band, value with its uncertainty."""
    low, high, value = entry["low"], entry["high"], entry["value"]
    if value is None or (low is None and high is None):
        return Markup("")
    width, height = 170.0, 16.0
    bottom, top = _bar_range(low, high, value)
    if top <= bottom:
        return Markup("")

    def x_of(v: float) -> float:
        return 6.0 + (width - 12.0) * min(max((v - bottom) / (top - bottom), 0.0), 1.0)

    inside_low = bottom if low is None else low
    inside_high = top if high is None else high
    band = entry["guard_band"] or 0.0
    left = x_of(inside_low + (band if low is not None else 0.0))
    right = x_of(inside_high - (band if high is not None else 0.0))
    parts = [
        f'<rect class="track" x="6" y="6" width="{width - 12:.1f}" height="4" rx="2"/>',
        _span("guard", x_of(inside_low), x_of(inside_high)),
        _span("inside", left, max(left, right)),
    ]
    parts += [line(x_of(v), 2.0, x_of(v), 14.0, "edge") for v in (low, high) if v is not None]
    spread = entry["uncertainty"] or 0.0
    if spread:
        parts.append(line(x_of(value - spread), 8.0, x_of(value + spread), 8.0, "spread"))
    outcome = str(entry["outcome"] or "").lower()
    parts.append(_pointer(x_of(value), bottom <= value <= top, value > bottom, outcome))
    return frame(width, height, f"{entry['name']} against its limits", parts, "bar")


def _pointer(x: float, visible: bool, above: bool, outcome: str) -> str:
    if visible:
        return f'<circle class="value {outcome}" cx="{x:.1f}" cy="8" r="4"/>'
    way = 6 if above else -6
    return f'<path class="value {outcome}" d="M{x - way:.1f} 3 L{x:.1f} 8 L{x - way:.1f} 13z"/>'


def _bar_range(low: float | None, high: float | None, value: float) -> tuple[float, float]:
    if low is not None and high is not None:
        margin = 0.2 * (high - low) or max(abs(high), 1.0)
        return low - margin, high + margin
    if high is not None:
        return (0.0, high * 1.3) if high > 0.0 <= value else (min(value, high) - 1.0, high + 1.0)
    edge = low or 0.0
    if edge > 0.0:
        return 0.0, max(edge * 2.0, value * 1.1)
    return edge - 1.0, max(value, edge) + 1.0


def _span(style: str, left: float, right: float) -> str:
    width = max(right - left, 0.0)
    return f'<rect class="{style}" x="{left:.1f}" y="5" width="{width:.1f}" height="6"/>'
