"""All that the bench measures for Cho & Park: one module for the paper's own experiments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.reproduction.cho_park_blind import PERFECT, BlindMap, map_blind_azimuths
from bench.reproduction.cho_park_site import pitch_of_largest_x_deg, soft_iron_limit_deg
from bench.reproduction.cho_park_table import (
    SWEEPS,
    TWO_AXES,
    Tilting,
    normalisation,
    tilt_at,
    tilt_both_sides,
    twists_deg,
)
from bench.reproduction.cho_park_turn import Turn, turn_at_pitch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.reproduction.laboratory import OpenLaboratory

SHARES: Final = (0.02, 0.05)
"""Parts of the vertical field that soft iron turns into x."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experiments:
    """What was measured.

    Attributes
    ----------
    largest_x_deg : float
        Pitch of the largest x, nose down.
    twist_deg : ndarray, shape (6,)
        How far each azimuth set by hand was off; the estimates do not know it.
    tiltings : list of Tilting
        The six rows of Table 1.
    both_sides : Tilting
        Fig. 4.
    turn : Turn
        Figs. 6 to 8.
    blind : BlindMap
    limits_deg : tuple of float
        Heading error at a roll of 30 deg for each of `SHARES`.
    """

    largest_x_deg: float
    twist_deg: NDArray[np.float64]
    tiltings: list[Tilting]
    both_sides: Tilting
    turn: Turn
    blind: BlindMap
    limits_deg: tuple[float, ...]

    @property
    def adopted_deg(self) -> NDArray[np.float64]:
        """Six rows by the paper's rule."""
        return np.array([tilting.adopted_deg for tilting in self.tiltings])

    @property
    def fitted_deg(self) -> NDArray[np.float64]:
        """Six rows by weighted least squares."""
        return np.array([tilting.fitted_deg for tilting in self.tiltings])


def run_experiments(open_laboratory: OpenLaboratory) -> Experiments:
    """Measure everything; the turn at pitch uses the mean of the six fitted angles."""
    twist_deg = twists_deg(TWO_AXES.seed)
    with open_laboratory(TWO_AXES) as lab:
        normal = normalisation(lab)
        largest_x_deg = pitch_of_largest_x_deg(lab)
        tiltings = [
            tilt_at(lab, normal, sweep, float(twist))
            for sweep, twist in zip(SWEEPS, twist_deg, strict=True)
        ]
        both_sides = tilt_both_sides(lab, normal, float(twist_deg[0]))
        estimated_deg = float(np.mean([tilting.fitted_deg for tilting in tiltings]))
        turn = turn_at_pitch(lab, normal, estimated_deg)
    with open_laboratory(PERFECT) as lab:
        blind = map_blind_azimuths(lab)
    return Experiments(
        largest_x_deg=largest_x_deg,
        twist_deg=twist_deg,
        tiltings=tiltings,
        both_sides=both_sides,
        turn=turn,
        blind=blind,
        limits_deg=tuple(soft_iron_limit_deg(open_laboratory, share) for share in SHARES),
    )
