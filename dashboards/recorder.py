"""Makes run.rrd of a run's folder, with the dashboard embedded.

The recording is made after measuring, from what the run has written: a dashboard costs no
tick, and the same folder gives the same picture. It reads the samples block by block.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr

from bench.samples import MOVING, READING, readings_of
from dashboards import entities
from dashboards.blueprint import blueprint
from dashboards.certainty import log_certainty
from dashboards.ground import log_shapes
from dashboards.methods import log_methods, log_z_estimate
from dashboards.run_view import RunView
from dashboards.scene import log_scene
from dashboards.signals import (
    log_block,
    log_dwell_errors,
    log_limit_band,
    log_styles,
)
from dashboards.traffic import log_traffic
from dashboards.verdict_text import (
    certainty_markdown,
    deviation_markdown,
    methods_markdown,
    verdict_markdown,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


_BAD: Final = frozenset({"FAIL", "ERROR", "ABORTED"})
_UNTOLD: Final = frozenset({"event", "seq", "t_s", "wall_utc", "covariance"})
DEFAULT_LIMIT_DEG: Final = 0.5
"""Band drawn where the run was held against no limit of the heading."""
_PROPERTIES: Final = ("level_max", "tilt_max", "repeatability")


def write_recording(path: Path, record: dict[str, Any] | None = None) -> None:
    """Write the recording of the run in whose folder `path` lies.

    Parameters
    ----------
    path : Path
        The file to write, beside samples.parquet; it is written under another name and
        renamed when it has its footer.
    record : dict, optional
        The run's document; read from record.json if not given.
    """
    run = RunView(path.parent, record)
    record = run.record
    identity = record.get("run", {})
    partial = path.with_name(path.name + ".part")
    recording = rr.RecordingStream(
        entities.APPLICATION_ID, recording_id=str(identity.get("id", path.parent.name))
    )
    recording.set_log_time_enabled(enabled=False)
    recording.save(partial, default_blueprint=blueprint(run))
    try:
        recording.send_recording_name(
            f"{identity.get('serial', '?')} {identity.get('procedure', '')}"
        )
        _log_run(recording, run)
        _log_properties(recording, record)
    finally:
        recording.flush()
        recording.disconnect()
    partial.replace(path)


def _log_run(recording: rr.RecordingStream, run: RunView) -> None:
    log_scene(recording, run.field_ned_mg)
    log_styles(recording, calibrated=run.fit is not None)
    log_shapes(recording, run)
    tracker = _DwellTracker()
    for block in run.blocks():
        log_block(recording, block, tracker.positions(block.samples))
    ends = tracker.ends()
    if ends is not None:
        band = run.band("level") or run.band("tilt") or (DEFAULT_LIMIT_DEG, DEFAULT_LIMIT_DEG)
        log_limit_band(recording, ends, *band)
        dwells = tracker.dwells()
        log_dwell_errors(recording, run, dwells, tracker.ticks)
        log_methods(recording, run, dwells, tracker.ticks)
        log_z_estimate(recording, run, dwells, tracker.ticks)
        log_certainty(recording, run, dwells, tracker.ticks)
        _log_procedure(recording, run)
        log_traffic(recording, run.record, ends)
    _log_texts(recording, run.record)


class _DwellTracker:
    """Follows the position through the blocks and keeps one reading a dwell."""

    def __init__(self) -> None:
        self.ticks: dict[int, int] = {}
        self._last = 0
        self._open: list[NDArray[np.void]] = []
        self._dwells: list[NDArray[np.void]] = []
        self._first: NDArray[np.void] | None = None
        self._end: NDArray[np.void] | None = None

    def positions(self, samples: NDArray[np.void]) -> NDArray[np.int64]:
        """Return the position of each sample, that of the last dwell while moving."""
        index = np.where(samples["position"] != MOVING, np.arange(len(samples)), -1)
        last = np.maximum.accumulate(index)
        position = samples["position"][np.maximum(last, 0)].astype(np.int64)
        position[last < 0] = self._last
        self._last = int(position[-1])
        self._collect(samples[samples["position"] != MOVING])
        self._first = samples[:1] if self._first is None else self._first
        self._end = samples[-1:]
        return position

    def _collect(self, settled: NDArray[np.void]) -> None:
        for position, tick in zip(settled["position"], settled["tick"], strict=True):
            self.ticks[int(position)] = int(tick)
        pending = np.concatenate([*self._open, settled]) if self._open else settled
        if len(pending) == 0:
            return
        newest = pending["position"] == pending["position"][-1]
        self._dwells.append(readings_of(pending[~newest]))
        self._open = [pending[newest]]

    def dwells(self) -> NDArray[np.void]:
        """Return all readings of the run, shape (n,)."""
        parts = [*self._dwells, *(readings_of(rows) for rows in self._open)]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=READING)

    def ends(self) -> NDArray[np.void] | None:
        """Return the first and the last sample, shape (2,)."""
        if self._first is None or self._end is None:
            return None
        return np.concatenate([self._first, self._end])


def _log_procedure(recording: rr.RecordingStream, run: RunView) -> None:
    steps = run.record.get("steps", [])
    names = list(dict.fromkeys(str(step["name"]) for step in steps))
    if not names:
        return
    colours = [entities.STEP_COLOURS[i % len(entities.STEP_COLOURS)] for i in range(len(names))]
    configuration = rr.StateConfiguration(
        values=names,
        labels=[name.replace("_", " ") for name in names],
        colors=np.array(colours, dtype=np.uint32),
    )
    path = f"{entities.PROCEDURE}/step"
    recording.log(path, configuration, static=True)
    recording.send_columns(
        path,
        indexes=_times([float(step.get("started_s") or 0.0) for step in steps]),
        columns=rr.StateChange.columns(state=[str(step["name"]) for step in steps]),
    )
    _log_events(recording, run.folder / "events.ndjson")


def _log_events(recording: rr.RecordingStream, path: Path) -> None:
    if not path.exists():
        return
    lines = path.read_text("utf-8").splitlines()
    events: list[dict[str, Any]] = [json.loads(line) for line in lines]
    if not events:
        return
    recording.send_columns(
        f"{entities.PROCEDURE}/log",
        indexes=_times([float(event.get("t_s") or 0.0) for event in events]),
        columns=rr.TextLog.columns(
            text=[_sentence(event) for event in events],
            level=["ERROR" if event.get("outcome") in _BAD else "INFO" for event in events],
        ),
    )


def _sentence(event: dict[str, Any]) -> str:
    details = ", ".join(
        f"{key} {_plain(value)}" for key, value in event.items() if key not in _UNTOLD
    )
    return f"{event.get('event')}: {details}"


def _plain(value: object) -> str:
    """Return text in glyphs that every viewer can draw."""
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return text.encode("latin-1", "replace").decode("latin-1")[:200]


def _times(seconds: list[float]) -> list[rr.TimeColumn]:
    return [
        rr.TimeColumn(entities.SIM_TIME, duration=seconds),
        rr.TimeColumn(entities.TICK, sequence=[round(t_s * 100.0) for t_s in seconds]),
    ]


def _log_texts(recording: rr.RecordingStream, record: dict[str, Any]) -> None:
    for name, text in (
        ("verdict", verdict_markdown(record)),
        ("methods", methods_markdown(record)),
        ("certainty", certainty_markdown(record)),
        ("deviation", deviation_markdown(record)),
    ):
        document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        recording.log(f"{entities.ACCEPTANCE}/{name}", document, static=True)


def _log_properties(recording: rr.RecordingStream, record: dict[str, Any]) -> None:
    identity, module = record.get("run", {}), record.get("module") or {}
    recording.send_property(
        "module",
        rr.AnyValues(
            serial=str(identity.get("serial", "")),
            firmware=str(module.get("firmware", "")),
            procedure=str(identity.get("procedure", "")),
        ),
    )
    outcome = str((record.get("verdict") or {}).get("outcome", "ERROR"))
    values = {
        m["name"]: float(m["value"])
        for m in record.get("measurements", [])
        if m["value"] is not None
    }
    chosen: dict[str, Any] = {name: values[name] for name in _PROPERTIES if name in values}
    recording.send_property("acceptance", rr.AnyValues(outcome=outcome, **chosen))
