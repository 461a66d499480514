"""Skula, "New Method for Magnetometer Offset Compensation", 2010, on the virtual bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.four_position import four_position_batch
from bench.reproduction.result import PaperFigure, Reproduction
from bench.reproduction.setup import Setup
from bench.reproduction.skula_figures import (
    draw_first_positions,
    draw_rig_times,
    draw_routine,
    draw_study,
)
from bench.reproduction.skula_numbers import (
    BETWEEN_DEG,
    comparison_numbers,
    four_position_numbers,
    routine_numbers,
)
from bench.reproduction.skula_routine import measured_routine
from bench.reproduction.skula_study import MODULE, measured_study
from bench.reproduction.skula_turn import FIELD_SD_MG, by_first_position, four_of, measured_turn

if TYPE_CHECKING:
    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.skula_routine import Routine
    from bench.reproduction.skula_study import Study
    from bench.reproduction.skula_turn import FirstPositions, Turn

TITLE: Final = 'D. Skula, "New Method for Magnetometer Offset Compensation", 2010'
FIG_2: Final = Setup(
    offset_mg=(60.0, -40.0, 0.0),
    sensitivity=(1.0, 0.8, 1.0),
    hk_mg=5000.0,
    cubic_per_mg2=(0.0, -1e-6, 0.0),
)
"""Unequal offsets and amplitudes; a film of 5 G read in one polarity makes a second harmonic of
2.5 % in both axes, and a cubic error of y a third harmonic of 1.6 %."""


def reproduce(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure and judge the paper's claims, and draw Figs. 1 and 2 and the study beside them."""
    routine = measured_routine(open_laboratory)
    turn = measured_turn(open_laboratory, FIG_2)
    found = by_first_position(turn)
    study = measured_study(open_laboratory)
    unequal = measured_turn(open_laboratory, MODULE, start_deg=BETWEEN_DEG)
    return Reproduction(
        paper="skula",
        title=TITLE,
        numbers=[
            *routine_numbers(routine),
            *four_position_numbers(unequal),
            *comparison_numbers(found, study),
        ],
        figures=[*_paper_figures(routine, turn, found), *_study_figures(study)],
        remarks=_remarks(turn, study),
    )


def _paper_figures(routine: Routine, turn: Turn, found: FirstPositions) -> list[PaperFigure]:
    return [
        PaperFigure(
            name="skula-fig-1",
            title="Fig. 1: set/reset routine",
            caption="Left: x of a module at rest as it sends it, a set and a reset reading in each "
            "cycle of 10 ms; the level between them is V_off of (1). Right: (1) over a turn. With "
            "a film of 8 G and hard iron it carries the cross-axis term -Hx Hy/Hk, which the "
            "paper does not have; the product regresses it out.",
            draw=lambda: draw_routine(routine),
        ),
        PaperFigure(
            name="skula-fig-2",
            title="Fig. 2: min-max and four positions",
            caption="Top: set readings of x and y with unequal offsets and amplitudes (Ay/Ax = "
            "0.8), a second harmonic of 2.5 % (film of 5 G, one polarity) and a third of 1.6 % in "
            "y (cubic error). Below: mean absolute heading error of all 72 readings against the "
            "first of the four positions, by the paper's scheme; the last panel is the middle one "
            "without the printed A. As printed, the formula loses the scale at half of all first "
            "positions and has no value at four. The mean of four never is worse than min-max; "
            "what it still depends on is the third harmonic.",
            draw=lambda: draw_first_positions(turn, found),
        ),
    ]


def _study_figures(study: Study) -> list[PaperFigure]:
    crossing_deg = study.positioning.crossing_deg
    return [
        PaperFigure(
            name="skula-study",
            title="Where four positions beat min-max and where not",
            caption="Medians; bands are 5 to 95 % of 25 noisy turns from all first positions (a), "
            "of 400 placements (d), or all first positions (b, c). a: the extremes stand on two "
            "readings an axis, the four positions on four. b: min-max takes a third harmonic "
            "whole, four positions at 0 and 90 deg only. c: a second harmonic from one "
            "polarity costs both the same, and more only by the printed c. d: a robot turned "
            f"by hand, noise 2 mG; min-max is better from {crossing_deg:.1f} deg of "
            "positioning error, as it does not ask where the module stood.",
            draw=lambda: draw_study(study),
        ),
        PaperFigure(
            name="skula-time",
            title="Error and rig time",
            caption="Time from the first move to the return to zero with dwells of 0.5 s, and the "
            "median error of one reading a position with a noise of 2 mG. The time is saved by "
            "the number of positions; the formula makes the error smaller than that of min-max on "
            "the same four.",
            draw=lambda: draw_rig_times(study.times),
        ),
    ]


def _remarks(turn: Turn, study: Study) -> list[str]:
    refused = int((four_position_batch(four_of(turn.field_mg), FIELD_SD_MG).cause != 0).sum())
    at_three = float(np.interp(3.0, study.positioning.four.setting, study.positioning.refused))
    return [
        "The paper prints no measured number and the scales of Fig. 2 are lost; its claims are "
        "held against the bench, each with what the printed equations leave of it.",
        "Skula's magnetometer is read in one polarity, so his figures take the module's set "
        "readings; noise and positioning take (set - reset)/2. The horizontal field is 250 mG, "
        "the converter has 16 bits, nothing else is wrong with module and rig.",
        "The product's four_position reads (set - reset)/2, which has no second harmonic, and "
        f"refuses fours whose H1 + H3 and H2 + H4 disagree: {refused} of the 72 of Fig. 2 as read "
        f"in one polarity, and {100.0 * at_three:.0f} % of those placed with a standard deviation "
        "of 3 deg. The figures show what it would have got.",
        "Four positions know where the module stands and min-max does not: a quarter turn missed "
        f"by {study.positioning.crossing_deg:.1f} deg costs as much as the noise of 2 mG that "
        "they average better. For a robot turned by hand min-max is the better method, for a rig "
        "four positions are.",
    ]
