"""Sending blocks of samples to a recording, each on all three timelines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
import rerun as rr

from dashboards import entities

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dashboards.entities import Colour


class Times:
    """Index columns of one block: simulated time, tick and position."""

    def __init__(self, samples: NDArray[np.void], position: NDArray[np.int64]) -> None:
        self._t_ns = np.round(samples["t_s"] * 1e9).astype("timedelta64[ns]")
        self._tick = samples["tick"].astype(np.int64)
        self._position = position

    def columns(self, chosen: NDArray[np.bool_] | slice = slice(None)) -> list[rr.TimeColumn]:
        """Return the index columns of the chosen rows."""
        return [
            rr.TimeColumn(entities.SIM_TIME, duration=self._t_ns[chosen]),
            rr.TimeColumn(entities.TICK, sequence=self._tick[chosen]),
            rr.TimeColumn(entities.POSITION, sequence=self._position[chosen]),
        ]


def dwell_times(rows: NDArray[np.void], ticks: dict[int, int]) -> list[rr.TimeColumn]:
    """Return the index columns of readings, each at the last tick of its position.

    Parameters
    ----------
    rows : ndarray of READING, shape (n,)
    ticks : dict
        Last tick of each position.
    """
    t_ns = np.round(rows["t_s"] * 1e9).astype("timedelta64[ns]")
    return [
        rr.TimeColumn(entities.SIM_TIME, duration=t_ns),
        rr.TimeColumn(entities.TICK, sequence=[ticks[int(p)] for p in rows["position"]]),
        rr.TimeColumn(entities.POSITION, sequence=rows["position"].astype(np.int64)),
    ]


def send_scalars(
    recording: rr.RecordingStream,
    path: str,
    times: list[rr.TimeColumn],
    values: NDArray[np.float64],
) -> None:
    """Send one series (n,) or several in one entity (n, k)."""
    recording.send_columns(path, indexes=times, columns=rr.Scalars.columns(scalars=values))


def style_line(
    recording: rr.RecordingStream,
    path: str,
    name: str | list[str],
    colour: Colour | Sequence[Colour],
    width: float = 1.5,
) -> None:
    """Name and colour a series; peaks are never averaged away when zoomed out."""
    style = rr.SeriesLines(names=name, colors=colour, widths=width, aggregation_policy="off")
    recording.log(path, style, static=True)


def style_points(
    recording: rr.RecordingStream,
    path: str,
    name: str,
    colour: Colour | Sequence[Colour],
    size: float,
    marker: Literal["circle", "diamond"] = "circle",
) -> None:
    """Draw a series as points."""
    style = rr.SeriesPoints(names=name, colors=colour, markers=marker, marker_sizes=size)
    recording.log(path, style, static=True)
