"""Caruso, Figs. 9 to 13: hard iron as a one-cycle, soft iron as a two-cycle heading error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.deviation import exact_deviation, exact_deviation_deg
from bench.calibration.methods import fit_named
from bench.reproduction.caruso_turn import (
    COUNTS,
    EVERYWHERE_DEG,
    HORIZONTAL_MG,
    section,
)
from bench.reproduction.figures import (
    GREEN,
    RED,
    draw_exact,
    draw_measured,
    draw_ours,
    error_axis,
    heading_axis,
    panels,
    plane_axes,
)
from bench.reproduction.printed_formulas import forty_five_soft_iron
from bench.reproduction.result import PaperFigure, Published, claimed_zero
from bench.reproduction.setup import Setup
from bench.reproduction.turns import calibration_data, error_deg, largest, turn
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from numpy.typing import NDArray

    from bench.calibration.deviation import Deviation
    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.result import Reproduction

COUNT: Final = 36
SITE: Final = Setup(horizontal_mg=HORIZONTAL_MG)
HARD_IRON_MG: Final = (40.0, -30.0, 0.0)
AXIS_RATIO: Final = 4.0 / 3.0
AXES_DEG: Final = (45.0, 20.0)
"""Directions of the ellipse's major axis, from x towards y."""
_TITLES: Final = ("Fig. 9: no iron", "Fig. 10: hard iron", "Fig. 12: soft iron")
RECIPE: Final = "after 45°"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IronSwing:
    """A level turn of one unit.

    Attributes
    ----------
    field_mg : ndarray, shape (n, 2)
    azimuth_deg, error_deg : ndarray, shape (n,)
        Rig azimuth, and error of the raw heading.
    deviation : Deviation
        A to E of the raw headings, exact form.
    left_deg : dict of str to ndarray, shape (n,)
        Error that is left after what the key says.
    """

    field_mg: NDArray[np.float64]
    azimuth_deg: NDArray[np.float64]
    error_deg: NDArray[np.float64]
    deviation: Deviation
    left_deg: dict[str, NDArray[np.float64]]


def ellipse(axis_deg: float) -> tuple[float, ...]:
    """Return symmetric soft iron whose level turn is an ellipse of ratio 4:3, row by row.

    >>> [round(value, 3) for value in ellipse(45.0)[:2]]
    [0.875, 0.125]
    """
    angle_rad = np.deg2rad(axis_deg)
    along = np.array([np.cos(angle_rad), np.sin(angle_rad)])
    short = 1.0 / AXIS_RATIO
    block = short * np.eye(2) + (1.0 - short) * np.outer(along, along)
    (a, b), (c, d) = block
    return (float(a), float(b), 0.0, float(c), float(d), 0.0, 0.0, 0.0, 1.0)


