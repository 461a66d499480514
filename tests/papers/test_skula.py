"""Skula's experiments on the virtual bench: what they show, and that their numbers can miss."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.cli.laboratory import open_laboratory
from bench.reproduction import skula, skula_numbers
from bench.reproduction.skula_routine import BRIDGE_MG, Routine, measured_routine
from bench.reproduction.skula_study import (
    MODULE,
    ROBOT,
    noise_study,
    positioning_study,
    rig_times,
    third_harmonic_study,
)
from bench.reproduction.skula_turn import (
    FirstPositions,
    Turn,
    by_first_position,
    measured_turn,
    noisy_turns,
)

if TYPE_CHECKING:
    from bench.reproduction.result import Published


@pytest.fixture(scope="module")
def routine() -> Routine:
    return measured_routine(open_laboratory)


@pytest.fixture(scope="module")
def fig_2() -> tuple[Turn, FirstPositions]:
    turn = measured_turn(open_laboratory, skula.FIG_2)
    return turn, by_first_position(turn)


def holding(numbers: list[Published]) -> list[bool]:
    return [number.holds for number in numbers]


def test_set_and_reset_toggle_about_the_offset(routine: Routine) -> None:
    assert (routine.set_mg > BRIDGE_MG).all()
    assert (routine.reset_mg < BRIDGE_MG).all()
    assert routine.offset_mg == pytest.approx(BRIDGE_MG, abs=0.03)
    assert np.ptp(routine.plain_mg) < 0.1
    assert np.ptp(routine.crossed_mg) > 10.0


def test_numbers_of_the_routine_miss_on_another_bridge(routine: Routine) -> None:
    assert all(holding(skula_numbers.routine_numbers(routine)))
    other = replace(
        routine,
        offset_mg=routine.offset_mg + 0.1,
        crossed_mg=routine.crossed_mg + 0.1,
        regressed_mg=routine.regressed_mg + 0.1,
    )
    assert not any(holding(skula_numbers.routine_numbers(other)))


def test_numbers_of_four_positions_miss_on_equal_axes_and_harmonics() -> None:
    turn = measured_turn(open_laboratory, MODULE, start_deg=skula_numbers.BETWEEN_DEG)
    assert all(holding(skula_numbers.four_position_numbers(turn)))
    equal = Turn(azimuth_deg=turn.azimuth_deg, field_mg=turn.field_mg * [0.8, 1.0])
    assert holding(skula_numbers.four_position_numbers(equal)) == [True, False, False]
    harmonic = measured_turn(open_laboratory, replace(MODULE, hk_mg=5000.0), start_deg=2.5)
    assert holding(skula_numbers.four_position_numbers(harmonic)) == [False, False, False]


def test_fig_2_has_no_value_where_the_printed_formula_divides_0_by_0(
    fig_2: tuple[Turn, FirstPositions],
) -> None:
    turn, found = fig_2
    lost = turn.azimuth_deg[~np.isfinite(found.printed_deg)]
    assert lost == pytest.approx([0.0, 90.0, 180.0, 270.0], abs=0.01)
    assert np.isfinite(found.four_deg).all()


def test_fig_2_by_the_mean_of_four_goes_up_and_down_four_times_and_stays_under_min_max(
    fig_2: tuple[Turn, FirstPositions],
) -> None:
    _, found = fig_2
    spectrum = np.abs(np.fft.rfft(found.four_deg - found.four_deg.mean()))
    assert spectrum.argmax() == 4
    assert np.ptp(found.four_deg) > 0.1
    assert found.four_deg.max() < found.min_max_deg + skula_numbers.SAME_DEG


def test_a_third_harmonic_costs_min_max_what_it_costs_the_worst_four_positions() -> None:
    four, min_max_deg = third_harmonic_study(open_laboratory)
    assert min_max_deg == pytest.approx(four.high_deg, abs=0.02)
    assert (np.diff(min_max_deg) > 0.0).all()
    assert four.low_deg[-1] < 0.6 * four.high_deg[-1]


def test_neighbouring_turns_are_independent_trials() -> None:
    turns = noisy_turns(open_laboratory, replace(ROBOT, noise_mg=5.0), 8, 60).field_mg
    residual = turns - turns.mean(axis=0)
    correlation = (residual[1:] * residual[:-1]).mean() / residual.var()
    assert residual.std() == pytest.approx(5.0 * np.sqrt(0.75 / 2.0), rel=0.08)
    assert abs(correlation) < 0.1


def test_four_positions_read_noise_better_than_the_extremes() -> None:
    noise = noise_study(open_laboratory, (2.5,))
    four_deg = noise["four"].middle_deg[0]
    assert four_deg < noise["min_max"].middle_deg[0]
    assert four_deg < noise["extremes"].middle_deg[0]
    # Six readings for one at each position.
    assert noise["averaged"].middle_deg[0] == pytest.approx(four_deg / np.sqrt(6.0), rel=0.15)


def test_four_positions_feel_their_places_and_min_max_hardly() -> None:
    found = positioning_study(open_laboratory)
    assert 0.05 < found.crossing_deg < 1.0
    assert found.four.middle_deg[-1] > 5.0 * found.min_max.middle_deg[-1]
    assert found.refused[0] == 0.0
    assert found.refused[-1] > 0.7


def test_rig_time_is_that_of_the_positions() -> None:
    times = {time.name: time.seconds for time in rig_times(open_laboratory)}
    assert times["four positions"] == times["min-max of 4"] == pytest.approx(9.8, abs=0.5)
    assert times["min-max of 24"] > 3.0 * times["four positions"]
