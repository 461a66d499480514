"""Caruso, acceleration effects: the heading of a turning and of a braking vehicle.

In a coordinated turn the force stays along the body's z axis: the accelerometer reads level while
the vehicle banks. Braking reads as a nose that points down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.tilt import attitude_deg
from bench.reproduction.caruso_turn import (
    EVERYWHERE_DEG,
    HORIZONTAL_MG,
    Swing,
    exact_error_deg,
    section,
)
from bench.reproduction.figures import (
    BLUE,
    RED,
    draw_exact,
    draw_measured,
    error_axis,
    heading_axis,
    note,
    panels,
)
from bench.reproduction.result import PaperFigure, Published
from bench.reproduction.setup import Setup
from bench.reproduction.turns import error_deg, largest, turn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.result import Reproduction

DIP_DEG: Final = 60.0
G_MPS2: Final = 9.80665
SPEED_MPS: Final = 51.44
"""100 knots."""
RATE_DPS: Final = 3.0
"""Rate one: half a turn a minute."""
RATE_ONE_BANK_DEG: Final = math.degrees(math.atan(SPEED_MPS * math.radians(RATE_DPS) / G_MPS2))
BANKS_DEG: Final = (5.0, 10.0, RATE_ONE_BANK_DEG, 20.0, 25.0)
BRAKINGS_G: Final = (0.05, 0.1, 0.2, 0.3)
HEADINGS: Final = 30
_TITLES: Final = ("against heading", "coordinated turn", "braking")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Accelerated:
    """A swing under acceleration, and mean pitch and roll that the accelerometer gives."""

    swing: Swing
    pitch_deg: float
    roll_deg: float


def reproduce_acceleration(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure headings in coordinated turns and while braking."""
    turns = {bank: _turning(open_laboratory, bank) for bank in BANKS_DEG}
    brakings = {braking: _braking(open_laboratory, braking) for braking in BRAKINGS_G}
    rate_one = turns[RATE_ONE_BANK_DEG]
    gentle = brakings[0.1]
    remarks = [
        f"Acceleration at dip {DIP_DEG:.0f} deg: in a coordinated turn of {RATE_DPS:.0f} deg/s at "
        f"100 knots the vehicle banks by {RATE_ONE_BANK_DEG:.1f} deg, the accelerometer reads "
        f"{abs(rate_one.roll_deg):.2f} deg of roll, and the heading is up to "
        f"{largest(rate_one.swing.error_deg):.0f} deg wrong while it lasts. Braking with 0.1 g "
        f"reads as {gentle.pitch_deg:.1f} deg of pitch and turns the heading by up to "
        f"{largest(gentle.swing.error_deg):.1f} deg. The paper warns of it without a number.",
    ]
    figure = PaperFigure(
        name="caruso-acceleration",
        title="Acceleration effects: heading in a coordinated turn and while braking",
        caption=(
            f"Dip {DIP_DEG:.0f} deg. The rig holds the bank, the accelerometer feels the turn. "
            f"Left: error against heading, blue banked by {RATE_ONE_BANK_DEG:.1f} deg (3 deg/s at "
            "100 knots), red braking with 0.1 g. Middle and right: largest error against bank and "
            f"deceleration. Dots: measured at {HEADINGS} headings, the heading compensated by the "
            "accelerometer; lines: exact. At a bank of 30 deg, 90 less the dip, the curve ends "
            "at 90 deg: banked more in a turn to the right, the compass goes backwards about east."
        ),
        draw=lambda: _draw(turns, brakings),
    )
    return section(_numbers(rate_one, gentle), [figure], remarks)


