"""Pieces of inline SVG: lines, words, the frame around them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from markupsafe import Markup

if TYPE_CHECKING:
    from collections.abc import Sequence


def line(x1: float, y1: float, x2: float, y2: float, style: str) -> str:
    """Return a line of a style."""
    return f'<line class="{style}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def words(x: float, y: float, text: str, anchor: str, style: str = "") -> str:
    """Return a text, anchored at its start, middle or end."""
    kind = f' class="{style}"' if style else ""
    return (
        f'<text{kind} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{Markup.escape(text)}</text>'
    )


def rectangle(x: float, y: float, width: float, height: float, style: str) -> str:
    """Return a filled rectangle of a style."""
    return (
        f'<rect class="{style}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>'
    )


def circle(x: float, y: float, radius: float, style: str, tip: str = "") -> str:
    """Return a round mark; `tip` shows where the pointer rests."""
    return (
        f'<circle class="{style}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}"{_ending(tip, "circle")}'
    )


def diamond(x: float, y: float, half: float, style: str, tip: str = "") -> str:
    """Return a diamond, `half` its half-diagonal."""
    path = f"M{x:.1f} {y - half:.1f}l{half:g} {half:g}-{half:g} {half:g}-{half:g}-{half:g}z"
    return f'<path class="{style}" d="{path}"{_ending(tip, "path")}'


def polyline(points: Sequence[tuple[float, float]], style: str) -> str:
    """Return a line through points."""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline class="{style}" points="{path}"/>'


def polygon(points: Sequence[tuple[float, float]], style: str) -> str:
    """Return a filled shape."""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polygon class="{style}" points="{path}"/>'


def frame(
    width: float, height: float, title: str, parts: Sequence[str], style: str = "chart"
) -> Markup:
    """Return the drawing; `title` is what a screen reader says."""
    opening = f'<svg class="{style}" viewBox="0 0 {width:g} {height:g}" role="img" '
    label = Markup.escape(title)
    return Markup(f'{opening}aria-label="{label}">{"".join(parts)}</svg>')  # noqa: S704


def _ending(tip: str, tag: str) -> str:
    return f"><title>{Markup.escape(tip)}</title></{tag}>" if tip else "/>"
