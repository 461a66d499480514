"""Caruso, Figs. 5 to 7: transfer curves of the bridge, over temperature and after set and reset.

The module is turned in a horizontal field of 2 G, so that its x bridge sees 2 G cos(heading).
Readings in mG become the paper's millivolts by the sensitivity of a bridge at 5 V.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.reproduction.caruso_turn import section
from bench.reproduction.figures import (
    BLUE,
    COLOURS,
    GREY,
    RED,
    draw_exact,
    draw_measured,
    draw_ours,
    note,
    panels,
)
from bench.reproduction.result import PaperFigure, Published, claimed_zero
from bench.reproduction.setup import Setup
from bench.reproduction.turns import headings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.result import Reproduction

MV_PER_G: Final = 16.0
"""Sensitivity: 3.2 mV/V/G of the HMC1001 and HMC1002 at 5 V; the paper prints none."""
LARGEST_G: Final = 2.0
APPLIED_G: Final = np.linspace(-LARGEST_G, LARGEST_G, 11)
TEMPERATURES_C: Final = (-40.0, 0.0, 25.0, 50.0, 85.0)
TEMPCO_PER_C: Final = -0.003
"""Of the sensitivity, with a voltage supply."""
OFFSET_MV: Final = -3.0
STEADY_G: Final = 1.0
"""Applied field of Fig. 7."""
CYCLES: Final = 6
CYCLE_S: Final = 0.01
_MG_PER_G: Final = 1000.0
_RANGE_MG: Final = 4000.0
_COUNT_MV: Final = 2.0 * _RANGE_MG / 2.0**16 / _MG_PER_G * MV_PER_G


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Transfer:
    """Output of the x bridge after set and after reset pulses, each shape (n,), in mV."""

    applied_g: NDArray[np.float64]
    set_mv: NDArray[np.float64]
    reset_mv: NDArray[np.float64]


def reproduce_transfer(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure Figs. 5 to 7."""
    warm = {t_c: _transfer(open_laboratory, t_c, 0.0) for t_c in TEMPERATURES_C}
    flipped = _transfer(open_laboratory, 25.0, OFFSET_MV)
    pulses_mv = _pulses_mv(open_laboratory)
    figures = [
        PaperFigure(
            name="caruso-figs-5-6",
            title="Figs. 5 and 6: transfer curves over temperature, and after set and reset",
            caption=(
                f"Left: x bridge in {TEMPERATURES_C[0]:.0f} to {TEMPERATURES_C[-1]:.0f} deg C, "
                f"tempco {100 * TEMPCO_PER_C:.1f} %/C; all lines cross at zero field. Right: the "
                f"two polarities of a bridge with an offset of {OFFSET_MV:.0f} mV, where they "
                f"cross. Dots: read over CAN, the module turned in a field of {LARGEST_G:.0f} G; "
                f"{MV_PER_G:.0f} mV/G, a converter of +-4 G. The paper does not print its "
                "sensitivity and temperatures."
            ),
            draw=lambda: _draw_curves(warm, flipped),
        ),
        PaperFigure(
            name="caruso-fig-7",
            title="Fig. 7: set and reset pulses in a steady field",
            caption=(
                f"x bridge in {STEADY_G:.0f} G: one set and one reset reading every 10 ms, from "
                "the module's own frames, each drawn for half a cycle. Peak to peak it is 2 S "
                f"Happlied, about the offset of {OFFSET_MV:.0f} mV that (7) removes."
            ),
            draw=lambda: _draw_pulses(pulses_mv),
        ),
    ]
    return section(_numbers(warm, flipped, pulses_mv), figures, [])


def _setup(temperature_c: float, offset_mv: float, horizontal_g: float) -> Setup:
    return Setup(
        horizontal_mg=horizontal_g * _MG_PER_G,
        dip_deg=0.0,
        range_mg=_RANGE_MG,
        sensitivity_tempco_per_c=(TEMPCO_PER_C,) * 3,
        offset_mg=(offset_mv / MV_PER_G * _MG_PER_G, 0.0, 0.0),
        temperature_c=temperature_c,
    )


def _transfer(open_laboratory: OpenLaboratory, temperature_c: float, offset_mv: float) -> Transfer:
    with open_laboratory(_setup(temperature_c, offset_mv, LARGEST_G)) as laboratory:
        azimuths_deg = np.rad2deg(np.arccos(APPLIED_G / LARGEST_G))
        readings = laboratory.measure(headings(azimuths_deg))
    azimuth_rad = np.deg2rad(readings["rig_azimuth_deg"])
    return Transfer(
        applied_g=LARGEST_G * np.cos(azimuth_rad),
        set_mv=_millivolts(readings["set_mg"][:, 0]),
        reset_mv=_millivolts(readings["reset_mg"][:, 0]),
    )


def _pulses_mv(open_laboratory: OpenLaboratory) -> NDArray[np.float64]:
    """Return set and reset readings of cycle after cycle, shape (cycles, 2)."""
    with open_laboratory(_setup(25.0, OFFSET_MV, STEADY_G)) as laboratory:
        laboratory.measure(headings([0.0]))
        samples = laboratory.listen((CYCLES + 2) * CYCLE_S)
    x_mg = np.column_stack([samples["set_mg"][:, 0], samples["reset_mg"][:, 0]])
    return _millivolts(x_mg[:CYCLES])


