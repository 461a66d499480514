"""Figures of docs/accuracy/before-the-run.md: the bound, and what the choice of poses does to it.

`python benchmarks/accuracy_figures.py RUN` draws the figures of all three pages.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from estimators import (
    ESTIMATORS,
    STRENGTH_MG,
    conditions_of,
    drawn_unit,
    errors_of,
    read,
    spread_attitudes_deg,
)
from poses import rings
from verifications import poses_of

from bench.calibration.bound import grid_rows, heading_bound
from bench.calibration.pose_plan import ESTIMATOR, SMALLEST, bench_conditions, optimal_poses
from bench.calibration.prediction import COVERAGE_FACTOR, grid_attitudes_deg
from bench.reproduction.figures import (
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    ORANGE,
    RED,
    draw_measured,
    draw_ours,
    figure_legend,
    heading_axis,
    note,
    panels,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from estimators import Unit
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.calibration.bound import Estimator
    from bench.steps.step import PlannedPose

COUNTS: Final = (12, 16, 20, 24, 30, 36)
NOISE: Final = 0.001
TRIALS: Final = 1000
TILTS_DEG: Final = (45.0, 20.0)
TILT_LIMIT_DEG: Final = 30.0
PLANNED: Final = (8, 9, 10, 12, 16, 20, 24, 30, 36)
LEAST_REFUSED: Final = 0.01
"""Share of refused trials above which a dot is left out: the poses do not suffice there."""


def bound_figure() -> Figure:
    """Draw the bound of the three estimators by the number of poses, with what trials achieve."""
    figure, axes = panels(1, 2, height_in=2.7, sharey=True)
    unit = drawn_unit(np.random.default_rng(1))
    conditions = conditions_of(unit, NOISE * STRENGTH_MG)
    for panel, tilt_deg in zip(axes, TILTS_DEG, strict=True):
        for estimator, colour in zip(ESTIMATORS, COLOURS, strict=False):
            poses = [spread_attitudes_deg(count, tilt_deg) for count in COUNTS]
            bounds = [float(heading_bound(estimator, one, conditions).rms_deg) for one in poses]
            achieved = [_achieved_deg(unit, estimator, one, seed) for seed, one in enumerate(poses)]
            name = estimator.replace("_", " ")
            draw_ours(panel, COUNTS, bounds, f"{name}: bound", color=colour)
            draw_measured(
                panel, COUNTS, achieved, f"{name}: achieved", color=colour, markersize=4.5
            )
        panel.set_yscale("log")
        panel.set_title(f"Tilt to {tilt_deg:.0f} deg, noise 0.1 % of the field")
        panel.set_yticks((0.1, 0.2, 0.5, 1.0, 2.0, 5.0), ("0.1", "0.2", "0.5", "1", "2", "5"))
        panel.minorticks_off()
        panel.set_xlabel("poses")
    note(axes[1], 12.0, 1.6, "ellipsoid: refused in most trials", color=BLUE)
    axes[0].set_ylabel("heading error, RMS (deg)")
    figure_legend(figure, axes[0], columns=3)
    return figure


def _achieved_deg(
    unit: Unit, estimator: Estimator, attitudes_deg: NDArray[np.float64], seed: int
) -> float:
    sd_mg = NOISE * STRENGTH_MG
    readings = read(unit, attitudes_deg, sd_mg, TRIALS, 100 + seed)
    errors = errors_of(estimator, unit, readings, sd_mg)
    if errors.refused > LEAST_REFUSED:
        return np.nan
    return float(np.sqrt((errors.heading_deg**2).mean()))


def poses_figure() -> Figure:
    """Draw the predicted largest error by the number of poses, and quick's own over the heading."""
    figure, (left, right) = panels(1, 2, height_in=2.7)
    conditions = bench_conditions()
    plans = [optimal_poses(count, TILT_LIMIT_DEG, conditions) for count in PLANNED]
    draw_ours(left, PLANNED, [plan.predicted_max_deg for plan in plans], "planned", marker="o")
    for name, colour, sets in (
        ("rings: a third level", RED, [rings(n, n // 2) for n in (4, 6, 8, 12)]),
        ("caruso_24", GREEN, [poses_of("caruso_24")]),
        ("quick", ORANGE, [poses_of("quick")]),
    ):
        counts = [len(one) for one in sets]
        largest = [_largest_deg(one) for one in sets]
        draw_measured(left, counts, largest, name, color=colour, markersize=5.0)
    left.set_xlim(SMALLEST - 1, None)
    left.set_ylim(0.0, None)
    left.set_xlabel("poses, tilted to 30 deg")
    left.set_ylabel("predicted largest error, 2 sd (deg)")
    left.set_title("Fewer, better poses")
    left.legend()
    _over_heading(right)
    return figure


def _over_heading(panel: Axes) -> None:
    """Draw the predicted error of quick's poses over the heading, level and tilted."""
    found = heading_bound(ESTIMATOR, _attitudes(poses_of("quick")), bench_conditions())
    rows = grid_rows(ESTIMATOR, bench_conditions())
    sd_deg = np.sqrt(np.einsum("kp,pq,kq->k", rows, found.covariance, rows))
    grid_deg = grid_attitudes_deg()
    tilts = {"level": (0.0, 0.0), "pitch +30": (30.0, 0.0), "pitch -30": (-30.0, 0.0)}
    tilts |= {"roll +30": (0.0, 30.0), "roll -30": (0.0, -30.0)}
    for (name, tilt), colour in zip(tilts.items(), (BLUE, RED, ORANGE, GREEN, GREY), strict=True):
        at = (grid_deg[:, 1:] == tilt).all(axis=1)
        order = np.argsort(grid_deg[at, 0])
        predicted_deg = COVERAGE_FACTOR * sd_deg[at][order]
        heading_deg = np.append(grid_deg[at, 0][order], 360.0)
        draw_ours(
            panel, heading_deg, np.append(predicted_deg, predicted_deg[0]), name, color=colour
        )
    heading_axis(panel)
    panel.set_ylim(0.0, None)
    panel.set_ylabel("predicted error, 2 sd (deg)")
    panel.set_title("quick, before the run")
    panel.legend(ncols=2)


def _largest_deg(poses: Sequence[PlannedPose]) -> float:
    bound = heading_bound(ESTIMATOR, _attitudes(poses), bench_conditions())
    return COVERAGE_FACTOR * float(bound.worst_deg)


def _attitudes(poses: Sequence[PlannedPose]) -> NDArray[np.float64]:
    angles = [(p.attitude.azimuth_deg, p.attitude.pitch_deg, p.attitude.roll_deg) for p in poses]
    return np.array(angles)
