"""Where four positions beat min-max and where not, and what both cost in rig time.

Four readings a quarter turn apart are exact for a sine wherever they begin and use all they read;
the extremes of a turn stand on two noisy readings an axis and take in a third harmonic whole. But
min-max does not ask where the module stood, and four positions do. A number of positions that
four divides loses nothing by missing the peaks: it misses those of both axes alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.four_position import four_position_batch
from bench.calibration.min_max import min_max_batch
from bench.pose import Attitude
from bench.reproduction.setup import Setup
from bench.reproduction.skula_turn import (
    FIELD_SD_MG,
    by_first_position,
    by_four,
    four_of,
    mean_error_deg,
    measured_turn,
    noisy_turns,
)
from bench.reproduction.turns import turn

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.reproduction.laboratory import OpenLaboratory

MODULE: Final = Setup(offset_mg=(60.0, -40.0, 0.0), sensitivity=(1.0, 0.8, 1.0))
"""Unequal offsets and amplitudes (Ay/Ax = 0.8) and nothing else wrong."""
ROBOT: Final = Setup(hard_iron_mg=(60.0, -50.0, 0.0), sensitivity=(1.0, 0.8, 1.0))
"""The same offsets as hard iron, for what is read as (set - reset)/2."""
COARSE: Final = 24
"""Positions of a turn for min-max."""
NOISES_MG: Final = (1.0, 2.5, 5.0, 10.0)
"""Noise of one set or reset reading; of half their difference it is 0.6 of that."""
TURNS: Final = 25
"""Noisy turns at each noise."""
CUBICS_PER_MG2: Final = (0.0, -7e-7, -1.4e-6, -2e-6)
HKS_MG: Final = (np.inf, 12000.0, 6000.0, 4000.0)
ERRORS_DEG: Final = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0)
"""Standard deviations of the positions of a robot turned by hand."""
TRIALS: Final = 400
SEED: Final = 20100801
MIN_MAX_POSITIONS: Final = (4, 8, 12, 24)
RIG_NOISE_MG: Final = 3.3
"""Half the difference of set and reset reading then has a noise of 2 mG."""
FINE_NOISE_MG: Final = 7.4
READING_SD_MG: Final = 2.0
"""Noise of the mean of a dwell of five samples that are as noisy as `FINE_NOISE_MG`."""
DWELL_S: Final = 0.5
PERCENTILES: Final = (5.0, 50.0, 95.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """Mean absolute heading errors in degrees at settings of one cause.

    Attributes
    ----------
    setting : ndarray, shape (s,)
        The cause's size.
    low_deg, middle_deg, high_deg : ndarray, shape (s,)
        Smallest, median and largest by first position; or percentiles 5, 50, 95 of trials.
    """

    setting: NDArray[np.float64]
    low_deg: NDArray[np.float64]
    middle_deg: NDArray[np.float64]
    high_deg: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Positioning:
    """Both methods by the positions' standard deviation.

    Attributes
    ----------
    four, min_max : Spread
        Over trials; the setting is the standard deviation in degrees as drawn.
    refused : ndarray, shape (s,)
        Part of the fours that the product refuses as not square.
    crossing_deg : float
        Standard deviation from which min-max has the smaller median.
    """

    four: Spread
    min_max: Spread
    refused: NDArray[np.float64]
    crossing_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RigTime:
    """One way of calibrating on the rig.

    Attributes
    ----------
    name : str
    seconds : float
        Time of the station from the first move to the return to zero.
    error_deg : float
        Median of the mean absolute heading error, of one reading at each position.
    """

    name: str
    seconds: float
    error_deg: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Study:
    """All of it.

    Attributes
    ----------
    noise : dict of str to Spread
        By way: four, averaged, extremes, min_max; see `noise_study`.
    third, second_printed, second_four : Spread
        By first position, over the harmonic's amplitude in percent of the field.
    third_min_max_deg, second_min_max_deg : ndarray, shape (s,)
        Min-max at the same settings.
    positioning : Positioning
    times : list of RigTime
    """

    noise: dict[str, Spread]
    third: Spread
    third_min_max_deg: NDArray[np.float64]
    second_printed: Spread
    second_four: Spread
    second_min_max_deg: NDArray[np.float64]
    positioning: Positioning
    times: list[RigTime]


def measured_study(open_laboratory: OpenLaboratory) -> Study:
    """Measure all of it."""
    third, third_min_max_deg = third_harmonic_study(open_laboratory)
    printed, four, second_min_max_deg = second_harmonic_study(open_laboratory)
    return Study(
        noise=noise_study(open_laboratory),
        third=third,
        third_min_max_deg=third_min_max_deg,
        second_printed=printed,
        second_four=four,
        second_min_max_deg=second_min_max_deg,
        positioning=positioning_study(open_laboratory),
        times=rig_times(open_laboratory),
    )


def noise_study(
    open_laboratory: OpenLaboratory, noises_mg: tuple[float, ...] = NOISES_MG
) -> dict[str, Spread]:
    """Return errors over noise of four positions (`four`) and min-max of 24 (`min_max`).

    Beside them four positions with as many readings as the turn has (`averaged`), and min-max of
    the same four positions (`extremes`). The setting is the noise as measured, in mG.
    """
    judged = measured_turn(open_laboratory, ROBOT)
    rows: dict[str, list[NDArray[np.float64]]] = {
        name: [] for name in ("four", "averaged", "extremes", "min_max")
    }
    share, measured_mg = COARSE // 4, []
    for noise_mg in noises_mg:
        setup = replace(ROBOT, noise_mg=noise_mg)
        turns_mg = noisy_turns(open_laboratory, setup, COARSE, TURNS * share).field_mg
        measured_mg.append(float(turns_mg.std(axis=0).mean()))
        single = turns_mg[::share]
        averaged = turns_mg.reshape(TURNS, share, COARSE, 2).mean(axis=1)
        ways = {
            "four": by_four(four_of(single)),
            "averaged": by_four(four_of(averaged)),
            "extremes": min_max_batch(four_of(single), FIELD_SD_MG),
            "min_max": min_max_batch(single, FIELD_SD_MG),
        }
        for name, way in ways.items():
            rows[name].append(mean_error_deg(way, judged).ravel())
    return {name: _spread(measured_mg, errors) for name, errors in rows.items()}


def third_harmonic_study(open_laboratory: OpenLaboratory) -> tuple[Spread, NDArray[np.float64]]:
    """Return four positions by their first one and min-max, over a cubic error of y.

    The setting is the third harmonic's amplitude, |k| H^2/4, in percent of the field.
    """
    found = [
        by_first_position(
            measured_turn(
                open_laboratory, replace(MODULE, cubic_per_mg2=(0.0, cubic, 0.0)), positions=COARSE
            )
        )
        for cubic in CUBICS_PER_MG2
    ]
    percent = [100.0 * abs(cubic) * MODULE.horizontal_mg**2 / 4.0 for cubic in CUBICS_PER_MG2]
    four = _spread(percent, [one.four_deg for one in found], (0.0, 50.0, 100.0))
    return four, np.array([one.min_max_deg for one in found])


def second_harmonic_study(
    open_laboratory: OpenLaboratory,
) -> tuple[Spread, Spread, NDArray[np.float64]]:
    """Return printed offset and mean of four by first position, and min-max, over H/2Hk."""
    found = [
        by_first_position(
            measured_turn(open_laboratory, replace(MODULE, hk_mg=hk_mg), positions=COARSE)
        )
        for hk_mg in HKS_MG
    ]
    percent = [100.0 * MODULE.horizontal_mg / (2.0 * hk_mg) for hk_mg in HKS_MG]
    ends = (0.0, 50.0, 100.0)
    printed = _spread(percent, [one.printed_offset_deg for one in found], ends)
    four = _spread(percent, [one.four_deg for one in found], ends)
    return printed, four, np.array([one.min_max_deg for one in found])


def positioning_study(open_laboratory: OpenLaboratory) -> Positioning:
    """Return both methods from positions that miss their places, out of a turn of 360.

    The reading nearest to where the robot stood is taken, and each has a noise of 2 mG.
    """
    judged = measured_turn(open_laboratory, ROBOT)
    noisy = replace(ROBOT, noise_mg=FINE_NOISE_MG)
    fine = measured_turn(open_laboratory, noisy, 360, of="field_mg")
    rng = np.random.default_rng(SEED)
    four, min_max, refused, drawn_deg = [], [], [], []
    for error_deg in ERRORS_DEG:
        first = rng.integers(0, 360, size=(TRIALS, 1))
        squares = _stood(first + np.arange(4) * 90, error_deg, rng)
        coarse = _stood(first + np.arange(COARSE) * 15, error_deg, rng)
        four_mg = fine.field_mg[squares % 360]
        four.append(mean_error_deg(by_four(four_mg), judged))
        extremes = min_max_batch(fine.field_mg[coarse % 360], FIELD_SD_MG)
        min_max.append(mean_error_deg(extremes, judged))
        refused.append((four_position_batch(four_mg, READING_SD_MG).cause != 0).mean())
        drawn_deg.append(float((squares - first - np.arange(4) * 90).std()))
    by_squares, by_extremes = _spread(drawn_deg, four), _spread(drawn_deg, min_max)
    difference_deg = by_squares.middle_deg - by_extremes.middle_deg
    return Positioning(
        four=by_squares,
        min_max=by_extremes,
        refused=np.array(refused),
        crossing_deg=_crossing(by_squares.setting, difference_deg),
    )


def rig_times(open_laboratory: OpenLaboratory) -> list[RigTime]:
    """Drive each way's positions with a dwell of 0.5 s and back to zero; time it on the rig."""
    judged = measured_turn(open_laboratory, ROBOT, COARSE)
    setup = replace(ROBOT, noise_mg=RIG_NOISE_MG)
    noisy_mg = noisy_turns(open_laboratory, setup, COARSE, TURNS).field_mg
    seconds = {count: _driven_s(open_laboratory, count) for count in MIN_MAX_POSITIONS}
    four_deg = mean_error_deg(by_four(four_of(noisy_mg)), judged)
    times = [_rig_time("four positions", seconds[4], four_deg)]
    for count in MIN_MAX_POSITIONS:
        step = COARSE // count
        places = np.arange(step)[:, None] + np.arange(count) * step
        fits = min_max_batch(noisy_mg[:, places], FIELD_SD_MG)
        name = f"min-max of {count}"
        times.append(_rig_time(name, seconds[count], mean_error_deg(fits, judged)))
    return times


