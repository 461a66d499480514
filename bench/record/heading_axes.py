"""Axes of the report's plots of heading error against heading, and where a value lies in them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bench.record.svg import line, words

WIDTH, HEIGHT = 520.0, 250.0
LEFT, RIGHT, TOP, BOTTOM = 52.0, 14.0, 12.0, 34.0
_HEADROOM = 1.08


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingAxes:
    """Scales of one plot: heading 0 to 360 deg, error from -top_deg to top_deg in steps."""

    top_deg: float
    step_deg: float

    def x_of(self, heading_deg: float) -> float:
        """Return where a heading lies."""
        return LEFT + (WIDTH - LEFT - RIGHT) * heading_deg / 360.0

    def y_of(self, error_deg: float) -> float:
        """Return where an error lies."""
        return TOP + (HEIGHT - TOP - BOTTOM) * (self.top_deg - error_deg) / (2.0 * self.top_deg)

    def parts(self) -> list[str]:
        """Return the grid with its numbers and names."""
        parts = []
        for heading in range(0, 361, 45):
            x = self.x_of(heading)
            parts.append(line(x, TOP, x, HEIGHT - BOTTOM, "grid"))
            parts.append(words(x, HEIGHT - BOTTOM + 14, f"{heading}", "middle"))
        last = round(self.top_deg / self.step_deg)
        for index in range(-last, last + 1):
            y = self.y_of(index * self.step_deg)
            parts.append(line(LEFT, y, WIDTH - RIGHT, y, "zero" if index == 0 else "grid"))
            label = f"{index * self.step_deg:g}".replace("-", "\N{MINUS SIGN}")
            parts.append(words(LEFT - 6, y + 3.5, label, "end"))
        parts.append(words((LEFT + WIDTH) / 2, HEIGHT - 4, "magnetic heading, deg", "middle"))
        middle = (TOP + HEIGHT - BOTTOM) / 2
        turned = f'<text transform="translate(12 {middle:.1f}) rotate(-90)" text-anchor="middle">'
        return [*parts, f"{turned}error, deg</text>"]


def heading_axes(largest_deg: float) -> HeadingAxes:
    """Return the axes of errors up to the largest, with a little room above it."""
    step_deg = tick_step(2.0 * largest_deg * _HEADROOM, 6)
    top_deg = step_deg * math.ceil(largest_deg * _HEADROOM / step_deg)
    return HeadingAxes(top_deg=top_deg, step_deg=step_deg)


def tick_step(span: float, count: int = 5) -> float:
    """Return a step of 1, 2 or 5 times a power of ten that gives about `count` ticks.

    >>> tick_step(1.0), tick_step(70.0)
    (0.2, 20.0)
    """
    rough = max(span, 1e-9) / count
    power = 10.0 ** math.floor(math.log10(rough))
    factor = next(f for f in (1.0, 2.0, 5.0, 10.0) if f * power >= rough * 0.999)
    return round(factor * power, 12)
