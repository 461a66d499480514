"""Logging of what changes in a run: headings, errors, fields, the moving rig."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr

from dashboards import entities, scene
from dashboards.columns import Times, send_scalars, style_line, style_points
from protocols.angles import wrap_180_deg, wrap_360_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dashboards.run_view import Block, RunView

RIG_STEP: Final = 5
"""The 3-D rig moves at every fifth tick, the tracks have a point at every tenth."""
TRACK_STEP: Final = 10
LEVEL_DEG: Final = 1.0
"""Up to this tilt a pose counts as level."""
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
    _log_errors(recording, block, times)
    send_scalars(recording, f"{entities.FIELD}/raw", times.columns(), block.raw_mg)
    for name in ("azimuth", "pitch", "roll"):
        angle_deg = block.samples[f"rig_{name}_deg"]
        send_scalars(recording, f"{entities.RIG}/{name}_deg", times.columns(), angle_deg)
    _log_rig(recording, block, times)
    _log_tracks(recording, block, times)


def _log_headings(recording: rr.RecordingStream, block: Block, times: Times) -> None:
    series = [("reference", block.reference_deg), ("raw", block.raw_deg)]
    series.append(("module", block.samples["heading_deg"]))
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


def _log_rig(recording: rr.RecordingStream, block: Block, times: Times) -> None:
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
    arrows = [(entities.MODULE_FIELD, block.raw_mg)]
    if block.compensated_mg is not None:
        arrows.append((entities.MODULE_FIELD_CORRECTED, block.compensated_mg))
    for path, field_mg in arrows:
        vectors = field_mg[every] * scene.METRES_PER_MG
        recording.send_columns(path, indexes=columns, columns=rr.Arrows3D.columns(vectors=vectors))


def _log_tracks(recording: rr.RecordingStream, block: Block, times: Times) -> None:
    chosen = np.zeros(len(block.samples), dtype=bool)
    chosen[::TRACK_STEP] = True
    level = chosen & (np.abs(block.samples["rig_pitch_deg"]) < 1.0)
    level &= np.abs(block.samples["rig_roll_deg"]) < 1.0
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
    recording: rr.RecordingStream, samples: NDArray[np.void], limit_deg: float
) -> None:
    """Draw the limit as a shaded band over the whole run, from its first and last sample."""
    times = Times(samples, samples["position"].astype(np.int64)).columns()
    band = rr.Measurements.columns(values=[0.0, 0.0], variances=[limit_deg**2] * 2)
    path = f"{entities.ERROR}/limit"
    style = rr.Measurements.from_fields(
        names=[f"limit ±{limit_deg:g}°"], colors=[entities.AMBER], widths=[0.5]
    )
    recording.log(path, style, static=True)
    recording.send_columns(path, indexes=times, columns=band)


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
    reference_deg = wrap_360_deg(dwells["rig_azimuth_deg"] - run.field_azimuth_deg)
    error_deg = wrap_180_deg(dwells["heading_deg"] - reference_deg)
    verifying = verification_positions(run.record)
    tilted = np.hypot(dwells["rig_pitch_deg"], dwells["rig_roll_deg"]) > LEVEL_DEG
    judged = np.isin(dwells["position"], verifying)
    for kind, chosen, colour in (
        ("level", judged & ~tilted, entities.WHITE),
        ("tilt", judged & tilted, entities.BLUE),
    ):
        if not chosen.any():
            continue
        rows = dwells[chosen]
        columns = [
            rr.TimeColumn(
                entities.SIM_TIME, duration=np.round(rows["t_s"] * 1e9).astype("timedelta64[ns]")
            ),
            rr.TimeColumn(entities.TICK, sequence=[ticks[int(p)] for p in rows["position"]]),
            rr.TimeColumn(entities.POSITION, sequence=rows["position"].astype(np.int64)),
        ]
        path = f"{entities.ERROR}/verified_{kind}"
        style_points(recording, path, f"verified, {kind}", colour, 3.5)
        send_scalars(recording, path, columns, error_deg[chosen])
        limit_deg = run.high(f"{kind}_max", np.inf)
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


def verification_positions(record: dict[str, Any]) -> list[int]:
    """Return the positions that steps of kind ``verify`` visited in their last attempt."""
    names = {step["name"] for step in record.get("steps", []) if step.get("kind") == "verify"}
    poses = [pose for pose in record.get("poses", []) if pose["step"] in names]
    last = max((pose.get("attempt", 1) for pose in poses), default=1)
    return [int(pose["position"]) for pose in poses if pose.get("attempt", 1) == last]
