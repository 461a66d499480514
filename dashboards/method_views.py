"""The tab that compares the methods, and the view of z where two axes estimate it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
import rerun.blueprint as rrb

from bench.calibration.ranking import RAW
from bench.record.method_study import method_rows
from dashboards import entities
from dashboards.views import series, whole_run

if TYPE_CHECKING:
    from bench.record.method_study import MethodRow
    from dashboards.run_view import RunView

_COLUMNS: Final = 3
_Z_SPAN_MG: Final = 20.0


def methods_tab(run: RunView) -> rrb.Horizontal | None:
    """Return table, headings, and the error of each method, each on its own scale."""
    rows = [row for row in method_rows(run.record) if not row.cause]
    compared = [row for row in rows if _largest_deg(row) is not None]
    if not run.fits.by_method or not compared:
        return None
    return rrb.Horizontal(
        rrb.TextDocumentView(name="Methods table", origin=f"/{entities.ACCEPTANCE}/methods"),
        rrb.Vertical(
            series(
                "Heading by every method (°)",
                entities.METHODS,
                0.0,
                360.0,
                *(f"{method}/heading_deg" for method in (RAW, *run.fits.by_method)),
            ),
            rrb.Grid(*(_error_view(row) for row in compared), grid_columns=_COLUMNS),
            row_shares=[2, 7],
        ),
        column_shares=[5, 8],
        name="Methods",
    )


def _error_view(row: MethodRow) -> rrb.TimeSeriesView:
    """Return the error of a method on the verification poses, over what was expected there."""
    span_deg = _span_deg(_largest_deg(row) or 0.0)
    return rrb.TimeSeriesView(
        name=f"{row.name}: error within ±{span_deg:g}°",
        origin=f"/{entities.METHODS}/{row.key}",
        contents=[f"+ /{entities.METHODS}/{row.key}/error_deg/**"],
        axis_x=whole_run(),
        axis_y=rrb.ScalarAxis(range=(-span_deg, span_deg)),
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _largest_deg(row: MethodRow) -> float | None:
    largest = [value for value in (row.level_max_deg, row.tilt_max_deg) if value is not None]
    return max(largest, default=None)


def _span_deg(largest_deg: float) -> float:
    """Return the half-range of an axis, 1, 2 or 5 times a power of ten, that holds an error.

    >>> _span_deg(0.27), _span_deg(9.8)
    (0.5, 20.0)
    """
    wanted = max(1.05 * largest_deg, 0.1)
    power = 10.0 ** math.floor(math.log10(wanted))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= wanted)


def z_view(run: RunView) -> rrb.Vertical:
    """Return estimated beside measured z, and their difference."""
    horizontal_mg = float(np.hypot(*run.field_ned_mg[:2])) or run.field_mg / 2.0
    vertical_mg = float(run.field_ned_mg[2])
    return rrb.Vertical(
        _z_plot(
            "z estimated and measured (mG)",
            vertical_mg - horizontal_mg,
            vertical_mg + horizontal_mg,
            entities.Z_ESTIMATED,
            entities.Z_MEASURED,
        ),
        _z_plot("z estimated less measured (mG)", -_Z_SPAN_MG, _Z_SPAN_MG, entities.Z_DIFFERENCE),
        row_shares=[3, 2],
        name="z by two axes",
    )


def _z_plot(name: str, low: float, high: float, *paths: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        name=name,
        origin="/field",
        contents=[f"+ /{path}" for path in paths],
        axis_x=whole_run(),
        axis_y=rrb.ScalarAxis(range=(low, high)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )
