"""Static shapes of the field views: axes and rings, fitted ellipse, sphere, hard iron."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import rerun as rr

from dashboards import entities

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import Fit
    from dashboards.run_view import RunView

_CIRCLE_POINTS: Final = 121


def log_shapes(recording: rr.RecordingStream, run: RunView) -> None:
    """Log what the clouds of readings are compared with."""
    horizontal_mg = float(np.hypot(*run.field_ned_mg[:2])) or run.field_mg / 2.0
    vertical_mg = float(run.field_ned_mg[2])
    _log_plane(recording, run.field_mg, horizontal_mg)
    recording.log(f"{entities.SPACE}", rr.ViewCoordinates.RIGHT_HAND_Z_DOWN, static=True)
    recording.log(
        f"{entities.SPACE}/sphere",
        rr.Ellipsoids3D(
            half_sizes=[[run.field_mg] * 3],
            colors=[(*entities.GREEN, 60)],
            line_radii=rr.Radius.ui_points(0.6),
            fill_mode="majorwireframe",
        ),
        static=True,
    )
    if run.fit is not None:
        _log_fit(recording, run.fit, horizontal_mg, vertical_mg)


def _log_plane(recording: rr.RecordingStream, reach_mg: float, horizontal_mg: float) -> None:
    # 2-D views are y-down: a mirrored frame shows x to the right and y up.
    recording.log(entities.PLANE, rr.Transform3D(scale=[1.0, -1.0, 1.0]), static=True)
    cross = [[[-reach_mg, 0], [reach_mg, 0]], [[0, -reach_mg], [0, reach_mg]]]
    thin = rr.Radius.ui_points(0.5)
    recording.log(
        f"{entities.PLANE}/cross",
        rr.LineStrips2D(cross, colors=[entities.LINE], radii=thin, draw_order=-20.0),
        static=True,
    )
    recording.log(
        f"{entities.PLANE}/horizontal_field",
        rr.Ellipses2D(
            half_sizes=[[horizontal_mg, horizontal_mg]],
            centers=[[0, 0]],
            colors=[entities.LINE],
            line_radii=thin,
            labels=[f"{horizontal_mg:.0f} mG"],
            show_labels=True,
            draw_order=-30.0,
        ),
        static=True,
    )


def _log_fit(
    recording: rr.RecordingStream,
    fit: Fit,
    horizontal_mg: float,
    vertical_mg: float,
) -> None:
    angle_rad = np.linspace(0.0, 2.0 * np.pi, _CIRCLE_POINTS)
    level: NDArray[np.float64] = np.stack(
        [
            horizontal_mg * np.cos(angle_rad),
            -horizontal_mg * np.sin(angle_rad),
            np.full_like(angle_rad, vertical_mg),
        ],
        axis=1,
    )
    assert fit.matrix is not None and fit.offset_mg is not None  # noqa: S101, PT018
    raw = level @ np.linalg.inv(fit.matrix).T + fit.offset_mg
    for name, points, colour in (
        ("raw_fit", raw, (*entities.RED, 150)),
        ("compensated_fit", level, (*entities.GREEN, 190)),
    ):
        strip = rr.LineStrips2D(
            [points[:, :2]], colors=[colour], radii=rr.Radius.ui_points(1.0), show_labels=False
        )
        recording.log(f"{entities.PLANE}/{name}", strip, static=True)
    recording.log(
        f"{entities.SPACE}/hard_iron",
        rr.Arrows3D(
            vectors=[fit.offset_mg],
            colors=[entities.AMBER],
            radii=6.0,
            labels=["hard iron and offset"],
            show_labels=True,
        ),
        static=True,
    )
