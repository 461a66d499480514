"""Caruso (1), (2) and Fig. 4: what tilt costs a heading that takes the module for level."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.tilt import caruso_heading_deg, ned_from_body
from bench.reproduction.caruso_turn import (
    COUNTS,
    EVERYWHERE_DEG,
    HORIZONTAL_MG,
    Swing,
    exact_error_deg,
    section,
)
from bench.reproduction.figures import (
    COLOURS,
    draw_exact,
    draw_measured,
    error_axis,
    heading_axis,
    panels,
)
from bench.reproduction.result import PaperFigure, Published, claimed_zero
from bench.reproduction.setup import Setup
from bench.reproduction.turns import error_deg, largest, turn
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.reproduction.laboratory import Laboratory, OpenLaboratory
    from bench.reproduction.result import Reproduction

DIP_DEG: Final = 40.0
PITCHES_DEG: Final = (5.0, 10.0, 20.0, 30.0)
HEADINGS: Final = 36
BOTH_TILTS_DEG: Final = (30.0, -25.0)
"""Pitch and roll at which (2) is tried as printed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pitched:
    """Swings at one pitch: as if level, and compensated by the accelerometer."""

    raw: Swing
    compensated: Swing


def reproduce_tilt(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure Fig. 4, and (1) and (2) as printed."""
    setup = Setup(horizontal_mg=HORIZONTAL_MG, dip_deg=DIP_DEG)
    with open_laboratory(setup) as laboratory:
        pitched = {pitch_deg: _pitched(laboratory, pitch_deg) for pitch_deg in PITCHES_DEG}
        level = laboratory.measure(turn(12))
        tilted = laboratory.measure(turn(12, *BOTH_TILTS_DEG))
    left_deg = max(largest(one.compensated.error_deg) for one in pitched.values())
    worst = ", ".join(
        f"{largest(one.raw.error_deg):.1f} deg at {pitch_deg:.0f} deg"
        for pitch_deg, one in pitched.items()
    )
    remarks = [
        f"Tilt at dip {DIP_DEG:.0f} deg: a compass that takes itself for level and is pitched errs "
        f"by up to {worst}; compensated by its accelerometer it keeps {left_deg:.3f} deg, the "
        "rounding of the wire.",
    ]
    figure = PaperFigure(
        name="caruso-fig-4",
        title="Fig. 4: heading error due to pitch, dip 40 deg",
        caption=(
            f"Dots: {HEADINGS} headings at each pitch, read over CAN. Left: heading of the x and y "
            "readings as if level. Right: the same readings levelled with the pitch that the "
            "accelerometer gives, on a scale a thousand times finer. Lines: exact. The paper "
            "does not print its pitch angles."
        ),
        draw=lambda: _draw(pitched),
    )
    numbers = [*_fig_4_numbers(pitched), *_numbers(level, tilted)]
    return section(numbers, [figure], remarks)


def _pitched(laboratory: Laboratory, pitch_deg: float) -> Pitched:
    readings = laboratory.measure(turn(HEADINGS, pitch_deg))
    raw, compensated = (
        Swing(
            azimuth_deg=readings["rig_azimuth_deg"],
            error_deg=error_deg(
                compensated_heading_deg(None, readings["field_mg"], accel_g), readings
            ),
        )
        for accel_g in (None, readings["accel_g"])
    )
    return Pitched(raw=raw, compensated=compensated)


def _fig_4_numbers(pitched: dict[float, Pitched]) -> list[Published]:
    return [
        Published(
            where="Fig. 4",
            quantity=f"largest of {HEADINGS} heading errors at a pitch of {pitch_deg:.0f} deg, "
            "uncompensated",
            unit="deg",
            published=math.nan,
            ours=largest(one.raw.error_deg),
            tolerance=COUNTS[0],
            reason=COUNTS[1],
            exact=largest(
                exact_error_deg(DIP_DEG, (pitch_deg, 0.0), (0.0, 0.0))[:: 180 // HEADINGS]
            ),
            note="a figure without pitch angles",
        )
        for pitch_deg, one in pitched.items()
    ]


def printed_2_deg(field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heading by (2), its phi = pitch and theta = roll, with z left down as ours is."""
    x, y, z = field_mg.T
    pitch_deg, roll_deg = BOTH_TILTS_DEG
    return caruso_heading_deg(x, y, z, theta_deg=roll_deg, phi_deg=pitch_deg)


def exact_printed_2_deg() -> float:
    """Return the largest error of (2) with z down at the 12 headings that are measured."""
    azimuth_deg = np.arange(0.0, 360.0, 30.0)
    down = float(np.tan(np.deg2rad(DIP_DEG)))
    body = ned_from_body(azimuth_deg, *BOTH_TILTS_DEG).transpose(0, 2, 1) @ [1.0, 0.0, down]
    return largest(wrap_180_deg(printed_2_deg(body) - azimuth_deg))


def _numbers(level: NDArray[np.void], tilted: NDArray[np.void]) -> list[Published]:
    x, y, _ = level["field_mg"].T
    mirrored_deg = largest(error_deg(np.rad2deg(np.arctan2(y, x)), level))
    z_down_deg = largest(error_deg(printed_2_deg(tilted["field_mg"]), tilted))
    negated_deg = largest(error_deg(printed_2_deg(tilted["field_mg"] * [1.0, 1.0, -1.0]), tilted))
    pitch_deg, roll_deg = BOTH_TILTS_DEG
    attitude = f"pitch {pitch_deg:.0f}, roll {roll_deg:.0f} deg"
    return [
        claimed_zero(
            "(1)",
            "largest error of arctan(Yh/Xh), level",
            "deg",
            mirrored_deg,
            COUNTS,
            exact=180.0,
            note="y to the right mirrors the heading; (3) has the right signs",
        ),
        claimed_zero(
            "(2)",
            f"largest error with z down, {attitude}",
            "deg",
            z_down_deg,
            COUNTS,
            exact=exact_printed_2_deg(),
            note="(2) wants z up",
        ),
        claimed_zero("(2)", f"largest error with z up, {attitude}", "deg", negated_deg, COUNTS),
    ]


def _draw(pitched: dict[float, Pitched]) -> Figure:
    figure, (left, right) = panels(1, 2, height_in=2.7)
    for color, pitch_deg in zip(COLOURS, PITCHES_DEG, strict=False):
        exact = exact_error_deg(DIP_DEG, (pitch_deg, 0.0), (0.0, 0.0))
        draw_exact(left, EVERYWHERE_DEG, exact, color=color)
        one = pitched[pitch_deg]
        for axes, swing in ((left, one.raw), (right, one.compensated)):
            name = f"{pitch_deg:.0f}°"
            draw_measured(axes, swing.azimuth_deg, swing.error_deg, name, color=color)
    for axes in (left, right):
        heading_axis(axes)
        error_axis(axes)
    left.set_ylim(-36.0, 36.0)
    right.set_ylim(-0.036, 0.036)
    left.legend(title="pitch", loc="upper right", handletextpad=0.2, reverse=True)
    left.set_title("x and y as if level")
    right.set_title("levelled by the accelerometer")
    return figure
