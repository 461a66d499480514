"""Skula, "New Method for Magnetometer Offset Compensation", 2010, on the virtual bench.

The text prints no number of a measurement and the axes of Fig. 2 are lost, so what can be held
against the bench are its claims: what an equation leaves (nothing), at how many first positions
four positions are as good as min-max (all), and that they take less time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.four_position import four_position_batch, printed_four_position
from bench.reproduction.result import PaperFigure, Published, Reproduction
from bench.reproduction.setup import Setup
from bench.reproduction.skula_figures import (
    draw_first_positions,
    draw_rig_times,
    draw_routine,
    draw_study,
)
from bench.reproduction.skula_routine import BRIDGE_MG, measured_routine
from bench.reproduction.skula_study import MODULE, measured_study
from bench.reproduction.skula_turn import (
    FIELD_SD_MG,
    by_first_position,
    four_of,
    largest_error_deg,
    measured_turn,
)

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
BETWEEN_DEG: Final = 2.5
"""Start of a turn of 72 that has no position at which the printed formula is 0/0."""
SAME_DEG: Final = 0.01
"""Difference of mean errors that counts as none."""
WRONG_DEG: Final = 0.5
"""A start angle with a larger error is a wrong one."""
COUNT_DEG: Final = "one count of the converter is worth 0.006 deg"


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
            *_routine_numbers(routine),
            *_four_position_numbers(unequal),
            *_comparison_numbers(found, study),
        ],
        figures=_figures(routine, turn, found, study),
        remarks=_remarks(turn, study),
    )


def _routine_numbers(routine: Routine) -> list[Published]:
    return [
        Published(
            where="(1), Fig. 1",
            quantity="V_off less the bridge's offset, module at rest",
            unit="mG",
            published=0.0,
            ours=routine.offset_mg - BRIDGE_MG,
            tolerance=0.03,
            reason="one count of the converter is 0.024 mG",
        ),
        Published(
            where="(1)",
            quantity="mean V_off over a turn less the bridge's offset, film of 8 G, hard iron "
            "100, 80 mG",
            unit="mG",
            published=0.0,
            exact=-1.0,
            ours=float(routine.crossed_mg.mean()) - BRIDGE_MG,
            tolerance=0.03,
            reason="one count of the converter is 0.024 mG",
            note="the half sum carries -Hx Hy/Hk; a turn does not average it out beside hard iron",
        ),
        Published(
            where="(1)",
            quantity="the same by regression on 1 and Hx Hy",
            unit="mG",
            published=0.0,
            ours=routine.regressed_mg - BRIDGE_MG,
            tolerance=0.03,
            reason="one count of the converter is 0.024 mG",
        ),
    ]


def _four_position_numbers(unequal: Turn) -> list[Published]:
    four_mg = four_of(unequal.field_mg)
    ours_deg = largest_error_deg(four_position_batch(four_mg, FIELD_SD_MG), unequal)
    printed_deg = largest_error_deg(printed_four_position(four_mg), unequal)
    return [
        Published(
            where="(4)-(7)",
            quantity="largest heading error after four positions, Ay/Ax = 0.8, from any of 72 "
            "first ones: A = hypot(H1 - H3, H2 - H4)/2, mean of four",
            unit="deg",
            published=0.0,
            ours=float(ours_deg.max()),
            tolerance=0.02,
            reason=COUNT_DEG,
        ),
        Published(
            where="(5)-(7) as printed",
            quantity="the same by arctan and 'or 1, what is bigger'",
            unit="deg",
            published=0.0,
            exact=6.4,
            ours=float(printed_deg.max()),
            tolerance=0.05,
            reason="the exact value is rounded",
            note="A takes the sign of H2 - H4; where only one axis does, the scale is lost",
        ),
        Published(
            where="(5)-(7) as printed",
            quantity="first positions of 72 at which it happens",
            unit="",
            published=0.0,
            exact=36.0,
            ours=float((printed_deg > WRONG_DEG).sum()),
            tolerance=0.5,
            reason="a count",
            note="turn from 2.5 deg: at an angle of exactly 0 or 180 deg the formula is 0/0",
        ),
    ]


def _comparison_numbers(found: FirstPositions, study: Study) -> list[Published]:
    limit_deg = found.min_max_deg + SAME_DEG
    four = next(time for time in study.times if time.name == "four positions")
    turns = [time for time in study.times if time.name not in ("four positions", "min-max of 4")]
    return [
        Published(
            where="Section 5, Fig. 2",
            quantity="first positions of 72 with the same or a better mean error than min-max, "
            "mean of four",
            unit="",
            published=72.0,
            ours=float((found.four_deg <= limit_deg).sum()),
            tolerance=0.5,
            reason="a count; the same is within 0.01 deg",
            note="'The Four-positions method reaches the same or better results': right on a rig "
            "that stands where it should, see the study",
        ),
        Published(
            where="Section 5, Fig. 2",
            quantity="the same, printed c = (H1 + H3)/2 with the right A",
            unit="",
            published=72.0,
            exact=38.0,
            ours=float((found.printed_offset_deg <= limit_deg).sum()),
            tolerance=0.5,
            reason="a count; the same is within 0.01 deg",
            note="a second harmonic acts through the printed c only",
        ),
        Published(
            where="(6)",
            quantity="spread of the mean error over first positions, second harmonic of 3.1 %, "
            "mean of four",
            unit="deg",
            published=0.0,
            ours=float(study.second_four.high_deg[-1] - study.second_four.low_deg[-1]),
            tolerance=0.01,
            reason=COUNT_DEG,
            note=f"{study.second_printed.high_deg[-1] - study.second_printed.low_deg[-1]:.2f} deg "
            "with the printed c",
        ),
        Published(
            where="Section 5",
            quantity="turns of 8, 12 and 24 positions that take longer on the rig",
            unit="",
            published=3.0,
            ours=float(sum(time.seconds > four.seconds for time in turns)),
            tolerance=0.5,
            reason="a count",
            note=f"{four.seconds:.1f} s against "
            + ", ".join(f"{time.seconds:.1f}" for time in turns)
            + " s with dwells of 0.5 s",
        ),
    ]


def _figures(
    routine: Routine, turn: Turn, found: FirstPositions, study: Study
) -> list[PaperFigure]:
    crossing_deg = study.positioning.crossing_deg
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
        PaperFigure(
            name="skula-study",
            title="Where four positions beat min-max and where not",
            caption="Medians; bands are 5 to 95 % of 25 noisy turns from all first positions (a), "
            "of 400 placements (d), or all first positions (b, c). a: the extremes stand on two "
            "readings an axis, the four positions on four. b: min-max takes a third harmonic whole, four positions at "
            "0 and 90 deg only. c: a second harmonic from one polarity costs both the same, and "
            "more only by the printed c. d: a robot turned by hand, noise 2 mG; min-max is better "
            f"from {crossing_deg:.1f} deg of positioning error, as it does not ask where the module "
            "stood.",
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
