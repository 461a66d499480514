"""Figure of docs/accuracy/what-it-cannot-see.md: errors of the bench that a run on one seat hides.

`python benchmarks/accuracy_figures.py RUN` draws the figures of all three pages.

A perfect module on a rig with one thing wrong is calibrated by the truth-aided fit on the poses of
the end-of-line procedure, then verified over 120 attitudes as the bench does (seen) and against
the truth outside the fixture (true).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from verifications import poses_of

from bench.calibration.fit import CalibrationData
from bench.calibration.methods import fit_named
from bench.calibration.prediction import DEFAULT_FIELD_MG, grid_attitudes_deg
from bench.calibration.tilt import ned_from_body, tilt_compensated_heading_deg
from bench.reproduction.figures import BLUE, GREY, panels
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Wrong:
    """What is wrong with a bench; angles in degrees, iron in mG along forward of the seat.

    `azimuth_deg` is the station file's field azimuth less the true one; `cycles` and
    `encoder_deg` are order and amplitude of an error of the azimuth's encoder.
    """

    name: str
    seat_index_deg: float = 0.0
    iron_mg: float = 0.0
    azimuth_deg: float = 0.0
    cycles: int = 1
    encoder_deg: float = 0.0
    base_north_deg: float = 0.0


SOURCES: Final = (
    Wrong(name="seat turned by 0.1 deg", seat_index_deg=0.1),
    Wrong(name="iron of the fixture, 1 mG", iron_mg=1.0),
    Wrong(name="encoder, one cycle of 0.1 deg", encoder_deg=0.1),
    Wrong(name="encoder, two cycles of 0.1 deg", cycles=2, encoder_deg=0.1),
    Wrong(name="field azimuth in the file, 0.1 deg", azimuth_deg=0.1),
    Wrong(name="base out of level by 0.1 deg", base_north_deg=0.1),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hidden:
    """Largest heading error that the bench sees and that the unit has, and what the fit tells."""

    name: str
    seen_deg: float
    true_deg: float
    told_deg: float


def hidden_errors() -> list[Hidden]:
    """Return one row for each source; `told_deg` is the fitted field azimuth against the file."""
    return [_hidden(wrong) for wrong in SOURCES]


def _hidden(wrong: Wrong) -> Hidden:
    poses = [pose.attitude for pose in poses_of("eol_three_axis")]
    angles = np.array([(a.azimuth_deg, a.pitch_deg, a.roll_deg) for a in poses])
    fit = fit_named("truth_aided", _data(wrong, angles))
    grid = grid_attitudes_deg()
    seen = _data(wrong, grid)
    heading_deg = tilt_compensated_heading_deg(
        fit.corrected_mg(seen.field_mg), fit.corrected_g(seen.accel_g)
    )
    seen_deg = wrap_180_deg(heading_deg - (grid[:, 0] - wrong.azimuth_deg))
    body = np.swapaxes(ned_from_body(*grid.T), 1, 2)
    outside_deg = tilt_compensated_heading_deg(
        fit.corrected_mg(body @ DEFAULT_FIELD_MG), fit.corrected_g(-body[:, :, 2])
    )
    told_deg = fit.extra["field_azimuth_deg"] - wrong.azimuth_deg
    return Hidden(
        name=wrong.name,
        seen_deg=float(np.abs(seen_deg).max()),
        true_deg=float(np.abs(wrap_180_deg(outside_deg - grid[:, 0])).max()),
        told_deg=float(wrap_180_deg(told_deg)),
    )


def _data(wrong: Wrong, angles_deg: NDArray[np.float64]) -> CalibrationData:
    """Return a perfect module's readings at shown angles, shape (n, 3)."""
    turned_rad = np.deg2rad(wrong.cycles * angles_deg[:, 0])
    azimuth_deg = angles_deg[:, 0] - wrong.encoder_deg * np.sin(turned_rad)
    base = ned_from_body(np.zeros(1), np.zeros(1), np.array([wrong.base_north_deg]))[0]
    seat = ned_from_body(np.array([wrong.seat_index_deg]), np.zeros(1), np.zeros(1))[0]
    body = np.swapaxes(base @ ned_from_body(azimuth_deg, *angles_deg[:, 1:].T) @ seat, 1, 2)
    file_rad = np.deg2rad(wrong.azimuth_deg)
    north, _, down = DEFAULT_FIELD_MG
    return CalibrationData(
        field_mg=body @ DEFAULT_FIELD_MG + np.array([wrong.iron_mg, 0.0, 0.0]),
        accel_g=-body[:, :, 2],
        azimuth_deg=angles_deg[:, 0],
        pitch_deg=angles_deg[:, 1],
        roll_deg=angles_deg[:, 2],
        station_field_mg=np.array([north * np.cos(file_rad), north * np.sin(file_rad), down]),
    )


def unseen_figure() -> Figure:
    """Draw the error that the bench sees beside the one that the unit has."""
    figure, (panel,) = panels(1, 1, height_in=2.6)
    rows = hidden_errors()[::-1]
    places = np.arange(len(rows))
    panel.barh(places + 0.2, [row.seen_deg for row in rows], 0.36, color=BLUE, label="seen")
    panel.barh(places - 0.2, [row.true_deg for row in rows], 0.36, color=GREY, label="true")
    panel.set_yticks(places, [row.name for row in rows])
    panel.set_xlabel("largest heading error to 30 deg of tilt (deg)")
    panel.legend()
    return figure
