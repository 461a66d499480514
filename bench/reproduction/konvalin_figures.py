"""Drawings of Konvalin's figures and of the studies beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import Order
from bench.reproduction import figures
from bench.reproduction.konvalin_iron import stages_mg
from bench.reproduction.konvalin_tilt import (
    BANK,
    DIPS_DEG,
    ELEVATION_DEG,
    HEADINGS_DEG,
    TILTS_DEG,
    changes_deg,
)
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.reproduction.konvalin_iron import Corrected, SoftIronStudy
    from bench.reproduction.konvalin_tilt import Elevation, OrderStudy

BREAK_DEG: Final = 120.0
"""A step between neighbours that is drawn as a gap: the heading wrapped."""


def draw_elevation(found: Elevation) -> Figure:
    """Draw Figs. 3 to 5: headings held while the elevation rises, then turns at its end."""
    figure, axes = figures.panels(2, 3, height_in=4.4)
    for held, colour, raw, levelled in zip(
        HEADINGS_DEG, figures.COLOURS, found.raw_deg, found.levelled_deg, strict=False
    ):
        name = f"{held:.0f} deg"
        figures.draw_printed(axes[0], found.pitch_deg, raw, name, color=colour)
        figures.draw_ours(axes[1], found.pitch_deg, levelled, name, color=colour)
        figures.draw_printed(
            axes[2], found.pitch_deg, changes_deg(raw[None])[0], name, color=colour
        )
    for one in axes[:3]:
        one.set_xlabel("elevation (deg)")
        one.set_xlim(0.0, ELEVATION_DEG)
    _draw_turns(axes[3:], found)
    for one in (axes[0], axes[1], axes[3], axes[4]):
        one.set_ylim(0.0, 360.0)
        one.set_yticks(range(0, 361, 90))
        one.set_ylabel("heading read (deg)")
    for one in (axes[2], axes[5]):
        figures.error_axis(one)
    titles = ("Fig. 3  not corrected", "Fig. 4  corrected", "Fig. 5  error of Fig. 3")
    for one, title in zip(axes[:3], titles, strict=True):
        one.set_title(title)
    for held in HEADINGS_DEG:
        figures.note(axes[1], 25.0, held + 3.0, f"held at {held:.0f}", ha="center", va="bottom")
    axes[4].legend(loc="upper left")
    return figure


def _draw_turns(axes: list[Axes], found: Elevation) -> None:
    raw, corrected, error = axes
    for dip_deg, colour, size in zip(DIPS_DEG, figures.COLOURS, (6.0, 4.6, 3.2, 1.8), strict=False):
        name = f"dip {dip_deg:.0f}"
        raw_deg = found.turn_raw_deg[dip_deg]
        figures.draw_printed(raw, found.turn_deg, _broken(raw_deg), name, color=colour)
        figures.draw_measured(
            corrected, found.turn_deg, found.turn_levelled_deg[dip_deg], name, color=colour,
            markersize=size,
        )  # fmt: skip
        figures.draw_printed(
            error, found.turn_deg, _broken(wrap_180_deg(raw_deg - found.turn_deg)), name,
            color=colour,
        )  # fmt: skip
    for one in axes:
        figures.heading_axis(one)
    error.set_ylim(-180.0, 180.0)
    error.set_yticks(range(-180, 181, 90))


def draw_circles(circle: Corrected, hard: Corrected) -> Figure:
    """Draw Figs. 6 and 7: the circle, and the circle that hard iron moves."""
    figure, (ideal, moved) = figures.panels(1, 2, height_in=3.1, sharex=True, sharey=True)
    _draw_plane(ideal, circle.raw.field_mg, figures.BLUE)
    _draw_plane(moved, hard.raw.field_mg, figures.RED, "as read")
    _draw_plane(moved, hard.corrected_mg, figures.BLUE, "less (1)-(2)")
    assert hard.fit.offset_mg is not None  # noqa: S101
    x, y = (float(value) for value in hard.fit.offset_mg[:2])
    moved.plot([x], [y], "+", color=figures.RED, markersize=8.0)
    figures.note(moved, -390.0, -345.0, rf"+ at $\alpha={x:.0f}$, $\beta={y:.0f}$")
    for one, title in ((ideal, "Fig. 6  no distortion"), (moved, "Fig. 7  hard iron")):
        figures.plane_axes(one)
        one.set_aspect("equal", adjustable="box")
        one.set_title(title)
    moved.set_xlim(-410.0, 410.0)
    moved.set_ylim(-370.0, 300.0)
    moved.legend(loc="upper right", borderaxespad=0.0)
    return figure


def _draw_plane(axes: Axes, field_mg: NDArray[np.float64], colour: str, label: str = "") -> None:
    figures.draw_measured(axes, field_mg[:, 0], field_mg[:, 1], label, color=colour)


def draw_magnitude(found: Corrected) -> Figure:
    """Draw Fig. 8: the ellipse and its magnitude with two cycles a turn."""
    figure, (plane, magnitude) = figures.panels(1, 2, height_in=2.7, width_ratios=(2, 3))
    x, y = found.raw.field_mg.T
    _draw_plane(plane, found.raw.field_mg, figures.RED)
    _draw_plane(plane, found.corrected_mg, figures.BLUE)
    figures.plane_axes(plane)
    plane.set_title("A")
    azimuth_deg = np.append(found.raw.azimuth_deg, 360.0)
    for field_mg, colour, name in (
        (found.raw.field_mg, figures.RED, "as read"),
        (found.corrected_mg, figures.BLUE, "corrected"),
    ):
        length = np.hypot(*field_mg.T)
        figures.draw_ours(
            magnitude, azimuth_deg, np.append(length, length[0]), name, color=colour, marker="o",
            markersize=2.2,
        )  # fmt: skip
    length = np.hypot(x, y)
    figures.note(
        magnitude, 180.0, float(length.max()) + 2.0, "major axis", ha="center", va="bottom"
    )
    for minor_deg in (90.0, 270.0):
        low_mg = float(length.min()) - 2.0
        figures.note(magnitude, minor_deg, low_mg, "minor axis", ha="center", va="top")
    figures.heading_axis(magnitude, "azimuth (deg)")
    magnitude.set_ylabel("magnitude (mG)")
    magnitude.margins(y=0.12)
    magnitude.set_title("B")
    figures.legend_above(magnitude, columns=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    return figure


def draw_rotation(found: Corrected) -> Figure:
    """Draw Figs. 9 and 10: the rotated ellipse, aligned, then scaled and turned back."""
    figure, axes = figures.panels(1, 4, height_in=1.9, sharex=True, sharey=True)
    titles = ("Fig. 9  as read", "Fig. 10  (5)-(6)", "scaled by q/r", "turned back")
    stages = [found.raw.field_mg, *stages_mg(found)]
    theta_rad = np.deg2rad(found.fit.extra["theta_deg"])
    directions = (theta_rad, 0.0, None, None)
    colours = (figures.RED, figures.ORANGE, figures.GREEN, figures.BLUE)
    for axes_one, stage, title, direction, colour in zip(
        axes, stages, titles, directions, colours, strict=True
    ):
        _draw_plane(axes_one, stage, colour)
        figures.plane_axes(axes_one)
        axes_one.set_title(title)
        axes_one.set_aspect("equal", adjustable="box")
        if direction is not None:
            reach = float(np.hypot(*stage.T).max())
            ends = np.array([-reach, reach])
            axes_one.plot(
                ends * np.cos(direction), ends * np.sin(direction), color=figures.INK,
                linewidth=0.8, linestyle=(0, (4, 2)),
            )  # fmt: skip
    figures.note(axes[0], 15.0, -60.0, rf"$\theta$ = {found.fit.extra['theta_deg']:.0f}")
    for one in axes[1:]:
        one.set_ylabel("")
    return figure


def draw_soft_iron(study: SoftIronStudy) -> Figure:
    """Draw what the printed and the corrected formula leave of soft iron."""
    figure, (over, by_axis) = figures.panels(1, 2, height_in=2.9)
    ways = (
        ("raw", "not corrected", figures.GREY, "-"),
        ("angle", "(4) as printed", figures.ORANGE, (0, (4, 1.8))),
        ("ratio", "(7) as printed", figures.RED, (0, (4, 1.8))),
        ("ours", "corrected", figures.BLUE, "-"),
    )
    azimuth_deg = np.append(study.azimuth_deg, 360.0)
    for name, label, colour, style in ways:
        errors_deg = study.errors_deg[name]
        over.plot(
            azimuth_deg, np.append(errors_deg, errors_deg[0]), color=colour, linestyle=style,
            label=label,
        )  # fmt: skip
        by_axis.plot(
            study.axis_deg, study.largest_deg[name], color=colour, linestyle=style, marker="o",
            markersize=2.6,
        )  # fmt: skip
    figures.heading_axis(over)
    figures.error_axis(over)
    over.set_title("a  major axis at 110 deg")
    by_axis.set_title("b  worst of 30 noisy turns")
    by_axis.set_xlabel("direction of the major axis (deg)")
    by_axis.set_ylabel("largest |error| (deg)")
    by_axis.set_xlim(-8.0, 180.0)
    by_axis.set_xticks(range(0, 181, 45))
    by_axis.set_ylim(-0.5, 24.0)
    figures.note(by_axis, -5.0, 22.6, "turns that fail by (4), in %:", color=figures.ORANGE)
    for axis_deg, share in zip(study.axis_deg, study.failed, strict=True):
        share_text = f"{100.0 * share:.0f}"
        figures.note(by_axis, float(axis_deg), 20.4, share_text, color=figures.ORANGE, ha="center")
    figure.legend(*over.get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


def draw_orders(study: OrderStudy) -> Figure:
    """Draw the largest heading error of each order over pitch and roll."""
    from matplotlib.colors import PowerNorm

    panels = (
        (Order.BODY, "hard iron, tilt"),
        (Order.TILT_FIRST, "tilt, hard iron"),
        (Order.TILT_REVERSED, "elevation before bank"),
        (BANK, "bank for roll"),
    )
    figure, axes = figures.panels(1, 4, height_in=2.0, sharey=True)
    norm = PowerNorm(0.6, 0.0, 25.0)
    for one, (way, title) in zip(axes, panels, strict=True):
        _draw_map(one, study.mapped_deg[str(way)], norm)
        one.set_title(title)
        one.set_xlabel("roll (deg)")
    axes[0].set_ylabel("pitch (deg)")
    return figure


def _draw_map(axes: Axes, errors_deg: NDArray[np.float64], norm: Normalize) -> None:
    axes.grid(visible=False)
    axes.imshow(errors_deg, origin="lower", cmap="Oranges", norm=norm, aspect="equal")
    ticks = range(len(TILTS_DEG))
    axes.set_xticks(ticks, [f"{tilt:.0f}" for tilt in TILTS_DEG])
    axes.set_yticks(ticks, [f"{tilt:.0f}" for tilt in TILTS_DEG])
    axes.tick_params(length=0.0)
    for side in axes.spines.values():
        side.set_visible(False)
    for row, column in np.ndindex(errors_deg.shape):
        value = float(errors_deg[row, column])
        colour = "white" if value > 12.0 else figures.INK
        figures.note(axes, column, row, f"{value:.1f}", color=colour, ha="center")


def _broken(values_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values with a gap where they wrap."""
    steps = np.abs(np.diff(values_deg, prepend=values_deg[0]))
    return np.where(steps > BREAK_DEG, np.nan, values_deg)
