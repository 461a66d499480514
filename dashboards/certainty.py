"""How sure each verified heading is: U around its error, between limit and acceptance limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from bench.record.certainty import verified_poses
from dashboards import entities
from dashboards.columns import dwell_times, send_scalars, style_line, style_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.record.certainty_charts import VerifiedPose
    from dashboards.entities import Colour
    from dashboards.run_view import RunView

KINDS = (("level", "level", entities.WHITE), ("tilted", "tilt", entities.BLUE))
"""Poses as the record's reader names them, as the entities do, and their colour."""


def log_band(
    recording: rr.RecordingStream,
    path: str,
    times: list[rr.TimeColumn],
    middle: NDArray[np.float64],
    half: NDArray[np.float64],
    *,
    name: str,
    colour: Colour,
    width: float = 0.5,
) -> None:
    """Log a shaded band middle +- half, both shape (n,); its middle is a thin line."""
    style = rr.Measurements.from_fields(names=[name], colors=[colour], widths=[width])
    recording.log(path, style, static=True)
    band = rr.Measurements.columns(values=middle, variances=np.square(half))
    recording.send_columns(path, indexes=times, columns=band)


def log_lines(
    recording: rr.RecordingStream,
    path: str,
    ends: list[rr.TimeColumn],
    half_deg: float,
    *,
    name: str,
) -> None:
    """Log two level lines at +-half_deg between two times."""
    style_line(recording, path, [name, name], [entities.GREEN, entities.GREEN], width=1.2)
    send_scalars(recording, path, ends, np.array([[half_deg, -half_deg]] * 2))


def log_certainty(
    recording: rr.RecordingStream, run: RunView, dwells: NDArray[np.void], ticks: dict[int, int]
) -> None:
    """Log error, U, U of the test and limits of the verified poses that the record tells.

    Parameters
    ----------
    dwells : ndarray of READING, shape (n,)
    ticks : dict
        Last tick of each position.
    """
    poses = verified_poses(run.record)
    for kind, entity, colour in KINDS:
        rows = dwells[np.isin(dwells["position"], [pose.position for pose in poses[kind]])]
        if not len(rows):
            continue
        by_position = {pose.position: pose for pose in poses[kind]}
        ordered = [by_position[int(position)] for position in rows["position"]]
        times = dwell_times(rows, ticks)
        _log_kind(recording, entity, ordered, times, colour)
        _log_limits(recording, run, entity, dwell_times(rows[[0, -1]], ticks))
    _log_around_errors(recording, [*poses["level"], *poses["tilted"]], dwells, ticks)


def _log_kind(
    recording: rr.RecordingStream,
    entity: str,
    poses: Sequence[VerifiedPose],
    times: list[rr.TimeColumn],
    colour: Colour,
) -> None:
    error_deg, u_deg, u_test_deg = (
        np.array([getattr(pose, name) for pose in poses])
        for name in ("error_deg", "u_deg", "u_test_deg")
    )
    path = f"{entities.CERTAINTY}/{entity}"
    log_band(recording, f"{path}/u", times, error_deg, u_deg, name="±U", colour=(*colour[:3], 150))
    log_band(
        recording, f"{path}/u_test", times, error_deg, u_test_deg, name="±U of the test",
        colour=entities.VIOLET,
    )  # fmt: skip
    style_points(recording, f"{path}/verified", f"verified, {entity}", colour, 4.0)
    send_scalars(recording, f"{path}/verified", times, error_deg)


def _log_around_errors(
    recording: rr.RecordingStream,
    poses: Sequence[VerifiedPose],
    dwells: NDArray[np.void],
    ticks: dict[int, int],
) -> None:
    """Log U around all verified errors, in the order in which they were measured."""
    by_position = {pose.position: pose for pose in poses}
    rows = dwells[np.isin(dwells["position"], list(by_position))]
    if not len(rows):
        return
    ordered = [by_position[int(position)] for position in rows["position"]]
    log_band(
        recording,
        f"{entities.ERROR}/u",
        dwell_times(rows, ticks),
        np.array([pose.error_deg for pose in ordered]),
        np.array([pose.u_deg for pose in ordered]),
        name="±U",
        colour=entities.WHITE,
    )


def _log_limits(
    recording: rr.RecordingStream, run: RunView, entity: str, ends: list[rr.TimeColumn]
) -> None:
    """Log limit and acceptance limit from the first to the last pose of a kind."""
    band = run.band(entity)
    if band is None:
        return
    limit_deg, accept_deg = band
    path = f"{entities.CERTAINTY}/{entity}"
    log_band(
        recording, f"{path}/limit", ends, np.zeros(2), np.full(2, limit_deg),
        name=f"limit ±{limit_deg:g}°", colour=entities.AMBER,
    )  # fmt: skip
    name = f"accepted to ±{accept_deg:.3g}°"
    log_lines(recording, f"{path}/accepted", ends, accept_deg, name=name)