def reproduce_iron(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure Figs. 9 to 13."""
    circle = _swing(open_laboratory, SITE)
    hard = _swing(open_laboratory, replace(SITE, hard_iron_mg=HARD_IRON_MG))
    soft = {
        axis_deg: _swing(open_laboratory, replace(SITE, soft_iron=ellipse(axis_deg)))
        for axis_deg in AXES_DEG
    }
    figures = [
        PaperFigure(
            name="caruso-figs-9-12",
            title="Figs. 9, 10 and 12: level turns without iron, with hard and with soft iron",
            caption=(
                "Readings at 36 headings in 200 mG. Hard iron of 40 and -30 mG moves the circle's "
                "centre to there; soft iron makes an ellipse, here 4:3 with its major axis at 45 "
                "deg from x towards y. Grey: the circle without iron."
            ),
            draw=lambda: _draw_planes(circle, hard, soft[AXES_DEG[0]]),
        ),
        PaperFigure(
            name="caruso-figs-11-13",
            title="Figs. 11 and 13: one-cycle and two-cycle heading errors",
            caption=(
                "Dots: raw headings; line: the coefficients A to E that the product fits to them. "
                "Green: after the product's own calibration (min-max for hard iron, the fitted "
                "ellipse for soft iron). Right: the same ellipse with its major axis at 20 deg; "
                "rotated by 45 deg as the paper has it, "
                f"{largest(soft[20.0].left_deg[RECIPE]):.1f} of "
                f"{largest(soft[20.0].error_deg):.1f} deg stay (red). The product says: "
                f"left, {hard.deviation.words[0]}; middle, {soft[45.0].deviation.words[0]}."
            ),
            draw=lambda: _draw_errors(hard, soft),
        ),
    ]
    return section(_numbers(circle, hard, soft), figures, [])


def _swing(open_laboratory: OpenLaboratory, setup: Setup) -> IronSwing:
    with open_laboratory(setup) as laboratory:
        readings = laboratory.measure(turn(COUNT))
    data = calibration_data(readings, setup)
    raw_deg = compensated_heading_deg(None, data.field_mg)
    left_deg = {
        method: error_deg(compensated_heading_deg(fit_named(method, data), data.field_mg), readings)
        for method in ("min_max", "soft_iron")
    }
    plane_mg = data.field_mg[:, :2]
    recipe = forty_five_soft_iron(plane_mg)
    turned = (plane_mg - recipe.offset_mg) @ recipe.matrix.T
    left_deg[RECIPE] = error_deg(np.rad2deg(np.arctan2(-turned[:, 1], turned[:, 0])), readings)
    return IronSwing(
        field_mg=plane_mg,
        azimuth_deg=readings["rig_azimuth_deg"],
        error_deg=error_deg(raw_deg, readings),
        deviation=exact_deviation(raw_deg, readings["rig_azimuth_deg"]),
        left_deg=left_deg,
    )


def cycles(errors_deg: NDArray[np.float64]) -> int:
    """Return how often an error that is sampled evenly goes up and down in one turn."""
    return int(np.abs(np.fft.rfft(errors_deg))[1 : len(errors_deg) // 2].argmax()) + 1


def exact_recipe_deg(axis_deg: float) -> float:
    """Return what rotating by 45 deg leaves of an exact ellipse: its largest heading error.

    >>> round(exact_recipe_deg(20.0), 2), round(exact_recipe_deg(45.0), 9)
    (6.91, 0.0)
    """
    heading_rad = np.deg2rad(np.arange(0.0, 360.0, 0.5))
    block = np.reshape(ellipse(axis_deg), (3, 3))[:2, :2]
    axes = np.array([[1.0, 1.0], [-1.0, 1.0]]) / 2.0**0.5
    half = np.linalg.norm(axes @ block, axis=1)
    x, y = axes.T @ np.diag(1.0 / half) @ axes @ block @ [np.cos(heading_rad), -np.sin(heading_rad)]
    return largest(wrap_180_deg(np.rad2deg(np.arctan2(-y, x) - heading_rad)))


def _numbers(circle: IronSwing, hard: IronSwing, soft: dict[float, IronSwing]) -> list[Published]:
    at_45, at_20 = (soft[axis_deg] for axis_deg in AXES_DEG)
    centre_mg = (hard.field_mg.max(axis=0) + hard.field_mg.min(axis=0)) / 2.0
    away_mg = float(np.hypot(*(centre_mg - HARD_IRON_MG[:2])))
    linear_deg = largest(circle.error_deg)
    extremes = (0.3, "36 headings come within 0.1 % of the extremes")
    return [
        claimed_zero("Fig. 9", "departure from a linear sweep, largest", "deg", linear_deg, COUNTS),
        claimed_zero(
            "Fig. 10", "from the circle's centre to the hard iron", "mG", away_mg, extremes
        ),
        *_cycle_numbers(hard, at_45),
        *_left_numbers(hard, at_45, at_20),
    ]


def _left_numbers(hard: IronSwing, at_45: IronSwing, at_20: IronSwing) -> list[Published]:
    within = (0.1, "the extremes of 36 headings, within 0.3 mG")
    note = "printed as a remedy without a condition"
    rows = (
        ("Hard iron", "subtracting the circle's centre", hard.left_deg["min_max"], None, ""),
        ("Soft iron", "rotating by 45 deg, axis at 45 deg", at_45.left_deg[RECIPE], None, ""),
        (
            "Soft iron",
            "rotating by 45 deg, axis at 20 deg",
            at_20.left_deg[RECIPE],
            exact_recipe_deg(20.0),
            note,
        ),
        ("Soft iron", "the fitted ellipse, axis at 20 deg", at_20.left_deg["soft_iron"], None, ""),
    )
    return [
        claimed_zero(
            where,
            f"error left by {remedy}, largest",
            "deg",
            largest(left_deg),
            within,
            exact=exact_deg,
            note=note,
        )
        for where, remedy, left_deg, exact_deg, note in rows
    ]


def _cycle_numbers(hard: IronSwing, soft: IronSwing) -> list[Published]:
    return [
        Published(
            where=where,
            quantity=f"cycles of the {iron} iron's error in one turn",
            unit="",
            published=published,
            ours=float(cycles(one.error_deg)),
            tolerance=0.1,
            reason="a whole number: the largest of its harmonics",
        )
        for where, iron, published, one in (
            ("Fig. 11", "hard", 1.0, hard),
            ("Fig. 13", "soft", 2.0, soft),
        )
    ]


def _draw_planes(circle: IronSwing, hard: IronSwing, soft: IronSwing) -> Figure:
    figure, all_axes = panels(1, 3, height_in=2.5, sharey=True)
    angle_rad = np.deg2rad(EVERYWHERE_DEG)
    for axes, one, title in zip(all_axes, (circle, hard, soft), _TITLES, strict=True):
        draw_exact(axes, HORIZONTAL_MG * np.cos(angle_rad), HORIZONTAL_MG * np.sin(angle_rad))
        draw_measured(axes, one.field_mg[:, 0], one.field_mg[:, 1])
        plane_axes(axes, "x (mG)", "y (mG)" if axes is all_axes[0] else "")
        axes.set_aspect("equal", adjustable="box")
        axes.set_xlim(-260.0, 260.0)
        axes.set_ylim(-260.0, 260.0)
        axes.set_xticks([-200, -100, 0, 100, 200])
        axes.set_yticks([-200, -100, 0, 100, 200])
        axes.set_title(title)
    all_axes[1].plot(*HARD_IRON_MG[:2], marker="+", color=RED, zorder=4.0)
    along = 270.0 * 2.0**-0.5
    all_axes[2].plot([-along, along], [-along, along], color=RED, linewidth=0.8, zorder=2.0)
    return figure


def _draw_errors(hard: IronSwing, soft: dict[float, IronSwing]) -> Figure:
    figure, all_axes = panels(1, 3, height_in=2.7, sharey=True)
    at_45, at_20 = (soft[axis_deg] for axis_deg in AXES_DEG)
    _draw_error(all_axes[0], hard, "min_max", "Fig. 11: hard iron")
    _draw_error(all_axes[1], at_45, "soft_iron", "Fig. 13: soft iron, 45°")
    raw, fitted = _draw_error(all_axes[2], at_20, "soft_iron", "soft iron, 20°")
    recipe = draw_measured(
        all_axes[2],
        at_20.azimuth_deg,
        at_20.left_deg[RECIPE],
        "rotated by 45°",
        color=RED,
        linestyle="-",
        linewidth=0.8,
    )
    error_axis(all_axes[0])
    all_axes[0].set_ylim(-18.0, 18.0)
    figure.legend(handles=[raw, fitted, recipe], loc="outside upper center", ncols=3)
    return figure


def _draw_error(axes: Axes, one: IronSwing, method: str, title: str) -> tuple[Line2D, Line2D]:
    fitted_deg = -exact_deviation_deg(one.deviation.coefficients_deg, EVERYWHERE_DEG)
    draw_ours(axes, EVERYWHERE_DEG, fitted_deg, linewidth=0.9)
    raw = draw_measured(axes, one.azimuth_deg, one.error_deg, "raw, and A to E")
    left_deg = one.left_deg[method]
    left = draw_measured(axes, one.azimuth_deg, left_deg, "calibrated", color=GREEN)
    error_axis(axes, "")
    heading_axis(axes)
    axes.set_title(title)
    return raw, left
