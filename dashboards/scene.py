"""The rig in 3-D: base, turntable with its scale, pitch yoke, roll plate, module and field.

Geometry is in metres, in NED for the base and in the body's forward, right, down for all
that turns; one transform at the top stands NED upright for the viewer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import rerun as rr

from dashboards import entities

if TYPE_CHECKING:
    from numpy.typing import NDArray

METRES_PER_MG: Final = 0.0006
_ENU_FROM_NED: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_MODULE_ORIGIN: Final = (0.0, 0.0, -0.03)


def log_scene(recording: rr.RecordingStream, field_ned_mg: NDArray[np.float64]) -> None:
    """Log everything of the rig that does not change in a run.

    Parameters
    ----------
    field_ned_mg : ndarray, shape (3,)
        The station's field; north is the rig's zero.
    """
    recording.log(entities.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log(entities.NED, rr.Transform3D(mat3x3=_ENU_FROM_NED), static=True)
    _log_base(recording)
    _log_seat(recording)
    _log_field(recording, field_ned_mg)


def _log_base(recording: rr.RecordingStream) -> None:
    recording.log(
        f"{entities.BASE}/foot",
        rr.Cylinders3D(
            lengths=[0.06],
            radii=[0.36],
            centers=[[0, 0, 0.18]],
            colors=[(60, 66, 76)],
            fill_mode="solid",
        ),
        static=True,
    )
    recording.log(
        f"{entities.TABLE}/plate",
        rr.Cylinders3D(
            lengths=[0.03],
            radii=[0.32],
            centers=[[0, 0, 0.135]],
            colors=[(112, 120, 132)],
            fill_mode="solid",
        ),
        static=True,
    )
    angle_rad = np.deg2rad(np.arange(0, 360, 15))
    ring = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=1)
    ticks = [[[*(0.28 * p), 0.118], [*(0.315 * p), 0.118]] for p in ring]
    colours = [entities.AMBER if i == 0 else (220, 220, 220) for i in range(len(ticks))]
    recording.log(
        f"{entities.TABLE}/scale", rr.LineStrips3D(ticks, colors=colours, radii=0.004), static=True
    )
    recording.log(
        f"{entities.TABLE}/posts",
        rr.Boxes3D(
            centers=[[0, -0.23, 0.05], [0, 0.23, 0.05]],
            half_sizes=[[0.03, 0.012, 0.07]] * 2,
            colors=[(96, 104, 116)],
            fill_mode="solid",
        ),
        static=True,
    )


def _log_seat(recording: rr.RecordingStream) -> None:
    frame = [[0.2, 0.215, 0.0], [0.2, -0.215, 0.0], [-0.2, -0.215, 0.0], [-0.2, 0.215, 0.0]]
    recording.log(
        f"{entities.PITCH_FRAME}/yoke",
        rr.LineStrips3D([[*frame, frame[0]]], colors=[(150, 158, 170)], radii=0.009),
        static=True,
    )
    recording.log(
        f"{entities.ROLL_FRAME}/plate",
        rr.Boxes3D(half_sizes=[[0.185, 0.11, 0.006]], colors=[(24, 110, 70)], fill_mode="solid"),
        static=True,
    )
    recording.log(
        f"{entities.MODULE}/case",
        rr.Boxes3D(
            centers=[[0, 0, -0.018]],
            half_sizes=[[0.045, 0.032, 0.011]],
            colors=[(28, 30, 36)],
            fill_mode="solid",
            labels=["module"],
            show_labels=True,
        ),
        static=True,
    )
    recording.log(
        f"{entities.MODULE}/axes",
        rr.Transform3D(translation=_MODULE_ORIGIN),
        rr.TransformAxes3D(0.12),
        static=True,
    )


def log_arrow(
    recording: rr.RecordingStream, path: str, colour: entities.Colour, label: str
) -> None:
    """Style an arrow that starts at the module; its vectors come with the samples."""
    style = rr.Arrows3D.from_fields(
        origins=[_MODULE_ORIGIN], colors=[colour], radii=[0.005], labels=[label]
    )
    recording.log(path, style, static=True)


def _log_field(recording: rr.RecordingStream, field_ned_mg: NDArray[np.float64]) -> None:
    vector = field_ned_mg * METRES_PER_MG
    recording.log(
        f"{entities.SITE_FIELD}/site",
        rr.Arrows3D(
            vectors=[vector],
            origins=[np.array(_MODULE_ORIGIN) - vector],
            colors=[entities.AMBER],
            radii=0.007,
            labels=["site field"],
            show_labels=True,
        ),
        static=True,
    )
    recording.log(
        f"{entities.SITE_FIELD}/north",
        rr.Arrows3D(
            vectors=[[0.2, 0, 0]],
            origins=[[0.38, 0, 0.15]],
            colors=[entities.GREY],
            radii=0.006,
            labels=["N"],
            show_labels=True,
        ),
        static=True,
    )
