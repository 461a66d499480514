"""Caruso, temperature effects: offset drift with set readings alone and with pairs, over 50 deg C.

The compass is calibrated once, at 25 deg C, and then only warmed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.reproduction.caruso_turn import COUNT_16_MG, COUNTS, HORIZONTAL_MG, section
from bench.reproduction.figures import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    RED,
    draw_exact,
    draw_measured,
    draw_ours,
    error_axis,
    heading_axis,
    legend_above,
    panels,
)
from bench.reproduction.result import PaperFigure, Published, claimed_zero
from bench.reproduction.setup import Setup
from bench.reproduction.turns import error_deg, largest, turn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.result import Reproduction

COLD_C: Final = 25.0
RISE_C: Final = 50.0
TEMPERATURES_C: Final = (25.0, 37.5, 50.0, 62.5, 75.0)
DRAWN_C: Final = {25.0: BLUE, 50.0: ORANGE, 75.0: RED}
SITE: Final = Setup(horizontal_mg=HORIZONTAL_MG, dip_deg=0.0)
DRIFTING: Final = replace(
    SITE,
    sensitivity_tempco_per_c=(-0.003, -0.003, -0.003),
    offset_mg=(30.0, -20.0, 0.0),
    offset_tempco_mg_per_c=(0.3, -0.2, 0.0),
)
"""A bridge as its data sheet has it: -0.3 %/C of sensitivity, offsets that drift apart."""
WHERE: Final = "Temperature effects"
SHARE_PER_C: Final = 0.0001
"""The paper's 0.01 %/C."""
SHARE_DEG: Final = float(np.rad2deg(np.arctan(SHARE_PER_C * RISE_C)))
"""0.5 % of the field, across it: 0.29 deg."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Warm:
    """A turn at one temperature: azimuth, set and (set - reset)/2 less their cold offsets."""

    azimuth_deg: NDArray[np.float64]
    single_mg: NDArray[np.float64]
    pair_mg: NDArray[np.float64]
    single_error_deg: NDArray[np.float64]
    pair_error_deg: NDArray[np.float64]


def reproduce_temperature(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure what 50 deg C do to a heading, with and without set and reset."""
    turns = {t_c: _turn(open_laboratory, DRIFTING, t_c) for t_c in TEMPERATURES_C}
    hot_c = COLD_C + RISE_C
    as_offset = replace(SITE, offset_tempco_mg_per_c=(SHARE_PER_C * HORIZONTAL_MG, 0.0, 0.0))
    as_mismatch = replace(SITE, sensitivity_tempco_per_c=(SHARE_PER_C, 0.0, 0.0))
    offset = _turn(open_laboratory, as_offset, hot_c)
    mismatch = _turn(open_laboratory, as_mismatch, hot_c)
    figure = PaperFigure(
        name="caruso-temperature",
        title="Temperature effects: heading with and without set/reset over 50 deg C",
        caption=(
            "Calibrated at 25 deg C, then warmed: sensitivity -0.3 %/C on both axes, bridge "
            "offsets +0.3 and -0.2 mG/C. Left: largest heading error with set readings alone "
            "and with (set - reset)/2. Middle: the set readings' error against heading. Right: "
            "set readings in the plane, blue at 25 and red at 75 deg C: the circle shrinks, "
            "which costs nothing, and moves, which does."
        ),
        draw=lambda: _draw(turns),
    )
    hot = turns[hot_c]
    remarks = [
        f"Over {RISE_C:.0f} deg C an offset that drifts by 0.3 and -0.2 mG/C turns the heading of "
        f"set readings alone by up to {largest(hot.single_error_deg):.1f} deg; pairs keep "
        f"{largest(hot.pair_error_deg):.3f} deg, although the sensitivity falls by 15 %. Set and "
        "reset remove the offset and its drift; the sensitivity's drift stays in the readings and "
        "cancels in the ratio of two matched axes.",
    ]
    numbers = [*_drift_numbers(turns[COLD_C], hot), *_effect_numbers(offset, mismatch, hot)]
    return section(numbers, [figure], remarks)


def _turn(open_laboratory: OpenLaboratory, setup: Setup, temperature_c: float) -> Warm:
    with open_laboratory(replace(setup, temperature_c=temperature_c)) as laboratory:
        readings = laboratory.measure(turn(16))
    single_mg = readings["set_mg"] - np.array(setup.offset_mg)
    pair_mg = readings["field_mg"]
    return Warm(
        azimuth_deg=readings["rig_azimuth_deg"],
        single_mg=single_mg,
        pair_mg=pair_mg,
        single_error_deg=error_deg(compensated_heading_deg(None, single_mg), readings),
        pair_error_deg=error_deg(compensated_heading_deg(None, pair_mg), readings),
    )


def _radius_mg(field_mg: NDArray[np.float64]) -> float:
    return float(np.hypot(field_mg[:, 0], field_mg[:, 1]).mean())


