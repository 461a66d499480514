"""Logging of what changes in a run: headings, errors, fields, the moving rig."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import rerun as rr

from bench.acceptance.site import is_level
from bench.record.recorded_fits import VERIFIED_KINDS, step_positions
from dashboards import entities, scene
from dashboards.certainty import log_band, log_lines
from dashboards.columns import Times, dwell_times, send_scalars, style_line, style_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dashboards.run_view import Block, RunView

RIG_STEP: Final = 5
"""The 3-D rig moves at every fifth tick, the tracks have a point at every tenth."""
TRACK_STEP: Final = 10
_AXES: Final = ["x", "y", "z"]
_RGB: Final = [entities.RED, entities.GREEN, entities.BLUE]


def log_styles(recording: rr.RecordingStream, *, calibrated: bool) -> None:
    """Name and colour every series, also the compensated ones where there is a calibration."""
    scene.log_arrow(recording, entities.MODULE_FIELD, entities.RED, "raw")
    if calibrated:
        scene.log_arrow(recording, entities.MODULE_FIELD_CORRECTED, entities.GREEN, "compensated")
    # Headings are points: a line would cross the whole plot wherever they wrap.
    for name, label, colour, size in (
        ("raw", "raw", entities.RED, 0.8),
        ("module", "module's own", entities.BLUE, 1.2),
        ("compensated", "compensated", entities.GREEN, 1.0),
        ("reference", "rig (magnetic)", entities.GREY, 0.5),
    ):
        style_points(recording, f"{entities.HEADING}/{name}", label, colour, size)
    faint = (*entities.GREEN, 40)
    style_points(recording, f"{entities.ERROR}/samples", "single samples", faint, 1.0)
    style_points(recording, f"{entities.RAW_ERROR}/raw", "raw", entities.RED, 1.5)
    style_points(recording, f"{entities.RAW_ERROR}/module", "module's own", entities.BLUE, 1.0)
    style_line(recording, f"{entities.FIELD}/raw", [f"raw {a}" for a in _AXES], _RGB)
    for name, colour in (
        ("azimuth", entities.AMBER),
        ("pitch", entities.BLUE),
        ("roll", entities.VIOLET),
    ):
        style_line(recording, f"{entities.RIG}/{name}_deg", f"{name} (°)", colour)
    radius = rr.Radius.ui_points(1.4)
    for name, colour in (("raw", entities.RED), ("compensated", entities.GREEN)):
        flat = rr.Points2D.from_fields(colors=[colour], radii=radius)
        recording.log(f"{entities.PLANE}/{name}", flat, static=True)
        solid = rr.Points3D.from_fields(colors=[colour], radii=radius)
        recording.log(f"{entities.SPACE}/{name}", solid, static=True)


def log_block(recording: rr.RecordingStream, block: Block, position: NDArray[np.int64]) -> None:
    """Log one block of samples; `position` has the last dwell's number while moving."""
    times = Times(block.samples, position)
    _log_headings(recording, block, times)
    send_scalars(recording, f"{entities.FIELD}/raw", times.columns(), block.raw_mg)
    if block.with_rig:
        _log_errors(recording, block, times)
        for name in ("azimuth", "pitch", "roll"):
            angle_deg = block.samples[f"rig_{name}_deg"]
            send_scalars(recording, f"{entities.RIG}/{name}_deg", times.columns(), angle_deg)
        _log_turns(recording, block, times)
    _log_arrows(recording, block, times)
    _log_tracks(recording, block, times)


def _log_headings(recording: rr.RecordingStream, block: Block, times: Times) -> None:
    series = [("reference", block.reference_deg)] if block.with_rig else []
    series += [("raw", block.raw_deg), ("module", block.samples["heading_deg"])]
    if block.compensated_deg is not None:
        series.append(("compensated", block.compensated_deg))
    for name, heading_deg in series:
        send_scalars(recording, f"{entities.HEADING}/{name}", times.columns(), heading_deg)


def _log_errors(recording: rr.RecordingStream, block: Block, times: Times) -> None:
    settled = block.settled
    if not settled.any():
        return
    columns = times.columns(settled)
    raw = block.error_deg(block.raw_deg)[settled]
    own = block.error_deg(block.samples["heading_deg"])[settled]
    send_scalars(recording, f"{entities.RAW_ERROR}/raw", columns, raw)
    send_scalars(recording, f"{entities.RAW_ERROR}/module", columns, own)
    if block.compensated_deg is not None:
        error = block.error_deg(block.compensated_deg)[settled]
        send_scalars(recording, f"{entities.ERROR}/samples", columns, error)