def _numbers(rate_one: Accelerated, gentle: Accelerated) -> list[Published]:
    nose_down_deg = -math.degrees(math.atan(0.1))
    rows = (
        (
            f"largest of {HEADINGS} heading errors in a coordinated turn, 3 deg/s at 100 knots",
            largest(rate_one.swing.error_deg),
            exact_error_deg(DIP_DEG, (0.0, RATE_ONE_BANK_DEG), (0.0, 0.0)),
        ),
        (
            f"largest of {HEADINGS} heading errors while braking with 0.1 g",
            largest(gentle.swing.error_deg),
            exact_error_deg(DIP_DEG, (0.0, 0.0), (nose_down_deg, 0.0)),
        ),
    )
    return [
        Published(
            where="Acceleration effects",
            quantity=quantity,
            unit="deg",
            published=math.nan,
            ours=ours_deg,
            tolerance=0.03,
            reason="counts of the field and of the accelerometer, 0.0035 deg of tilt at dip 60",
            exact=largest(exact_deg[:: 180 // HEADINGS]),
            note="the paper warns of it without a number",
        )
        for quantity, ours_deg, exact_deg in rows
    ]


def _turning(open_laboratory: OpenLaboratory, bank_deg: float) -> Accelerated:
    inwards_g = math.tan(math.radians(bank_deg))
    return _measured(open_laboratory, (0.0, inwards_g, 0.0), bank_deg)


def _braking(open_laboratory: OpenLaboratory, braking_g: float) -> Accelerated:
    return _measured(open_laboratory, (-braking_g, 0.0, 0.0), 0.0)


def _measured(
    open_laboratory: OpenLaboratory,
    acceleration_level_g: tuple[float, float, float],
    roll_deg: float,
) -> Accelerated:
    setup = Setup(
        horizontal_mg=HORIZONTAL_MG, dip_deg=DIP_DEG, acceleration_level_g=acceleration_level_g
    )
    with open_laboratory(setup) as laboratory:
        readings = laboratory.measure(turn(HEADINGS, 0.0, roll_deg))
    found_deg = compensated_heading_deg(None, readings["field_mg"], readings["accel_g"])
    pitch_deg, seen_roll_deg = attitude_deg(readings["accel_g"])
    return Accelerated(
        swing=Swing(
            azimuth_deg=readings["rig_azimuth_deg"], error_deg=error_deg(found_deg, readings)
        ),
        pitch_deg=float(pitch_deg.mean()),
        roll_deg=float(seen_roll_deg.mean()),
    )


def _exact_turning_deg(bank_deg: float) -> float:
    return largest(exact_error_deg(DIP_DEG, (0.0, bank_deg), (0.0, 0.0)))


def _exact_braking_deg(braking_g: float) -> float:
    nose_down_deg = -math.degrees(math.atan(braking_g))
    return largest(exact_error_deg(DIP_DEG, (0.0, 0.0), (nose_down_deg, 0.0)))


def _draw(turns: dict[float, Accelerated], brakings: dict[float, Accelerated]) -> Figure:
    figure, (left, middle, right) = panels(1, 3, height_in=2.5)
    shown = (
        (BLUE, turns[RATE_ONE_BANK_DEG], (0.0, RATE_ONE_BANK_DEG), (0.0, 0.0)),
        (RED, brakings[0.1], (0.0, 0.0), (-math.degrees(math.atan(0.1)), 0.0)),
    )
    for color, one, true_deg, assumed_deg in shown:
        exact_deg = exact_error_deg(DIP_DEG, true_deg, assumed_deg)
        draw_exact(left, EVERYWHERE_DEG, exact_deg, color=color)
        draw_measured(left, one.swing.azimuth_deg, one.swing.error_deg, color=color)
    note(left, 182.0, 27.5, "turn", color=BLUE)
    note(left, 45.0, 13.5, "braking", color=RED, ha="center")
    heading_axis(left)
    error_axis(left)
    for axes, title in zip((left, middle, right), _TITLES, strict=True):
        axes.set_title(title)
    for axes, color, measured, end, exact, label in (
        (middle, BLUE, turns, 28.0, _exact_turning_deg, "bank (deg)"),
        (right, RED, brakings, 0.35, _exact_braking_deg, "deceleration (g)"),
    ):
        grid = np.linspace(0.0, end, 40)
        draw_exact(axes, grid, [exact(float(value)) for value in grid], color=color)
        worst_deg = [largest(one.swing.error_deg) for one in measured.values()]
        draw_measured(axes, list(measured), worst_deg, color=color)
        axes.set_xlim(0.0, end)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel(label)
        axes.set_ylabel("largest error (deg)")
    return figure