def _shift_mg(field_mg: NDArray[np.float64]) -> float:
    """Return how far the centre of a turn lies from zero."""
    return float(np.hypot(*field_mg[:, :2].mean(axis=0)))


def _drift_numbers(cold: Warm, hot: Warm) -> list[Published]:
    """Return how the readings vary, in percent of the field a deg C."""
    percent = 100.0 / HORIZONTAL_MG / RISE_C
    gain = (_radius_mg(cold.pair_mg) - _radius_mg(hot.pair_mg)) * percent
    offset = (_shift_mg(hot.pair_mg) - _shift_mg(cold.pair_mg)) * percent
    single = (_shift_mg(hot.single_mg) - _shift_mg(cold.single_mg)) * percent
    drift_mg = float(np.hypot(*DRIFTING.offset_tempco_mg_per_c[:2]))
    rows = (
        ("of the offset with set/reset", offset, 0.0, "printed as an upper limit"),
        ("of the sensitivity with set/reset", gain, 0.3, "they do not touch it; Y/X cancels it"),
        (
            "of the offset with set readings alone",
            single,
            100.0 * drift_mg / HORIZONTAL_MG,
            "the same bridges, for comparison",
        ),
    )
    return [
        Published(
            where=WHERE,
            quantity=f"variation {what}",
            unit="%/C",
            published=100.0 * SHARE_PER_C,
            ours=ours,
            tolerance=0.0005,
            reason=f"counts of {COUNT_16_MG:.3f} mG over 50 deg C",
            exact=exact,
            note=note,
        )
        for what, ours, exact, note in rows
    ]


def _effect_numbers(offset: Warm, mismatch: Warm, common: Warm) -> list[Published]:
    """Return what 0.01 %/C over 50 deg C does to the heading, by what it is of."""
    rows = (
        ("an offset", largest(offset.single_error_deg), None, "0.5 % of the field, across it"),
        (
            "a mismatch of the gains",
            largest(mismatch.pair_error_deg),
            SHARE_DEG / 2.0,
            "half of the printed effect",
        ),
    )
    numbers = [
        Published(
            where=WHERE,
            quantity=f"effect of 0.01 %/C over 50 deg C: {what}",
            unit="deg",
            published=0.29,
            ours=ours,
            tolerance=0.012,
            reason=COUNTS[1],
            exact=exact,
            note=note,
        )
        for what, ours, exact, note in rows
    ]
    common_number = claimed_zero(
        WHERE,
        "effect of a common gain that falls by 15 %",
        "deg",
        largest(common.pair_error_deg),
        COUNTS,
        note="'the net change is canceled': so it is",
    )
    return [*numbers, common_number]


def _draw(turns: dict[float, Warm]) -> Figure:
    figure, (left, middle, right) = panels(1, 3, height_in=2.5)
    warm_c = list(turns)
    for name, color, worst_deg in (
        ("set readings alone", PURPLE, [largest(one.single_error_deg) for one in turns.values()]),
        ("(set - reset)/2", GREEN, [largest(one.pair_error_deg) for one in turns.values()]),
    ):
        draw_ours(left, warm_c, worst_deg, name, color=color, marker="o")
    legend_above(left, columns=1)
    left.set_xticks(warm_c[::2])
    left.set_xlabel("temperature (°C)")
    left.set_ylabel("largest error (deg)")
    left.set_ylim(-0.2, 7.0)
    for t_c, color in DRAWN_C.items():
        one = turns[t_c]
        order = np.argsort(one.azimuth_deg)
        draw_measured(
            middle,
            one.azimuth_deg[order],
            one.single_error_deg[order],
            f"{t_c:.0f} °C",
            color=color,
            linestyle="-",
            linewidth=0.8,
        )
    heading_axis(middle)
    error_axis(middle)
    legend_above(middle, columns=3, handletextpad=0.1, columnspacing=0.8)
    for t_c in (COLD_C, COLD_C + RISE_C):
        _draw_plane(right, turns[t_c], DRAWN_C[t_c])
    return figure


def _draw_plane(axes: Axes, one: Warm, color: str) -> None:
    x_mg, y_mg = one.single_mg[:, 0], one.single_mg[:, 1]
    draw_measured(axes, x_mg, y_mg, color=color)
    angle_rad = np.linspace(0.0, 2.0 * np.pi, 181)
    centre_mg, radius_mg = one.single_mg[:, :2].mean(axis=0), _radius_mg(one.pair_mg)
    draw_exact(
        axes,
        centre_mg[0] + radius_mg * np.cos(angle_rad),
        centre_mg[1] + radius_mg * np.sin(angle_rad),
        color=color,
    )
    axes.plot(*centre_mg, marker="+", color=color)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x (mG)")
    axes.set_ylabel("y (mG)")