def _millivolts(field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(field_mg / _MG_PER_G * MV_PER_G)


def _line(applied_g: NDArray[np.float64], output_mv: NDArray[np.float64]) -> tuple[float, float]:
    slope, level = np.polyfit(applied_g, output_mv, 1)
    return float(slope), float(level)


def _crossing(first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float]:
    """Return field in G and output in mV where two lines (slope, level) cross."""
    applied_g = (second[1] - first[1]) / (first[0] - second[0])
    return applied_g, first[0] * applied_g + first[1]


def _numbers(
    warm: dict[float, Transfer], flipped: Transfer, pulses_mv: NDArray[np.float64]
) -> list[Published]:
    lines = {t_c: _line(one.applied_g, one.set_mv) for t_c, one in warm.items()}
    pivot_g, _ = _crossing(lines[TEMPERATURES_C[0]], lines[TEMPERATURES_C[-1]])
    crossing_g, crossing_mv = _crossing(
        _line(flipped.applied_g, flipped.set_mv), _line(flipped.applied_g, flipped.reset_mv)
    )
    swing_mv = float((pulses_mv[:, 0] - pulses_mv[:, 1]).mean())
    counts = f"counts of {_COUNT_MV:.4f} mV"
    g_counts = (0.001, counts)
    warmest = f"{TEMPERATURES_C[0]:.0f} and {TEMPERATURES_C[-1]:.0f} deg C"
    return [
        claimed_zero("Fig. 5", f"field where {warmest} cross", "G", abs(pivot_g), g_counts),
        claimed_zero("Fig. 6", "field where set and reset cross", "G", abs(crossing_g), g_counts),
        Published(
            where="Fig. 6",
            quantity="output where set and reset cross",
            unit="mV",
            published=OFFSET_MV,
            ours=crossing_mv,
            tolerance=0.005,
            reason=counts,
        ),
        Published(
            where="Fig. 7, (7)",
            quantity="(Vset - Vreset) / (S Happlied)",
            unit="",
            published=2.0,
            ours=swing_mv / (MV_PER_G * STEADY_G),
            tolerance=0.0005,
            reason=counts,
        ),
    ]


def _draw_curves(warm: dict[float, Transfer], flipped: Transfer) -> Figure:
    figure, (left, right) = panels(1, 2, height_in=3.0, sharey=True)
    for color, (t_c, one) in zip(COLOURS, warm.items(), strict=False):
        draw_exact(left, *_drawn_line(one.applied_g, one.set_mv), color=color)
        name = f"{t_c:.0f} °C"
        draw_measured(left, one.applied_g, one.set_mv, name, color=color)
    left.legend(loc="upper left", handletextpad=0.2)
    for name, color, output_mv in (("set", BLUE, flipped.set_mv), ("reset", RED, flipped.reset_mv)):
        draw_exact(right, *_drawn_line(flipped.applied_g, output_mv), color=color)
        draw_measured(right, flipped.applied_g, output_mv, color=color)
        side = -1.0 if output_mv is flipped.reset_mv else 1.0
        note(right, 1.5 * side, 29.0, name, color=color, ha="center")
    note(right, 0.5, OFFSET_MV - 2.5, f"offset {OFFSET_MV:.0f} mV")
    left.set_ylabel("output (mV)")
    for axes, title in ((left, "Fig. 5"), (right, "Fig. 6")):
        _field_axis(axes)
        axes.set_title(title)
    return figure


def _drawn_line(
    applied_g: NDArray[np.float64], output_mv: NDArray[np.float64]
) -> tuple[list[float], list[float]]:
    slope, level = _line(applied_g, output_mv)
    ends_g = [-LARGEST_G, LARGEST_G]
    return ends_g, [slope * end_g + level for end_g in ends_g]


def _field_axis(axes: Axes) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.5, zorder=1.5)
    axes.axvline(0.0, color=GREY, linewidth=0.5, zorder=1.5)
    axes.set_xlim(-LARGEST_G - 0.1, LARGEST_G + 0.1)
    axes.set_xticks([-2.0, -1.0, 0.0, 1.0, 2.0])
    axes.set_ylim(-50.0, 50.0)
    axes.set_xlabel("applied field (G)")


def _draw_pulses(pulses_mv: NDArray[np.float64]) -> Figure:
    figure, (axes,) = panels(1, 1, height_in=2.4)
    edges_ms = np.arange(2 * CYCLES + 1) * 500.0 * CYCLE_S
    levels_mv = pulses_mv.ravel()
    draw_ours(axes, edges_ms, np.append(levels_mv, levels_mv[-1]), drawstyle="steps-post")
    draw_measured(axes, edges_ms[:-1] + 2.5, levels_mv)
    end_ms = float(edges_ms[-1])
    draw_exact(axes, [0.0, end_ms], [OFFSET_MV, OFFSET_MV])
    high_mv, low_mv = float(levels_mv[0]), float(levels_mv[1])
    note(axes, end_ms + 0.6, high_mv, "set", color=BLUE)
    note(axes, end_ms + 0.6, low_mv, "reset", color=BLUE)
    note(axes, end_ms + 0.6, OFFSET_MV, "offset", color=GREY)
    style = {"arrowstyle": "<->", "color": "#222222", "linewidth": 0.8}
    at_ms = end_ms + 5.5
    axes.annotate("", (at_ms, high_mv), (at_ms, low_mv), arrowprops=style)
    note(axes, at_ms + 0.5, 5.0, r"2 S $H_\mathrm{applied}$")
    axes.set_xlim(0.0, end_ms + 14.0)
    axes.set_xticks(np.arange(0.0, end_ms + 1.0, 10.0))
    axes.set_ylim(-25.0, 20.0)
    axes.set_xlabel("time (ms)")
    axes.set_ylabel("Vout (mV)")
    return figure
