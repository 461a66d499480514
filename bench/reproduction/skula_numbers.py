"""Skula's claims beside what the virtual bench gives.

The text prints no number of a measurement and the axes of Fig. 2 are lost, so what can be held
against the bench are its claims: what an equation leaves (nothing), at how many first positions
four positions are as good as min-max (all), and that they take less time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from bench.calibration.four_position import four_position_batch
from bench.reproduction.printed_formulas import printed_four_position
from bench.reproduction.result import Published
from bench.reproduction.skula_routine import BRIDGE_MG
from bench.reproduction.skula_turn import FIELD_SD_MG, four_of, largest_error_deg

if TYPE_CHECKING:
    from bench.reproduction.skula_routine import Routine
    from bench.reproduction.skula_study import Study
    from bench.reproduction.skula_turn import FirstPositions, Turn

BETWEEN_DEG: Final = 2.5
"""Start of a turn of 72 that has no position at which the printed formula is 0/0."""
SAME_DEG: Final = 0.01
"""Difference of mean errors that counts as none."""
WRONG_DEG: Final = 0.5
"""A start angle with a larger error is a wrong one."""
COUNT_DEG: Final = "one count of the converter is worth 0.006 deg"


def routine_numbers(routine: Routine) -> list[Published]:
    """Return what (1) claims, at rest and over a turn."""
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


def four_position_numbers(unequal: Turn) -> list[Published]:
    """Return what (4)-(7) claim of a turn of unequal axes from `BETWEEN_DEG`."""
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


def comparison_numbers(found: FirstPositions, study: Study) -> list[Published]:
    """Return what Section 5 and Fig. 2 claim against min-max."""
    return [*_fig_2_numbers(found), *_study_numbers(study)]


def _fig_2_numbers(found: FirstPositions) -> list[Published]:
    limit_deg = found.min_max_deg + SAME_DEG
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
    ]


def _study_numbers(study: Study) -> list[Published]:
    four = next(time for time in study.times if time.name == "four positions")
    turns = [time for time in study.times if time.name not in ("four positions", "min-max of 4")]
    return [
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