def _rig_time(name: str, seconds: float, errors_deg: NDArray[np.float64]) -> RigTime:
    return RigTime(name=name, seconds=seconds, error_deg=float(np.nanmedian(errors_deg)))


def _driven_s(open_laboratory: OpenLaboratory, positions: int) -> float:
    with open_laboratory(ROBOT) as laboratory:
        begun_s = laboratory.now_s
        laboratory.measure(turn(positions), dwell_s=DWELL_S)
        laboratory.rig.move_to(Attitude(azimuth_deg=0.0))
        return laboratory.now_s - begun_s


def _stood(
    places_deg: NDArray[np.int64], error_deg: float, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return the whole degrees nearest to where a robot stood that missed its places."""
    missed_deg = error_deg * rng.standard_normal(places_deg.shape)
    return np.asarray(np.rint(places_deg + missed_deg), dtype=np.int64)


def _spread(
    settings: tuple[float, ...] | list[float],
    errors_deg: list[NDArray[np.float64]],
    percentiles: tuple[float, ...] = PERCENTILES,
) -> Spread:
    low, middle, high = np.array([np.nanpercentile(one, percentiles) for one in errors_deg]).T
    return Spread(setting=np.array(settings), low_deg=low, middle_deg=middle, high_deg=high)


def _crossing(settings: NDArray[np.float64], difference: NDArray[np.float64]) -> float:
    """Return the setting at which a difference first rises through 0; infinite if it does not."""
    above = np.flatnonzero((difference[1:] > 0.0) & (difference[:-1] <= 0.0))
    if not len(above):
        return float("inf")
    left, right = above[0], above[0] + 1
    share = -difference[left] / (difference[right] - difference[left])
    return float(settings[left] + share * (settings[right] - settings[left]))
