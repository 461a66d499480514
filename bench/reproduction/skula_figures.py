"""Drawings of Skula's figures and of the study beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.reproduction import figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.reproduction.skula_routine import Routine
    from bench.reproduction.skula_study import Positioning, RigTime, Spread, Study
    from bench.reproduction.skula_turn import FirstPositions, Turn

PULSES: Final = 9
"""Measuring cycles that Fig. 1 shows."""


def draw_routine(routine: Routine) -> Figure:
    """Draw Fig. 1: the output toggling, and what (1) makes of it over a turn."""
    figure, (toggling, offsets) = figures.panels(1, 2, height_in=2.5, width_ratios=(3, 2))
    _draw_toggling(toggling, routine)
    azimuth_deg = routine.azimuth_deg
    figures.draw_printed(offsets, azimuth_deg, routine.crossed_mg, "(1), film of 8 G")
    figures.draw_measured(offsets, azimuth_deg, routine.plain_mg, "(1), ideal", color=figures.GREY)
    offsets.axhline(
        routine.regressed_mg, color=figures.BLUE, linewidth=1.2, zorder=2.0, label="regressed"
    )
    figures.heading_axis(offsets, "azimuth (deg)")
    offsets.set_ylabel("half sum of x (mG)")
    offsets.legend(loc="lower left", borderaxespad=0.2)
    return figure


def _draw_toggling(axes: Axes, routine: Routine) -> None:
    ms = (routine.t_s[:PULSES] - routine.t_s[0]) * 1000.0
    half = (ms[1] - ms[0]) / 2.0
    times = np.column_stack([ms, ms + half]).ravel()
    levels = np.column_stack([routine.set_mg[:PULSES], routine.reset_mg[:PULSES]]).ravel()
    axes.step(
        np.append(times, times[-1] + half), np.append(levels, levels[-1]), where="post",
        color=figures.BLUE, zorder=3.0,
    )  # fmt: skip
    top = levels.max() + 0.22 * np.ptp(levels)
    for times_ms, marker, colour in ((ms, "^", figures.GREEN), (ms + half, "v", figures.RED)):
        axes.plot(times_ms, np.full(len(ms), top), marker, color=colour, markersize=4.0)
    right = times[-1] + half
    for level, text in (
        (levels[-2], "$V_{set}$"),
        (levels[-1], "$V_{reset}$"),
        (routine.offset_mg, "$V_{off}$"),
        (top, "pulses"),
    ):
        figures.note(axes, right + 1.0, level, text)
    axes.hlines(
        routine.offset_mg, -1.0, right, color=figures.INK, linewidth=0.8, linestyle=(0, (4, 2))
    )
    axes.set_xlim(-1.0, right + 14.0)
    axes.set_xticks(range(0, int(right) + 1, 20))
    axes.set_xlabel("time (ms)")
    axes.set_ylabel("output of x (mG)")


def draw_first_positions(turn: Turn, found: FirstPositions) -> Figure:
    """Draw Fig. 2: the field of both axes, and the error by the first position."""
    figure, (field, all_ways, near) = figures.panels(3, 1, height_in=6.0, sharex=True)
    first_deg = np.append(turn.azimuth_deg, 360.0)
    for axis, name, colour in ((0, "x", figures.BLUE), (1, "y", figures.GREEN)):
        values = np.append(turn.field_mg[:, axis], turn.field_mg[0, axis])
        figures.draw_ours(field, first_deg, values, name, color=colour)
        middle = float(turn.field_mg[:, axis].mean())
        field.axhline(middle, color=colour, linewidth=0.7, linestyle=(0, (1, 2)))
    field.set_ylabel("set reading (mG)")
    figures.legend_above(field)
    printed = _closed(found.printed_deg)
    figures.draw_measured(
        all_ways, first_deg, printed, "(5)-(7) as printed", color=figures.RED, zorder=3.2
    )
    lost = first_deg[~np.isfinite(printed)]
    all_ways.plot(
        lost, np.zeros(len(lost)), "x", color=figures.RED, markersize=4.5, clip_on=False,
        label="0/0: no value",
    )  # fmt: skip
    for axes in (all_ways, near):
        ours = _closed(found.four_deg)
        figures.draw_printed(
            axes, first_deg, _closed(found.printed_offset_deg),
            "printed c, right A" if axes is all_ways else "", color=figures.ORANGE,
        )  # fmt: skip
        figures.draw_ours(axes, first_deg, ours, "mean of four" if axes is all_ways else "")
        axes.axhline(
            found.min_max_deg, color=figures.INK, linewidth=1.0, linestyle=(0, (6, 3)), zorder=2.6,
            label="min-max" if axes is all_ways else "",
        )  # fmt: skip
        axes.set_ylabel("mean |error| (deg)")
        axes.set_ylim(0.0)
    figures.legend_above(all_ways, columns=5, columnspacing=1.2)
    figures.heading_axis(near, "azimuth of the first position (deg)", step_deg=45)
    field.set_xlabel("azimuth (deg)")
    field.tick_params(labelbottom=True)
    return figure


def draw_study(study: Study) -> Figure:
    """Draw where four positions beat min-max and where not."""
    figure, axes = figures.panels(2, 2, height_in=5.0)
    noise, third, second, positioning = axes
    _draw_noise(noise, study.noise)
    _draw_band(third, study.third, figures.BLUE, "four positions, by the first one")
    _draw_extremes(third, study.third.setting, study.third_min_max_deg)
    third.set_xlabel("third harmonic of y (% of the field)")
    _draw_band(second, study.second_printed, figures.ORANGE, "printed c, by the first position")
    _draw_band(second, study.second_four, figures.BLUE, "mean of four, any first position")
    _draw_extremes(second, study.second_four.setting, study.second_min_max_deg)
    second.set_xlabel("second harmonic of x and y (% of the field)")
    _draw_positioning(positioning, study.positioning)
    for one, title in zip(
        axes, ("a  noise", "b  third harmonic", "c  second harmonic", "d  positioning"), strict=True
    ):
        one.set_title(title)
        one.legend(loc="upper left")
        one.set_ylabel("mean |error| (deg)")
    return figure


def _draw_noise(axes: Axes, noise: dict[str, Spread]) -> None:
    ways = (
        ("min_max", "min-max of 24", figures.INK, (0, (6, 3))),
        ("extremes", "min-max of the same four", figures.GREY, (0, (1, 1.5))),
        ("four", "four positions", figures.BLUE, "-"),
        ("averaged", "four, 24 readings in all", figures.GREEN, "-"),
    )
    for name, label, colour, style in ways:
        spread = noise[name]
        axes.plot(
            spread.setting, spread.middle_deg, color=colour, linestyle=style, label=label,
            marker="o", markersize=2.6,
        )  # fmt: skip
    four = noise["four"]
    axes.fill_between(
        four.setting, four.low_deg, four.high_deg, color=figures.BLUE, alpha=0.13, linewidth=0.0
    )
    axes.set_xlabel("noise of a reading (mG)")
    axes.set_xlim(0.0)
    axes.set_ylim(0.0)


def _draw_band(axes: Axes, spread: Spread, colour: str, label: str) -> None:
    axes.fill_between(
        spread.setting, spread.low_deg, spread.high_deg, color=colour, alpha=0.22, linewidth=0.0
    )
    axes.plot(spread.setting, spread.middle_deg, color=colour, label=label)
    axes.set_xlim(0.0, float(spread.setting[-1]))
    axes.set_ylim(0.0)


def _draw_extremes(
    axes: Axes, setting: NDArray[np.float64], error_deg: NDArray[np.float64]
) -> None:
    axes.plot(
        setting, error_deg, color=figures.INK, linewidth=1.0, linestyle=(0, (6, 3)),
        label="min-max", zorder=3.2,
    )  # fmt: skip


def _draw_positioning(axes: Axes, found: Positioning) -> None:
    for spread, colour, label in (
        (found.four, figures.BLUE, "four positions"),
        (found.min_max, figures.INK, "min-max of 24"),
    ):
        _draw_band(axes, spread, colour, label)
    axes.set_xlabel("standard deviation of the positions (deg)")


def draw_rig_times(times: list[RigTime]) -> Figure:
    """Draw the error of each way against its time on the rig."""
    figure, (axes,) = figures.panels(1, 1, height_in=2.3)
    for time in times:
        ours = not time.name.startswith("min-max")
        axes.plot(
            time.seconds, time.error_deg, "o" if ours else "s",
            color=figures.BLUE if ours else figures.INK, markersize=5.0,
        )  # fmt: skip
        shift_deg, va = (-0.015, "top") if ours else (0.015, "bottom")
        figures.note(axes, time.seconds, time.error_deg + shift_deg, time.name, ha="center", va=va)
    axes.set_xlim(0.0, 40.0)
    axes.set_ylim(0.0, 1.25 * max(time.error_deg for time in times))
    axes.set_xlabel("time on the rig (s)")
    axes.set_ylabel("mean |error| (deg)")
    return figure


def _closed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.append(values, values[0])
