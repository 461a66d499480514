"""The tour through planned poses, and the procedure that holds one."""

from __future__ import annotations

from itertools import pairwise, permutations

import numpy as np
import pytest
import yaml

from bench.plan import calibration_attitudes, plan_of, predictions
from bench.planned_tour import HOME, main, shortest_tour, tour_time_s
from bench.pose import Attitude
from bench.procedure_loader import load_procedure
from bench.station import load_station
from bench.travel import azimuth_path_deg


def drawn(count: int, seed: int) -> list[Attitude]:
    rng = np.random.default_rng(seed)
    headings = 360.0 * (np.arange(count) + rng.uniform(0.1, 0.4, count)) / count
    tilts = rng.choice([-30.0, 0.0, 30.0], (count, 2))
    return [
        Attitude(azimuth_deg=float(heading), pitch_deg=float(pitch), roll_deg=float(roll))
        for heading, (pitch, roll) in zip(rng.permutation(headings), tilts, strict=True)
    ]


def wound_deg(attitudes: list[Attitude]) -> list[float]:
    """Return the azimuths that the rig goes to by the shortest way."""
    wound = [HOME.azimuth_deg]
    for attitude in attitudes:
        wound.append(azimuth_path_deg(wound[-1], attitude.azimuth_deg)[-1])
    return wound


def turns_clockwise(attitudes: list[Attitude]) -> bool:
    return all(b >= a - 0.01 for a, b in pairwise(wound_deg(attitudes)))


@pytest.mark.parametrize("seed", range(5))
def test_the_tour_is_the_shortest_of_all_clockwise_orders(seed):
    attitudes = drawn(6, seed)

    tour = shortest_tour(attitudes)

    clockwise = [list(order) for order in permutations(attitudes) if turns_clockwise(list(order))]
    assert tour in clockwise
    assert tour_time_s(tour) == pytest.approx(min(map(tour_time_s, clockwise)))


@pytest.mark.parametrize("count", [8, 9, 12])
def test_the_tour_visits_all_and_is_never_longer_than_the_poses_as_they_stood(count):
    attitudes = drawn(count, count)

    tour = shortest_tour(attitudes)

    assert sorted(map(str, tour)) == sorted(map(str, attitudes))
    by_heading = sorted(attitudes, key=lambda attitude: attitude.azimuth_deg)
    assert tour_time_s(tour) <= min(tour_time_s(attitudes), tour_time_s(by_heading)) + 1e-9
    assert turns_clockwise(tour)
    assert max(wound_deg(tour)) <= 540.0


def test_poses_of_one_heading_are_visited_without_a_turn_between():
    attitudes = [Attitude(azimuth_deg=90.0, pitch_deg=pitch) for pitch in (30.0, -30.0, 0.0)]

    assert set(wound_deg(shortest_tour(attitudes))) == {0.0, 90.0}


def test_headings_that_no_clockwise_turn_below_half_a_turn_reaches_are_refused():
    with pytest.raises(ValueError, match="clockwise turns below 180 deg"):
        shortest_tour([Attitude(azimuth_deg=200.0)])


@pytest.mark.parametrize("count", [0, 15])
def test_a_tour_has_1_to_14_poses(count):
    with pytest.raises(ValueError, match=f"1 to 14 poses; instead received {count}"):
        shortest_tour([Attitude(azimuth_deg=float(index)) for index in range(count)])


def test_the_poses_of_quick_are_those_that_the_planner_prints(capsys):
    assert main(["--poses", "9"]) == 0

    header, *lines = capsys.readouterr().out.splitlines()
    step = next(s for s in load_procedure("quick").steps if s.name == "planned_poses")
    rings = step.model_dump(mode="json", exclude_defaults=True)["rings"]
    document = yaml.safe_load("\n".join(lines))
    assert header.startswith("# 9 poses, 26 degrees of freedom")
    assert len(rings) == len(document) == 9
    again = type(step).model_validate({"kind": "poses", "name": "again", "rings": document})
    assert again.poses() == step.poses()


def test_a_plan_that_cannot_be_is_refused_with_a_sentence(capsys):
    assert main(["--poses", "4"]) == 2

    assert capsys.readouterr().err.startswith("count must be 8 to 36 poses; instead received 4")


def test_quick_turns_one_way_and_takes_less_than_half_of_the_time_of_caruso_24():
    quick, caruso = (
        next(step for step in plan_of(load_procedure(name)).steps if step.kind == "poses")
        for name in ("quick", "caruso_24")
    )

    assert quick.duration_s <= 0.45 * caruso.duration_s
    assert turns_clockwise(calibration_attitudes(load_procedure("quick")))


def test_the_plan_of_quick_foretells_the_error_of_its_judged_method():
    (judged,) = predictions(load_procedure("quick"), load_station("default"), judged_only=True)

    assert judged.cause is None
    assert judged.predicted_heading_max_deg is not None
    assert 0.1 < judged.predicted_heading_max_deg < 0.5
