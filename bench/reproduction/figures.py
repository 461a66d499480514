"""How the figures of all papers look: thin axes, few colours, lines named where they end.

Everything here is called from the `draw` of a `PaperFigure`, which runs inside
`drawing_style`. matplotlib is imported only in there.
"""

from __future__ import annotations

import io
import os
import re
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from numpy.typing import ArrayLike

WIDTH_IN: Final = 6.5
# Colours that the colour-blind tell apart, after Okabe and Ito; the first is the product's.
BLUE: Final = "#0072B2"
RED: Final = "#D55E00"
GREEN: Final = "#009E73"
ORANGE: Final = "#E69F00"
PURPLE: Final = "#AA4499"
SKY: Final = "#56B4E9"
GREY: Final = "#767676"
INK: Final = "#222222"
COLOURS: Final = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY)
_STYLE: Final[Any] = {
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.constrained_layout.use": True,
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
    "font.size": 8.0,
    "text.color": INK,
    "axes.facecolor": "white",
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 8.0,
    "axes.titleweight": "bold",
    "axes.titlepad": 5.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.5,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.handlelength": 1.8,
    "path.simplify": True,
    "path.simplify_threshold": 0.1,
    "svg.fonttype": "path",
    "svg.hashsalt": "compass-bench",
}

_PATH: Final = re.compile(r'(?<= d=")[^"]*')
_NUMBER: Final = re.compile(r"-?\d+\.\d{3,}")


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw and save in the style of the page; the caller's settings come back at the end."""
    mpl = _matplotlib()
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def _matplotlib() -> ModuleType:
    """Import matplotlib, which refuses to be imported where MPLBACKEND names no backend."""
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        return import_module("matplotlib")
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend


def panels(
    rows: int = 1, columns: int = 1, *, height_in: float = 2.5, **options: Any
) -> tuple[Figure, list[Axes]]:
    """Return a figure of the page's width and its axes, row by row.

    Parameters
    ----------
    rows, columns : int
    height_in : float
        Height of the whole figure.
    **options
        Options of `Figure.subplots`: sharex, sharey, width_ratios, ...
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_IN, height_in))
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(axes.flat)


def svg_of(figure: Figure) -> bytes:
    """Return the SVG of a figure: the same figure gives the same bytes.

    Coordinates of paths are rounded to 0.01 pt, which halves the file.
    """
    target = io.BytesIO()
    figure.savefig(target, format="svg", metadata={"Date": None, "Creator": None})
    text = _PATH.sub(_rounded_path, target.getvalue().decode())
    return "".join(f"{line.rstrip()}\n" for line in text.splitlines()).encode()


def _rounded_path(path: re.Match[str]) -> str:
    return _NUMBER.sub(lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), path[0])


def heading_axis(axes: Axes, label: str = "heading (deg)", *, step_deg: int = 90) -> None:
    """Let x run once round the compass."""
    axes.set_xlim(0.0, 360.0)
    axes.set_xticks(range(0, 361, step_deg))
    axes.set_xlabel(label)


def error_axis(axes: Axes, label: str = "heading error (deg)") -> None:
    """Name y and mark its zero with a thin line."""
    axes.axhline(0.0, color=INK, linewidth=0.5, zorder=1.5)
    axes.set_ylabel(label)


def plane_axes(axes: Axes, x_label: str = "x (mG)", y_label: str = "y (mG)") -> None:
    """Show two components with equal scales and their zero lines."""
    axes.set_aspect("equal", adjustable="datalim")
    axes.axhline(0.0, color=INK, linewidth=0.4, zorder=1.5)
    axes.axvline(0.0, color=INK, linewidth=0.4, zorder=1.5)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)


def draw_ours(
    axes: Axes, x: ArrayLike, y: ArrayLike, label: str = "", *, color: str = BLUE, **options: Any
) -> Line2D:
    """Draw what the bench measured or the product computes: a solid line."""
    return axes.plot(x, y, color=color, label=label, **{"zorder": 3.0, **options})[0]


def draw_printed(
    axes: Axes, x: ArrayLike, y: ArrayLike, label: str = "", *, color: str = RED, **options: Any
) -> Line2D:
    """Draw what a formula gives as printed: a dashed line."""
    style = {"linestyle": (0, (4.0, 1.8)), "zorder": 2.8}
    return axes.plot(x, y, color=color, label=label, **{**style, **options})[0]


def draw_exact(axes: Axes, x: ArrayLike, y: ArrayLike, label: str = "", **options: Any) -> Line2D:
    """Draw the noiseless physics behind measurements: a thin grey line."""
    style = {"color": GREY, "linewidth": 0.8, "zorder": 2.5}
    return axes.plot(x, y, label=label, **{**style, **options})[0]


def draw_measured(
    axes: Axes, x: ArrayLike, y: ArrayLike, label: str = "", *, color: str = BLUE, **options: Any
) -> Line2D:
    """Draw single poses as dots."""
    style = {"marker": "o", "markersize": 2.6, "markeredgewidth": 0.0, "linestyle": "none"}
    return axes.plot(x, y, color=color, label=label, **{"zorder": 3.0, **style, **options})[0]


def draw_published(
    axes: Axes, x: ArrayLike, y: ArrayLike, label: str = "published", **options: Any
) -> Line2D:
    """Draw numbers that a paper prints: open black diamonds."""
    style = {"marker": "D", "markersize": 4.2, "markeredgewidth": 0.9, "linestyle": "none"}
    colours = {"markerfacecolor": "white", "markeredgecolor": INK, "zorder": 3.5}
    return axes.plot(x, y, label=label, **{**style, **colours, **options})[0]


def printed_limit(axes: Axes, *values: float, label: str = "") -> None:
    """Mark values of y, for instance the ends of a printed axis, by dotted lines."""
    for value in values:
        axes.axhline(value, color=GREY, linewidth=0.8, linestyle=(0, (1.0, 2.0)), zorder=2.0)
    if label:
        note(axes, 0.995, values[0], label, x_in_axes=True, ha="right", va="bottom", color=GREY)


def note(  # noqa: PLR0913 - a text has a place, a colour and its alignment
    axes: Axes,
    x: float,
    y: float,
    text: str,
    *,
    color: str = INK,
    ha: str = "left",
    va: str = "center",
    x_in_axes: bool = False,
) -> None:
    """Write a few words into the data, for instance a line's name at its end."""
    transform = axes.get_yaxis_transform() if x_in_axes else axes.transData
    axes.text(
        x,
        y,
        text,
        color=color,
        fontsize=7.5,
        horizontalalignment=ha,
        verticalalignment=va,
        transform=transform,
        zorder=4.0,
        in_layout=False,
    )


def legend_above(axes: Axes, *, columns: int = 4, **options: Any) -> None:
    """Put the legend above the data, in one line."""
    place = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
    axes.legend(ncols=columns, **{**place, **options})


def figure_legend(figure: Figure, *axes: Axes, columns: int = 5) -> None:
    """Put one legend of several panels above them all; a label that repeats stands once."""
    entries: dict[str, Any] = {}
    for part in axes:
        for handle, label in zip(*part.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(entries.values(), entries.keys(), loc="outside upper left", ncols=columns)
