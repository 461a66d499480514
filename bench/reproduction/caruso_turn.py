"""Turns of the rig and what the experiments of Caruso's paper read in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.tilt import heading_deg, ned_from_body
from bench.reproduction.result import Published, Reproduction
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.reproduction.result import PaperFigure

PAPER: Final = "caruso"
HORIZONTAL_MG: Final = 200.0
"""'The magnetic fields in the X and Y horizontal plane will typically be in the 200 mgauss range.'
"""
COUNT_16_MG: Final = 1600.0 / 2.0**16
"""One count of 16 bits over +-800 mG, the converter of all setups that name no other."""


COUNTS: Final = (0.02, "counts of 0.024 mG are 0.007 deg in 200 mG")
"""Tolerance in deg, with its reason, of a heading that has no other error."""
EVERYWHERE_DEG: Final = np.arange(0.0, 361.0, 2.0)
"""Headings of exact curves."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Swing:
    """Heading errors of a swing: rig azimuth and errors, each shape (n,)."""

    azimuth_deg: NDArray[np.float64]
    error_deg: NDArray[np.float64]


def exact_error_deg(
    dip_deg: float, attitude_deg: tuple[float, float], assumed_deg: tuple[float, float]
) -> NDArray[np.float64]:
    """Return exact errors at all headings of a module at one tilt that is taken for another.

    Parameters
    ----------
    dip_deg : float
    attitude_deg, assumed_deg : (float, float)
        Pitch and roll, true and as the tilt compensation has them.
    """
    down = float(np.tan(np.deg2rad(dip_deg)))
    body = ned_from_body(EVERYWHERE_DEG, *attitude_deg).transpose(0, 2, 1) @ [1.0, 0.0, down]
    return wrap_180_deg(heading_deg(body, *assumed_deg) - EVERYWHERE_DEG)


def section(
    numbers: list[Published], figures: list[PaperFigure], remarks: list[str]
) -> Reproduction:
    """Return one section of the paper."""
    return Reproduction(paper=PAPER, title="", numbers=numbers, figures=figures, remarks=remarks)
