"""Inline SVG of the uncertainty: verified errors between their limits, bars of the budget."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from bench.record.heading_axes import HEIGHT, LEFT, RIGHT, WIDTH, heading_axes
from bench.record.svg import circle, diamond, frame, line, rectangle, words

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from markupsafe import Markup

    from bench.record.charts import Band

_BAR_WIDTH, _BAR_HEIGHT = 150.0, 14.0
_CAP: Final = 2.6


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifiedPose:
    """One verified pose: magnetic heading, error, U of the certificate and U of the test."""

    position: int
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    error_deg: float
    u_deg: float
    u_test_deg: float


def verified_chart(
    poses: Sequence[VerifiedPose], band: Band | None, name: str, title: str
) -> Markup:
    """Return verified errors with +-U (thin) and +-U of the test (thick) between their limits.

    Parameters
    ----------
    band : Band or None
        Limit, and the guard band by which the acceptance limit lies inside it.
    name : str
        "level" or "tilted": style of the marks.
    """
    largest = max(
        [abs(pose.error_deg) + max(pose.u_deg, pose.u_test_deg) for pose in poses]
        + [band.limit_deg if band else 0.0]
    )
    axes = heading_axes(largest)
    x_of, y_of = axes.x_of, axes.y_of
    parts = axes.parts()
    parts += _limits(band, y_of) if band else []
    for pose in poses:
        parts += _whiskers(pose, x_of(pose.heading_deg), y_of, name)
    return frame(WIDTH, HEIGHT, title, parts)


def budget_bar(name: str, level_deg: float, tilted_deg: float, top_deg: float) -> Markup:
    """Return one contribution as two bars, level above tilted, the longest as long as `top_deg`."""
    scale = (_BAR_WIDTH - 4.0) / top_deg if top_deg > 0.0 else 0.0
    parts = [
        rectangle(2.0, 1.5, level_deg * scale, 4.5, "part level"),
        rectangle(2.0, 8.0, tilted_deg * scale, 4.5, "part tilted"),
    ]
    return frame(_BAR_WIDTH, _BAR_HEIGHT, f"{name}: contribution to the heading", parts, "budget")


def _limits(band: Band, y_of: Callable[[float], float]) -> list[str]:
    """Return the limit, the acceptance limit inside it, and the guard band between them."""
    right, parts = WIDTH - RIGHT, []
    accept_deg = band.limit_deg - band.guard_deg
    for sign in (1.0, -1.0):
        outer, inner = y_of(sign * band.limit_deg), y_of(sign * accept_deg)
        parts.append(rectangle(LEFT, min(outer, inner), right - LEFT, abs(outer - inner), "guard"))
        parts.append(line(LEFT, outer, right, outer, "limit"))
        parts.append(line(LEFT, inner, right, inner, "accept"))
    label = f"limit {band.limit_deg:g}, accepted to {accept_deg:.3g}"
    return [*parts, words(right - 4, y_of(band.limit_deg) - 4, label, "end", "limit-label")]


def _whiskers(pose: VerifiedPose, x: float, y_of: Callable[[float], float], name: str) -> list[str]:
    error, u, u_test = pose.error_deg, pose.u_deg, pose.u_test_deg
    parts = [line(x, y_of(error - u), x, y_of(error + u), f"whisker {name}")]
    parts += [
        line(x - _CAP, y_of(end), x + _CAP, y_of(end), f"whisker {name}")
        for end in (error - u, error + u)
    ]
    parts.append(line(x, y_of(error - u_test), x, y_of(error + u_test), f"whisker test {name}"))
    tip = (
        f"position {pose.position}, heading {pose.heading_deg:.1f} deg, pitch "
        f"{pose.pitch_deg:.1f}, roll {pose.roll_deg:.1f}: {error:+.3f} deg, U {u:.3f}, "
        f"U of the test {u_test:.3f}"
    )
    if name == "tilted":
        return [*parts, diamond(x, y_of(error), 4.0, "mark tilted", tip)]
    return [*parts, circle(x, y_of(error), 3.0, "mark level", tip)]
