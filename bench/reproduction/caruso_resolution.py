"""Caruso (4): how fine the converter must be for a tenth of a degree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.reproduction.caruso_turn import HORIZONTAL_MG, section
from bench.reproduction.figures import (
    BLUE,
    GREEN,
    RED,
    draw_exact,
    draw_ours,
    note,
    panels,
)
from bench.reproduction.result import PaperFigure, Published
from bench.reproduction.setup import Setup
from bench.reproduction.turns import headings
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.result import Reproduction

SPAN_MG: Final = 1600.0
"""+-800 mG, so that hard iron and the larger field at the equator have room."""
REQUIRED_DEG: Final = 0.1
BITS: Final = (10, 12, 14)
HEADINGS_DEG: Final = np.linspace(0.0, 1.2, 49)
DITHER_MG: Final = 0.02
DWELL_S: Final = 30.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Staircase:
    """Headings of a fine converter's and rig's sweep, shape (n,), and the finest step of y."""

    azimuth_deg: NDArray[np.float64]
    heading_deg: NDArray[np.float64]
    count_mg: float
    step_deg: float


def reproduce_resolution(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure the ratio of (4) and the heading steps of converters."""
    ratio = _ratio(open_laboratory)
    stairs = {bits: _staircase(open_laboratory, bits) for bits in BITS}
    figure = PaperFigure(
        name="caruso-equation-4",
        title="Equation (4): heading steps of a converter over +-800 mG",
        caption=(
            "The rig turns by 0.025 deg from one pose to the next, in a horizontal field of "
            f"{HORIZONTAL_MG:.0f} mG: headings from the counts of 10, 12 and 14 bits. A count is "
            f"{stairs[10].count_mg:.2f} mG of 10 bits and {stairs[12].count_mg:.2f} mG of 12, "
            f"which makes steps of {stairs[12].step_deg:.3f} deg; 0.1 deg needs the 12.163 bits "
            "that the paper gives 'to be more exact'."
        ),
        draw=lambda: _draw(stairs),
    )
    return section(_numbers(ratio, stairs[12]), [figure], [])


def _ratio(open_laboratory: OpenLaboratory) -> float:
    """Return Xh/Yh a tenth of a degree from north, with noise as dither and many readings."""
    setup = Setup(horizontal_mg=HORIZONTAL_MG, dip_deg=0.0, noise_mg=DITHER_MG)
    fields_mg, azimuths_deg = [], []
    with open_laboratory(setup) as laboratory:
        for azimuth_deg in (REQUIRED_DEG, -REQUIRED_DEG):
            reading = laboratory.measure(headings([azimuth_deg]), dwell_s=DWELL_S)[0]
            fields_mg.append(reading["field_mg"])
            azimuths_deg.append(float(wrap_180_deg(reading["rig_azimuth_deg"])))
    away_mg = abs(float(fields_mg[0][1] - fields_mg[1][1])) / 2.0
    north_mg = float(fields_mg[0][0] + fields_mg[1][0]) / 2.0
    turned_deg = abs(azimuths_deg[0] - azimuths_deg[1]) / 2.0
    return north_mg / away_mg * turned_deg / REQUIRED_DEG


def _staircase(open_laboratory: OpenLaboratory, bits: int) -> Staircase:
    setup = Setup(horizontal_mg=HORIZONTAL_MG, dip_deg=0.0, bits=bits)
    with open_laboratory(setup) as laboratory:
        readings = laboratory.measure(headings(HEADINGS_DEG))
    azimuth_deg = wrap_180_deg(readings["rig_azimuth_deg"])
    levels_mg = np.abs(readings["field_mg"][:, 1])
    heights_mg = np.diff(levels_mg)
    edges = np.flatnonzero(heights_mg > 0.0)
    counts = (levels_mg[edges[-1]] - levels_mg[edges[0]]) / heights_mg[edges].min()
    return Staircase(
        azimuth_deg=azimuth_deg,
        heading_deg=wrap_180_deg(compensated_heading_deg(None, readings["field_mg"])),
        count_mg=float(heights_mg[edges].min()),
        step_deg=float((azimuth_deg[edges[-1]] - azimuth_deg[edges[0]]) / counts),
    )


def _numbers(ratio: float, stairs: Staircase) -> list[Published]:
    resolved_mg = HORIZONTAL_MG / ratio
    exact_mg = HORIZONTAL_MG * float(np.tan(np.deg2rad(REQUIRED_DEG)))
    listened = f"{DWELL_S:.0f} s of pairs with {1000.0 * DITHER_MG:.0f} uG of dither each side"
    numbers = [
        Published(
            where="(4)",
            quantity="Xh/Yh at 0.1 deg",
            unit="",
            published=573.0,
            ours=ratio,
            tolerance=1.5,
            reason=f"{listened}: 0.25 %",
        )
    ]
    for quantity, published, span_mg in (
        ("bits needed over 200 mG", 9.0, HORIZONTAL_MG),
        ("bits needed over +-200 mG", 10.0, 2.0 * HORIZONTAL_MG),
        ("bits needed over +-800 mG", 12.163, SPAN_MG),
    ):
        whole = published.is_integer()
        numbers.append(
            Published(
                where="(4)",
                quantity=quantity,
                unit="bit",
                published=published,
                ours=float(np.log2(span_mg / resolved_mg)),
                tolerance=0.004,
                reason="0.25 % of the field change of 0.1 deg",
                exact=float(np.log2(span_mg / exact_mg)) if whole else None,
                note=f"printed as '{published:.0f}+'" if whole else "",
            )
        )
    return [*numbers, *_converter_numbers(stairs)]


def _converter_numbers(stairs: Staircase) -> list[Published]:
    return [
        Published(
            where="(4)",
            quantity="one count of 12 bits over +-800 mG",
            unit="mG",
            published=0.39,
            ours=stairs.count_mg,
            tolerance=0.005,
            reason="the paper's own rounding",
        ),
        Published(
            where="(4)",
            quantity="heading step of 12 bits in 200 mG",
            unit="deg",
            published=0.1,
            ours=stairs.step_deg,
            tolerance=0.004,
            reason="edges found between poses 0.025 deg apart, over ten steps",
            exact=float(np.rad2deg(SPAN_MG / 2**12 / HORIZONTAL_MG)),
            note="0.1 deg wants the 12.163 bits; 12 bits give 0.112",
        ),
    ]


def _draw(stairs: dict[int, Staircase]) -> Figure:
    figure, (axes,) = panels(1, 1, height_in=3.0)
    draw_exact(axes, [0.0, 1.2], [0.0, 1.2])
    names_at_deg = (1.345, 1.25, 1.155)
    for color, y, (bits, one) in zip((RED, BLUE, GREEN), names_at_deg, stairs.items(), strict=True):
        draw_ours(axes, one.azimuth_deg, one.heading_deg, color=color, drawstyle="steps-mid")
        step_deg = np.rad2deg(SPAN_MG / 2**bits / HORIZONTAL_MG)
        name = f"{bits} bits: steps of {step_deg:.2f}°"
        note(axes, 1.22, y, name, color=color)
    axes.set_xlim(0.0, 1.5)
    axes.set_xticks(np.arange(0.0, 1.21, 0.2))
    axes.set_ylim(0.0, 1.5)
    axes.set_xlabel("rig (deg from north)")
    axes.set_ylabel("heading (deg)")
    return figure