def _log_turns(recording: rr.RecordingStream, block: Block, times: Times) -> None:
    every = slice(None, None, RIG_STEP)
    columns = times.columns(every)
    samples = block.samples[every]
    for path, axis, name in (
        (entities.TABLE, [0.0, 0.0, 1.0], "azimuth"),
        (entities.PITCH_FRAME, [0.0, 1.0, 0.0], "pitch"),
        (entities.ROLL_FRAME, [1.0, 0.0, 0.0], "roll"),
    ):
        half_rad = np.deg2rad(samples[f"rig_{name}_deg"])[:, None] / 2.0
        quaternion = np.hstack([np.sin(half_rad) * np.array(axis), np.cos(half_rad)])
        recording.send_columns(
            path, indexes=columns, columns=rr.Transform3D.columns(quaternion=quaternion)
        )


def _log_arrows(recording: rr.RecordingStream, block: Block, times: Times) -> None:
    every = slice(None, None, RIG_STEP)
    columns = times.columns(every)
    arrows = [(entities.MODULE_FIELD, block.raw_mg)]
    if block.compensated_mg is not None:
        arrows.append((entities.MODULE_FIELD_CORRECTED, block.compensated_mg))
    for path, field_mg in arrows:
        vectors = field_mg[every] * scene.METRES_PER_MG
        recording.send_columns(path, indexes=columns, columns=rr.Arrows3D.columns(vectors=vectors))


def _log_tracks(recording: rr.RecordingStream, block: Block, times: Times) -> None:
    chosen = np.zeros(len(block.samples), dtype=bool)
    chosen[::TRACK_STEP] = True
    level = chosen & is_level(block.samples)
    clouds = [("raw", block.raw_mg)]
    if block.compensated_mg is not None:
        clouds.append(("compensated", block.compensated_mg))
    for name, field_mg in clouds:
        if level.any():
            recording.send_columns(
                f"{entities.PLANE}/{name}",
                indexes=times.columns(level),
                columns=rr.Points2D.columns(positions=field_mg[level][:, :2]),
            )
        recording.send_columns(
            f"{entities.SPACE}/{name}",
            indexes=times.columns(chosen),
            columns=rr.Points3D.columns(positions=field_mg[chosen]),
        )


def log_limit_band(
    recording: rr.RecordingStream,
    samples: NDArray[np.void],
    limit_deg: float,
    accept_deg: float,
) -> None:
    """Draw the limit as a band and the acceptance limit as lines, from first to last sample.

    Between the two lies the guard band.
    """
    times = Times(samples, samples["position"].astype(np.int64)).columns()
    log_band(
        recording, f"{entities.ERROR}/limit", times, np.zeros(2), np.full(2, limit_deg),
        name=f"limit ±{limit_deg:g}°", colour=entities.AMBER,
    )  # fmt: skip
    if accept_deg < limit_deg:
        name = f"accepted to ±{accept_deg:.3g}°"
        log_lines(recording, f"{entities.ERROR}/accepted", times, accept_deg, name=name)


def log_dwell_errors(
    recording: rr.RecordingStream, run: RunView, dwells: NDArray[np.void], ticks: dict[int, int]
) -> None:
    """Log the error of each dwell's mean heading: what is judged.

    Parameters
    ----------
    dwells : ndarray of READING, shape (n,)
    ticks : dict
        Last tick of each position.
    """
    error_deg = run.heading_errors_deg(_judged_heading_deg(run, dwells), dwells)
    level = is_level(dwells)
    judged = np.isin(dwells["position"], step_positions(run.record, VERIFIED_KINDS))
    for kind, chosen, colour in (
        ("level", judged & level, entities.WHITE),
        ("tilt", judged & ~level, entities.BLUE),
    ):
        if not chosen.any():
            continue
        rows = dwells[chosen]
        columns = dwell_times(rows, ticks)
        path = f"{entities.ERROR}/verified_{kind}"
        style_points(recording, path, f"verified, {kind}", colour, 3.5)
        send_scalars(recording, path, columns, error_deg[chosen])
        limit_deg = run.limit_deg(kind, np.inf)
        bar_colour = (
            entities.GREEN if np.abs(error_deg[chosen]).max() <= limit_deg else entities.RED
        )
        recording.log(
            f"{entities.ACCEPTANCE}/{kind}_error_deg",
            rr.BarChart(
                error_deg[chosen], abscissa=rows["position"].astype(np.int64), color=bar_colour
            ),
            static=True,
        )


def _judged_heading_deg(run: RunView, dwells: NDArray[np.void]) -> NDArray[np.float64]:
    """Return the module's own heading, and where a step compared without a write the fit's."""
    heading_deg = np.array(dwells["heading_deg"], dtype=float)
    compared = np.isin(dwells["position"], step_positions(run.record, ("compare",)))
    if run.fit is not None and compared.any():
        rows = dwells[compared]
        heading_deg[compared] = run.fits.heading_deg(run.fit.method, rows["field_mg"], rows)
    return heading_deg
