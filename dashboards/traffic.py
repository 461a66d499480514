"""CAN traffic and bus load of a run, second by second."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import rerun as rr

from dashboards import entities
from dashboards.columns import send_scalars, style_line

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SERIES = (
    ("rx_per_s", "received", entities.BLUE),
    ("tx_per_s", "sent", entities.AMBER),
    ("load_percent", "bus load (%)", entities.GREEN),
    ("lost", "lost frames", entities.RED),
)


def log_traffic(
    recording: rr.RecordingStream, record: dict[str, Any], ends: NDArray[np.void]
) -> None:
    """Log the record's ``bus.traffic``: lists of equal length by name, one entry a second."""
    traffic = (record.get("bus") or {}).get("traffic") or {}
    seconds = np.asarray(traffic.get("t_s", []), dtype=float)
    if len(seconds) == 0:
        return
    last_tick = int(ends["tick"][-1])
    ticks = np.minimum(np.round(seconds * 100.0).astype(np.int64), last_tick)
    times = [
        rr.TimeColumn(
            entities.SIM_TIME, duration=np.round(seconds * 1e9).astype("timedelta64[ns]")
        ),
        rr.TimeColumn(entities.TICK, sequence=ticks),
    ]
    for name, label, colour in _SERIES:
        if name in traffic:
            style_line(recording, f"{entities.CAN}/{name}", label, colour)
            values = np.asarray(traffic[name], dtype=float)
            send_scalars(recording, f"{entities.CAN}/{name}", times, values)
