"""Figures of docs/accuracy/after-the-run.md, from the record of one run.

`python benchmarks/accuracy_figures.py RUN` draws the figures of all three pages.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.record.method_study import method_words
from bench.reproduction.figures import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    draw_measured,
    error_axis,
    figure_legend,
    heading_axis,
    panels,
    printed_limit,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Record = Mapping[str, Any]

LEVEL_DEG: Final = 1.0
MOST_CONTRIBUTIONS: Final = 12


def methods_figure(record: Record) -> Figure:
    """Draw for every method what it claims, what the unit's model expects, what was achieved."""
    figure, axes = panels(1, 2, height_in=3.2, sharey=True)
    expected = record["study"]["expected"]
    fits = [fit for fit in record["fits"] if expected.get(fit["method"])]
    fits.sort(key=lambda fit: -expected[fit["method"]]["tilt_rms_deg"])
    places = np.arange(len(fits))
    tick: Any = {"markersize": 9.0, "markeredgewidth": 1.6}
    for panel, kind in zip(axes, ("level", "tilt"), strict=True):
        key = f"{kind}_rms_deg"
        claims = [fit["predicted_heading_rms_deg"] or np.nan for fit in fits]
        models = [expected[fit["method"]][key] for fit in fits]
        found = [fit["achieved"][key] for fit in fits]
        draw_measured(panel, claims, places, "its own claim", color=GREY, marker="|", **tick)
        draw_measured(
            panel, models, places, "expected of this unit", color=ORANGE, marker="D", markersize=5
        )
        draw_measured(panel, found, places, "achieved", color=BLUE, markersize=4)
        panel.set_xscale("log")
        panel.set_xlabel(f"heading error, RMS {'level' if kind == 'level' else 'tilted'} (deg)")
    axes[0].set_yticks(places, [method_words(fit["method"]) for fit in fits])
    figure_legend(figure, axes[0])
    return figure


def certificate_figure(record: Record) -> Figure:
    """Draw the verified errors with their uncertainty, level and tilted."""
    figure, axes = panels(1, 2, height_in=2.8)
    limits = {entry["name"]: entry for entry in record["measurements"]}
    headings = record["uncertainty"]["headings"]
    level = [row for row in headings if not _tilted(row)]
    tilted = [row for row in headings if _tilted(row)]
    for panel, rows, name in zip(axes, (level, tilted), ("level_max", "tilt_max"), strict=True):
        _intervals(panel, rows)
        limit = limits[name]
        printed_limit(panel, limit["high"], -limit["high"], label="limit")
        accepted_deg = limit["high"] - limit["guard_band"]
        for side in (accepted_deg, -accepted_deg):
            panel.axhline(side, color=GREEN, linewidth=0.8, zorder=2.0)
        panel.set_title("Level" if name == "level_max" else "Tilted, 20 to 30 deg")
        heading_axis(panel)
    error_axis(axes[0], "verified heading error (deg)")
    figure_legend(figure, axes[0])
    return figure


def _tilted(row: Mapping[str, float]) -> bool:
    return max(abs(row["pitch_deg"]), abs(row["roll_deg"])) > LEVEL_DEG


def _intervals(panel: Axes, rows: Sequence[Mapping[str, float]]) -> None:
    heading_deg = [row["azimuth_deg"] % 360.0 for row in rows]
    error_deg = np.array([row["error_deg"] for row in rows])
    for key, width, colour, label in (
        ("u_deg", 1.0, BLUE, "U of the unit's own error"),
        ("u_test_deg", 3.0, ORANGE, "U of the bench alone"),
    ):
        u_deg = np.array([row[key] for row in rows])
        panel.vlines(
            heading_deg, error_deg - u_deg, error_deg + u_deg, color=colour, lw=width, label=label
        )
    draw_measured(panel, heading_deg, error_deg, "verified", color="black", zorder=4)


def budget_figure(record: Record) -> Figure:
    """Draw the contributions to the uncertainty of a verified heading error."""
    rows = sorted(record["uncertainty"]["budget"], key=lambda row: -row["tilt_deg"])
    rows = rows[:MOST_CONTRIBUTIONS][::-1]
    figure, (panel,) = panels(1, 1, height_in=3.0)
    places = np.arange(len(rows))
    for shift, kind, colour in ((0.2, "level_deg", BLUE), (-0.2, "tilt_deg", RED)):
        label = "level" if kind == "level_deg" else "tilted"
        panel.barh(
            places + shift, [1000.0 * row[kind] for row in rows], 0.36, color=colour, label=label
        )
    names = [f"{row['name'].replace('_', ' ')} ({row['group']})" for row in rows]
    panel.set_yticks(places, names)
    panel.set_xlabel("standard contribution to the heading error, RMS over the poses (0.001 deg)")
    panel.legend(loc="lower right")
    return figure
