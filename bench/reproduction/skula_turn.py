"""Turns of Skula's experiments, and his scheme: compensate from four of them, judge them all.

His magnetometer is read in one polarity: the set readings alone. They carry the bridge's offset
and the term H Hx/Hk of the field across the film, a second harmonic of H^2/(2 Hk).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.four_position import FourPositionFits, four_position_batch
from bench.calibration.level_kernel import LevelFits
from bench.calibration.min_max import min_max_batch
from bench.calibration.tilt import heading_deg
from bench.reproduction.printed_formulas import PrintedFormula, printed_four_position
from bench.reproduction.turns import headings, turn
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.setup import Setup

POSITIONS: Final = 72
"""Positions of a turn, one every 5 deg."""
SAMPLE_S: Final = 0.01
"""Time of one measuring cycle of the module."""
FIELD_SD_MG: Final = 0.5
"""Noise of one reading that the fits assume."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turn:
    """Readings of a level turn.

    Attributes
    ----------
    azimuth_deg : ndarray, shape (n,)
    field_mg : ndarray, shape (..., n, 2)
        x and y; leading axes are turns of other noise.
    """

    azimuth_deg: NDArray[np.float64]
    field_mg: NDArray[np.float64]


def measured_turn(
    open_laboratory: OpenLaboratory,
    setup: Setup,
    positions: int = POSITIONS,
    *,
    start_deg: float = 0.0,
    of: str = "set_mg",
) -> Turn:
    """Drive the rig once round; field_mg has the shape (positions, 2).

    `of` is what is taken of a reading: "set_mg", or "field_mg" for (set - reset)/2.
    """
    with open_laboratory(setup) as laboratory:
        readings = laboratory.measure(turn(positions, start_deg=start_deg))
    return Turn(azimuth_deg=readings["rig_azimuth_deg"], field_mg=readings[of][:, :2])


def noisy_turns(open_laboratory: OpenLaboratory, setup: Setup, positions: int, turns: int) -> Turn:
    """Dwell at each position for `turns` samples; the k-th of each make the k-th turn.

    Taken is (set - reset)/2 of each sample: what the noise of set and reset has in common would
    be alike in neighbouring samples, and the turns no independent trials.

    Returns
    -------
    Turn
        field_mg of shape (turns, positions, 2).
    """
    azimuths_deg, columns = [], []
    with open_laboratory(setup) as laboratory:
        for pose in headings(np.arange(positions) * (360.0 / positions)):
            laboratory.rig.move_to(pose)
            samples = laboratory.listen((turns + 4) * SAMPLE_S)[:turns]
            azimuths_deg.append(pose.azimuth_deg)
            columns.append((samples["set_mg"] - samples["reset_mg"])[:, :2] / 2.0)
    return Turn(azimuth_deg=np.array(azimuths_deg), field_mg=np.stack(columns, axis=1))


def four_of(field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return, shape (..., n, 4, 2), the four positions of each first one of a turn (..., n, 2)."""
    count = field_mg.shape[-2]
    places = np.arange(count)[:, None] + np.arange(4) * (count // 4)
    return np.asarray(field_mg[..., places % count, :])


def by_four(four_mg: NDArray[np.float64]) -> FourPositionFits:
    """Return the product's fits of positions (..., 4, 2), also of those that it would refuse.

    The scheme takes every first position; the product refuses fours that do not close within
    1 deg, among them those that a second harmonic opens.
    """
    return four_position_batch(four_mg, FIELD_SD_MG, largest_misclosure=1.0)


def by_printed_offset(four_mg: NDArray[np.float64]) -> PrintedFormula:
    """Return the printed offset c = (H1 + H3)/2 of (6) beside the right amplitude."""
    right = by_four(four_mg)
    offset_mg = (four_mg[..., 0, :] + four_mg[..., 2, :]) / 2.0
    return PrintedFormula(offset_mg=offset_mg, matrix=right.matrix)


def mean_error_deg(way: LevelFits | PrintedFormula, judged: Turn) -> NDArray[np.float64]:
    """Return the mean absolute heading error over a turn, shape (...), of each of many fits.

    Not finite where the formula has no value; a refused fit counts as no value.
    """
    return np.asarray(np.abs(errors_deg(way, judged)).mean(axis=-1))


def largest_error_deg(way: LevelFits | PrintedFormula, judged: Turn) -> NDArray[np.float64]:
    """Return the largest heading error over a turn, shape (...); else as `mean_error_deg`."""
    return np.asarray(np.abs(errors_deg(way, judged)).max(axis=-1))


def errors_deg(way: LevelFits | PrintedFormula, judged: Turn) -> NDArray[np.float64]:
    """Return heading errors, shape (..., n), over a turn; not finite as in `mean_error_deg`."""
    corrected = way.corrected_mg(judged.field_mg)
    level_mg = np.concatenate([corrected, np.zeros_like(corrected[..., :1])], axis=-1)
    found_deg = wrap_180_deg(heading_deg(level_mg, 0.0, 0.0) - judged.azimuth_deg)
    if isinstance(way, LevelFits):
        found_deg = np.where((way.cause == 0)[..., None], found_deg, np.nan)
    return found_deg


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FirstPositions:
    """Fig. 2, bottom: mean absolute heading error in degrees by the first position, shape (n,).

    Attributes
    ----------
    printed_deg : ndarray
        (5)-(7) as printed; not finite where they are 0/0.
    printed_offset_deg : ndarray
        With the printed offset of two positions and the right amplitude.
    four_deg : ndarray
        With the mean of the four and the right amplitude: the product's.
    min_max_deg : float
        Of the whole turn by (2)-(3).
    """

    printed_deg: NDArray[np.float64]
    printed_offset_deg: NDArray[np.float64]
    four_deg: NDArray[np.float64]
    min_max_deg: float


def by_first_position(judged: Turn) -> FirstPositions:
    """Compensate a turn from each four of its positions and from its extremes (the scheme)."""
    four_mg = four_of(judged.field_mg)
    return FirstPositions(
        printed_deg=mean_error_deg(printed_four_position(four_mg), judged),
        printed_offset_deg=mean_error_deg(by_printed_offset(four_mg), judged),
        four_deg=mean_error_deg(by_four(four_mg), judged),
        min_max_deg=float(mean_error_deg(min_max_batch(judged.field_mg, FIELD_SD_MG), judged)),
    )
