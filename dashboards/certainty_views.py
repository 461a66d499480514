"""The tab that shows how sure the verified headings are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import rerun as rr
import rerun.blueprint as rrb

from bench.record.certainty import has_certainty, verified_poses
from dashboards import entities
from dashboards.certainty import KINDS
from dashboards.views import whole_run

if TYPE_CHECKING:
    from bench.record.certainty_charts import VerifiedPose
    from dashboards.run_view import RunView


def certainty_tab(run: RunView) -> rrb.Horizontal | None:
    """Return budget and sentences beside errors with U between their limits; None without U."""
    if not has_certainty(run.record):
        return None
    poses = verified_poses(run.record)
    shown = [
        _error_view(run, kind, entity, poses[kind]) for kind, entity, _ in KINDS if poses[kind]
    ]
    return rrb.Horizontal(
        rrb.TextDocumentView(name="How sure", origin=f"/{entities.ACCEPTANCE}/certainty"),
        rrb.Vertical(*shown),
        column_shares=[4, 7],
        name="How sure",
    )


def _error_view(
    run: RunView, kind: str, entity: str, poses: list[VerifiedPose]
) -> rrb.TimeSeriesView:
    positions = [pose.position for pose in poses]
    largest_deg = max(abs(pose.error_deg) + pose.u_deg for pose in poses)
    span_deg = 1.15 * max(largest_deg, run.limit_deg(entity, 0.0))
    return rrb.TimeSeriesView(
        name=f"Verified heading error, {kind}: ±U, ±U of the test, limits (°)",
        origin=f"/{entities.CERTAINTY}/{entity}",
        axis_x=_interval(run, positions),
        axis_y=rrb.ScalarAxis(range=(-span_deg, span_deg)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )


def _interval(run: RunView, positions: list[int]) -> rrb.TimeAxis:
    """Return a time axis from the first to the last of these positions."""
    interval_s = run.interval_s(positions)
    if interval_s is None:
        return whole_run()
    start, end = (rrb.TimeRangeBoundary.absolute(seconds=value) for value in interval_s)
    return rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))
