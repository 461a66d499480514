"""The engineer's dashboard: where did it turn, what did it read, which limit was missed, why."""

from __future__ import annotations

from typing import TYPE_CHECKING

import rerun as rr
import rerun.blueprint as rrb

from dashboards import entities
from dashboards.certainty_views import certainty_tab
from dashboards.method_views import methods_tab, z_view
from dashboards.views import all_times, series, whole_run

if TYPE_CHECKING:
    from dashboards.run_view import RunView


def _rig_column() -> rrb.Vertical:
    return rrb.Vertical(
        rrb.Spatial3DView(
            name="Rig",
            origin=f"/{entities.WORLD}",
            background=list(entities.DARK),
            line_grid=rrb.LineGrid3D(
                visible=True,
                spacing=0.1,
                color=list(entities.LINE),
                plane=rr.components.Plane3D.XY.with_distance(-0.22),
            ),
            eye_controls=rrb.EyeControls3D(
                kind=rrb.Eye3DKind.Orbital,
                position=[0.75, -0.85, 0.5],
                look_target=[0.0, 0.0, -0.05],
                eye_up=[0, 0, 1],
            ),
        ),
        rrb.Tabs(
            rrb.TextDocumentView(name="Verdict", origin=f"/{entities.ACCEPTANCE}/verdict"),
            rrb.TextDocumentView(name="Methods", origin=f"/{entities.ACCEPTANCE}/methods"),
            rrb.TextDocumentView(name="Deviation", origin=f"/{entities.ACCEPTANCE}/deviation"),
            active_tab=0,
        ),
        row_shares=[5, 6],
    )


def _time_column(error_span_deg: float, raw_span_deg: float) -> rrb.Vertical:
    return rrb.Vertical(
        series("Heading (°)", entities.HEADING, 0.0, 360.0),
        series(
            "Heading error at settled poses (°)", entities.ERROR, -error_span_deg, error_span_deg
        ),
        series("Raw heading error (°)", entities.RAW_ERROR, -raw_span_deg, raw_span_deg),
        rrb.StateTimelineView(
            name="Procedure", origin=f"/{entities.PROCEDURE}/step", time_view=whole_run()
        ),
        rrb.Tabs(
            rrb.Horizontal(
                series("CAN frames/s", entities.CAN, 0.0, 1500.0, "rx_per_s", "tx_per_s"),
                series(
                    "Bus load (%) and lost frames", entities.CAN, 0.0, 40.0, "load_percent", "lost"
                ),
                name="CAN traffic",
            ),
            series("Rig (°)", entities.RIG, -360.0, 360.0),
            rrb.TextLogView(name="Log", origin=f"/{entities.PROCEDURE}/log"),
            active_tab=0,
        ),
        row_shares=[3, 3, 2.4, 1.2, 2],
    )


def _field_column(run: RunView) -> rrb.Vertical:
    flat = 1.1 * run.field_mg
    sphere = _sphere(2.0 * run.field_mg)
    two_axis = run.fit is not None and run.fit.two_axis
    return rrb.Vertical(
        rrb.Spatial2DView(
            name="X-Y before / after (mG)",
            origin=f"/{entities.FIELD}",
            contents=[f"+ /{entities.PLANE}/**"],
            background=list(entities.DARK),
            visual_bounds=rrb.VisualBounds2D(x_range=[-flat, flat], y_range=[-flat, flat]),
            time_ranges=all_times(),
        ),
        rrb.Tabs(z_view(run), sphere, active_tab=0) if two_axis else sphere,
        rrb.BarChartView(
            name="Error per verification position, level (°)",
            origin=f"/{entities.ACCEPTANCE}/level_error_deg",
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        rrb.BarChartView(
            name="Error per verification position, tilted (°)",
            origin=f"/{entities.ACCEPTANCE}/tilt_error_deg",
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        row_shares=[4, 4, 2, 2],
    )


def _sphere(reach: float) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        name="Ellipsoid to sphere (mG)",
        origin=f"/{entities.SPACE}",
        background=list(entities.DARK),
        line_grid=rrb.LineGrid3D(visible=False),
        time_ranges=all_times(),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=[0.9 * reach, -0.9 * reach, -0.2 * reach],
            look_target=[0.0, 0.0, 0.0],
            eye_up=[0, 0, -1],
        ),
    )


def blueprint(run: RunView) -> rrb.Blueprint:
    """Return the layout; only its axis ranges come from the run."""
    error_span_deg = 2.0 * max(run.limit_deg("level", 0.5), run.limit_deg("tilt", 0.5))
    measured = rrb.Horizontal(
        _rig_column(),
        _time_column(error_span_deg, run.raw_error_span_deg),
        _field_column(run),
        column_shares=[3, 4, 3],
        name="Run",
    )
    others = [tab for tab in (certainty_tab(run), methods_tab(run)) if tab is not None]
    return rrb.Blueprint(
        rrb.Tabs(measured, *others, active_tab=0) if others else measured,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=entities.SIM_TIME, play_state="following"),
        rrb.TopPanel(state="hidden"),
    )
