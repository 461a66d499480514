"""Views that several tabs of the dashboard use."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from dashboards import entities


def whole_run() -> rrb.TimeAxis:
    """Return a time axis from the first to the last sample."""
    boundary = rrb.TimeRangeBoundary.infinite()
    return rrb.TimeAxis(view_range=rr.TimeRange(start=boundary, end=boundary))


def all_times() -> list[rrb.VisibleTimeRange]:
    """Return what makes a spatial view keep all points, on every timeline."""
    boundary = rrb.TimeRangeBoundary.infinite()
    return [rrb.VisibleTimeRange(name, start=boundary, end=boundary) for name in entities.TIMELINES]


def series(name: str, origin: str, low: float, high: float, *contents: str) -> rrb.TimeSeriesView:
    """Return a plot of all below an entity, or of some of its children, over the whole run."""
    return rrb.TimeSeriesView(
        name=name,
        origin=f"/{origin}",
        contents=[f"+ /{origin}/{content}" for content in contents] or "$origin/**",
        axis_x=whole_run(),
        axis_y=rrb.ScalarAxis(range=(low, high)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )
