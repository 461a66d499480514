"""The figures of Cho & Park, drawn from what the bench measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.reproduction.cho_park_blind import (
    AZIMUTH_DEG,
    CUT_AZIMUTH_DEG,
    TILT_DEG,
)
from bench.reproduction.cho_park_site import SEOUL_DEG
from bench.reproduction.cho_park_table import (
    ADOPTED_TILT_DEG,
    HAND_SD_DEG,
    SITE_DIP_DEG,
    SWEEPS,
)
from bench.reproduction.cho_park_turn import exact_errors_deg, exact_z_error
from bench.reproduction.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    RED,
    draw_exact,
    draw_measured,
    draw_ours,
    draw_printed,
    draw_published,
    error_axis,
    figure_legend,
    heading_axis,
    legend_above,
    note,
    panels,
    printed_limit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import QuadContourSet
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.calibration.geomagnetic import DipComparison
    from bench.reproduction.cho_park_blind import BlindMap
    from bench.reproduction.cho_park_table import Spread, Tilting
    from bench.reproduction.cho_park_turn import Compensated, Turn

_SD_LEVELS: Final = (1.5, 2.0, 3.0, 4.0, 8.0, 16.0)


def draw_fig_1(curves: tuple[NDArray[np.float64], ...], seoul: DipComparison) -> Figure:
    """Draw dip against latitude: (25), the model along Seoul's meridian, and Seoul by each."""
    figure, (axes, zoom) = panels(1, 2, height_in=2.6, width_ratios=(1.0, 1.3))
    latitude_deg, dipole_deg, model_deg = curves
    magnetic_deg = seoul.geomagnetic_deg
    for part in (axes, zoom):
        draw_exact(part, latitude_deg, model_deg, "World Magnetic Model 2025, 127 deg east")
        draw_ours(part, latitude_deg, dipole_deg, "(25)")
        part.axvline(SEOUL_DEG, color=GREY, linewidth=0.7, linestyle=(0, (1.0, 2.0)))
        part.set_xlabel("latitude (deg)")
    for dip_deg, text, color, shift_deg in (
        (seoul.geographic_deg, f"(25), latitude: {seoul.geographic_deg:.2f}", BLUE, (-0.6, 0.8)),
        (seoul.model_deg, f"World Magnetic Model: {seoul.model_deg:.1f}", GREY, (0.8, -0.4)),
        (SITE_DIP_DEG, "the paper's site: 48.72", INK, (0.8, 0.5)),
        (magnetic_deg, f"(25), geomagnetic: {magnetic_deg:.1f}", GREEN, (0.8, -0.5)),
    ):
        axes.plot(SEOUL_DEG, dip_deg, "o", color=color, markersize=3.6, zorder=4.0)
        zoom.plot(SEOUL_DEG, dip_deg, "o", color=color, markersize=4.5, zorder=4.0)
        x, y = SEOUL_DEG + shift_deg[0], dip_deg + shift_deg[1]
        note(zoom, x, y, text, color=color, ha="right" if shift_deg[0] < 0.0 else "left")
    axes.set(xlim=(-90.0, 90.0), ylim=(-90.0, 90.0), ylabel="dip (deg)")
    axes.set_xticks(range(-90, 91, 30))
    axes.set_yticks(range(-90, 91, 30))
    zoom.set(xlim=(26.0, 50.0), ylim=(42.0, 63.0), ylabel="dip (deg)")
    figure_legend(figure, axes)
    return figure


def draw_fig_4(sweep: Tilting, exact_deg: NDArray[np.float64]) -> Figure:
    """Draw the error of (26) against pitch: all of it, and its last degrees."""
    figure, (whole, near) = panels(1, 2, height_in=2.5)
    error_deg = sweep.dip_deg - SITE_DIP_DEG
    for axes in (whole, near):
        draw_exact(axes, sweep.pitch_deg, exact_deg - SITE_DIP_DEG, "azimuth off, no noise")
        draw_measured(axes, sweep.pitch_deg, error_deg, "measured")
        error_axis(axes, "error of the dip angle (deg)")
        axes.set_xlabel("pitch (deg)")
        axes.set_xlim(-85.0, 85.0)
        axes.set_xticks(range(-80, 81, 20))
    printed_limit(whole, -140.0, 20.0)
    note(whole, 84.0, -139.0, "ends of the printed axis", ha="right", va="bottom", color=GREY)
    whole.set_ylim(-150.0, 60.0)
    near.set_ylim(-8.0, 8.0)
    near.axvspan(-ADOPTED_TILT_DEG, ADOPTED_TILT_DEG, color="#F1F1F1", linewidth=0.0, zorder=0.5)
    note(near, 1.5, -7.2, "not adopted", color=GREY)
    legend_above(whole)
    return figure


def draw_fig_5(tiltings: list[Tilting]) -> Figure:
    """Draw roll, pitch and calculated dip angle against the sample for each row of Table 1."""
    figure, all_axes = panels(2, 3, height_in=4.0, sharey=True)
    for axes, tilting in zip(all_axes, tiltings, strict=True):
        sample = np.arange(len(tilting.dip_deg))
        axes.axhline(SITE_DIP_DEG, color=GREY, linewidth=0.7, zorder=1.8)
        axes.plot(sample, tilting.roll_deg, color=GREEN, label="roll", zorder=2.4)
        axes.plot(sample, tilting.pitch_deg, color=ORANGE, label="pitch", zorder=2.4)
        draw_measured(axes, sample, tilting.dip_deg, "calculated dip angle")
        axes.set_ylim(-100.0, 100.0)
        axes.set_yticks(range(-80, 81, 40))
        axes.set_xlim(0, len(sample) - 1)
        sweep = tilting.sweep
        axes.set_title(f"({sweep.key}) {sweep.azimuth_deg:.0f} deg, {sweep.condition}")
    for axes in all_axes[3:]:
        axes.set_xlabel("sample")
    for axes in (all_axes[0], all_axes[3]):
        axes.set_ylabel("angle (deg)")
    figure_legend(figure, all_axes[0])
    return figure


def draw_table_1(tiltings: list[Tilting], spread: Spread) -> Figure:
    """Draw the six rows: published, ours by the paper's rule, ours by least squares."""
    figure, (axes,) = panels(height_in=2.4)
    rows = np.arange(len(tiltings), dtype=float)
    axes.axhline(SITE_DIP_DEG, color=INK, linewidth=0.8, zorder=1.8)
    axes.axhspan(SITE_DIP_DEG - 1.0, SITE_DIP_DEG + 1.0, color="#F1F1F1", linewidth=0, zorder=0.5)
    adopted = [tilting.adopted_deg for tilting in tiltings]
    fitted = [tilting.fitted_deg for tilting in tiltings]
    _draw_bars(axes, rows, adopted, spread.adopted_deg, "ours, (26) beyond 30 deg", ORANGE)
    _draw_bars(axes, rows + 0.18, fitted, spread.fitted_deg, "ours, weighted least squares", BLUE)
    draw_published(axes, rows - 0.18, [sweep.published_deg for sweep in SWEEPS])
    axes.set_xticks(rows, [f"({s.key}) {s.azimuth_deg:.0f} deg\n{s.condition}" for s in SWEEPS])
    axes.grid(visible=False, axis="x")
    axes.set_xlim(-0.5, 5.95)
    axes.set_ylabel("extended dip angle (deg)")
    note(axes, 5.93, SITE_DIP_DEG + 0.12, "48.72", ha="right", va="bottom")
    note(axes, 5.93, SITE_DIP_DEG - 0.93, "within 1 deg", ha="right", va="bottom", color=GREY)
    legend_above(axes)
    return figure


def _draw_bars(  # noqa: PLR0913 - points, their repeats, and how they look
    axes: Axes,
    rows: NDArray[np.float64],
    values_deg: list[float],
    repeats_deg: NDArray[np.float64],
    label: str,
    color: str,
) -> None:
    axes.errorbar(
        rows,
        values_deg,
        yerr=2.0 * repeats_deg.std(axis=0),
        fmt="o",
        color=color,
        markersize=4.0,
        elinewidth=0.9,
        capsize=2.0,
        label=label,
        zorder=3.0,
    )


def draw_fig_6(turn: Turn) -> Figure:
    """Draw pitch and the heading error of a tilted module taken for level."""
    figure, (axes,) = panels(height_in=2.4)
    error_axis(axes, "pitch, heading error (deg)")
    draw_exact(axes, np.arange(360.0), exact_errors_deg(None), "error, exact")
    draw_measured(axes, turn.heading_deg, turn.uncompensated_deg, "error, measured")
    draw_ours(axes, turn.heading_deg, turn.pitch_deg, "pitch, measured", color=ORANGE)
    printed_limit(axes, 40.0, -40.0)
    note(axes, 3.0, -39.4, "ends of the printed axis", va="bottom", color=GREY)
    axes.set_ylim(-47.0, 47.0)
    heading_axis(axes)
    legend_above(axes)
    return figure


def draw_turn(turn: Turn, taken: Compensated, *, own: bool) -> Figure:
    """Draw Fig. 7 or 8: the third axis and the heading error with one dip angle."""
    figure, (left, right) = panels(1, 2, height_in=2.6)
    degrees = np.arange(360.0)
    draw_exact(left, degrees, exact_z_error(taken.dip_deg), "exact error")
    draw_printed(left, turn.heading_deg, taken.z, "estimated z", color=RED)
    draw_ours(left, turn.heading_deg, turn.z, "measured z", color=INK, linewidth=1.0)
    draw_measured(left, turn.heading_deg, taken.z - turn.z, "error")
    left.set_ylim(-0.1, 1.1)
    left.set_ylabel("z over the field")
    error_axis(right)
    draw_exact(right, degrees, exact_errors_deg(taken.dip_deg), "exact error")
    draw_measured(right, turn.heading_deg, taken.error_deg)
    if own:
        own_deg = turn.own_error_deg
        draw_ours(
            right, turn.heading_deg, own_deg, "module's own heading", color=ORANGE, linewidth=0.8
        )
        right.set_ylim(-2.0, 2.0)
    else:
        printed_limit(right, 10.0, -10.0)
        note(right, 2.0, 10.2, "ends of the printed axis", va="bottom", color=GREY)
        right.set_ylim(-15.0, 15.0)
    for axes in (left, right):
        heading_axis(axes)
    figure_legend(figure, left, right)
    return figure


def draw_blind_map(blind: BlindMap) -> Figure:
    """Draw what one pose tells of the dip: maps for pitch and roll, and cuts at 30 deg."""
    figure, (pitch, roll, cuts) = panels(1, 3, height_in=2.9, width_ratios=(1.0, 1.0, 1.1))
    filled = _draw_map(pitch, blind.by_pitch, "pitch (deg)", (0.0, 180.0, 360.0))
    _draw_map(roll, blind.by_roll, "roll (deg)", (90.0, 270.0))
    pitch.set_title("pitch alone")
    roll.set_title("roll alone")
    bar = figure.colorbar(filled, ax=[pitch, roll], location="bottom", aspect=40)
    bar.set_label(f"sd of the dip from one pose (deg), azimuth sd {HAND_SD_DEG:.0f} deg")
    bar.set_ticks([HAND_SD_DEG / sd for sd in _SD_LEVELS], labels=[f"{sd:g}" for sd in _SD_LEVELS])
    cuts.axhline(0.0, color=INK, linewidth=0.5, zorder=1.5)
    for (name, values), color in zip(blind.cuts.items(), (ORANGE, GREEN, BLUE), strict=True):
        azimuth_deg, closed = np.append(CUT_AZIMUTH_DEG, 360.0), np.append(values, values[0])
        options = {"marker": "o", "markersize": 2.2, "linewidth": 0.9}
        draw_ours(cuts, azimuth_deg, closed, name, color=color, **options)
        zeros = blind.blind_deg(name)
        cuts.plot(zeros, 0.0 * zeros, "o", mfc="white", mec=color, markersize=4.5, zorder=4.0)
    cuts.set_title("tilts of 30 deg")
    cuts.set_ylabel("heading over dip (deg/deg)")
    cuts.set_ylim(-2.3, 2.3)
    heading_axis(cuts, "azimuth (deg)")
    cuts.legend(loc="upper left", bbox_to_anchor=(0.0, -0.34), borderaxespad=0.0)
    return figure


def _draw_map(
    axes: Axes, values: NDArray[np.float64], label: str, blind_deg: tuple[float, ...]
) -> QuadContourSet:
    from scipy.interpolate import RectBivariateSpline

    azimuth_deg, tilt_deg = np.arange(0.0, 361.0, 8.0), np.arange(-60.0, 60.1, 4.0)
    smooth = RectBivariateSpline(AZIMUTH_DEG, TILT_DEG, values)(azimuth_deg, tilt_deg)
    levels = [0.0, *sorted(HAND_SD_DEG / sd for sd in _SD_LEVELS), 4.0]
    filled = axes.contourf(azimuth_deg, tilt_deg, np.abs(smooth).T, levels, cmap="Blues")
    for blind in blind_deg:
        axes.axvline(blind, color=RED, linewidth=1.4, zorder=3.0, clip_on=False)
    axes.axhline(0.0, color=RED, linewidth=1.4, zorder=3.0)
    axes.set_yticks(range(-60, 61, 30))
    axes.set_ylabel(label)
    axes.grid(visible=False)
    heading_axis(axes, "azimuth (deg)")
    return filled
