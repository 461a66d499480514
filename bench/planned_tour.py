"""The order in which the rig visits planned poses: least travel, one side of the azimuth's play.

Every leg turns the azimuth clockwise by less than half a turn, or not at all: the shortest way,
which the rig takes by itself, is then the clockwise one, and the azimuth's backlash has one sign.

Run:  python -m bench.planned_tour --poses 8 --tilt 30

prints the poses of a plan as rings of a procedure, in the order of travel.
"""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.acceptance.site import field_rig_mg
from bench.calibration.pose_plan import SMALLEST, bench_conditions, optimal_poses, poses_for
from bench.errors import BenchError
from bench.pose import Attitude
from bench.station import load_station
from bench.travel import RIG_PROFILE, SAME_DEG, azimuth_path_deg, travel_time_s

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.calibration.pose_plan import PosePlan

MOST_POSES: Final = 14
"""Most poses of which the shortest tour is found."""
HALF_TURN_DEG: Final = 180.0
HOME: Final = Attitude(azimuth_deg=0.0)


def tour_time_s(attitudes: Sequence[Attitude], start: Attitude = HOME) -> float:
    """Return the time of travel from a start through the poses and back, without settling.

    The rig takes the shortest way round, as for poses that name no approach; the start's azimuth
    is the wound one.
    """
    seconds, present = 0.0, start
    for attitude in (*attitudes, start):
        seconds += travel_time_s(present, attitude)
        wound_deg = azimuth_path_deg(present.azimuth_deg, attitude.azimuth_deg)[-1]
        present = Attitude(
            azimuth_deg=wound_deg, pitch_deg=attitude.pitch_deg, roll_deg=attitude.roll_deg
        )
    return seconds


def shortest_tour(attitudes: Sequence[Attitude], start: Attitude = HOME) -> list[Attitude]:
    """Return the poses in the order of the least travel from a start and back to it.

    Every leg to a pose is clockwise, shorter than half a turn, and within the cable's wrap.
    Exact: dynamic programming over the sets of visited poses (Held and Karp 1962).

    Raises
    ------
    ValueError
        If there are no poses, more than 14, or no clockwise order of them.
    """
    count = len(attitudes)
    if not 1 <= count <= MOST_POSES:
        message = f"attitudes must be 1 to {MOST_POSES} poses; instead received {count}"
        raise ValueError(message)
    legs = _Legs(attitudes, start)
    order = legs.best_order()
    if order is None:
        message = (
            "headings must allow an order of clockwise turns below 180 deg within the cable's "
            "wrap; instead received a gap that is wider"
        )
        raise ValueError(message)
    return [attitudes[index] for index in order]


class _Legs:
    """Times and turns between poses; a state is (visited, last pose, whole turns wound)."""

    def __init__(self, attitudes: Sequence[Attitude], start: Attitude) -> None:
        self.count = len(attitudes)
        places = [*attitudes, start]
        self.turn_deg = np.array([[_clockwise_deg(a, b) for b in places] for a in places])
        self.seconds = np.array([[travel_time_s(a, b) for b in places] for a in places])
        allowed = (self.turn_deg < HALF_TURN_DEG - SAME_DEG) & (self.turn_deg >= 0.0)
        self.seconds_on = np.where(allowed, self.seconds, np.inf)
        room_deg = RIG_PROFILE["azimuth"].high_deg - start.azimuth_deg
        from_start_deg = self.turn_deg[-1, :-1]
        self.turns = int(room_deg // 360.0) + 1
        wound_deg = from_start_deg + 360.0 * np.arange(self.turns)[:, None]
        self.reachable = wound_deg <= room_deg
        self.passes = (from_start_deg[:, None] + self.turn_deg[:-1, :-1] > 360.0 - SAME_DEG).astype(
            int
        )

    def best_order(self) -> list[int] | None:
        """Return the order of the least time, or None if there is none."""
        count, turns = self.count, self.turns
        best = np.full((1 << count, turns, count), np.inf)
        before = np.full((1 << count, turns, count, 2), -1)
        for pose in range(count):
            best[1 << pose, 0, pose] = self.seconds_on[-1, pose]
        for visited in range(1, 1 << count):
            for turn in range(turns):
                self._extend(best, before, visited, turn)
        home_s = self.seconds[:-1, -1]
        last = np.unravel_index(np.argmin(best[-1] + home_s), (turns, count))
        if not np.isfinite(best[-1][last]):
            return None
        order, visited = [], (1 << count) - 1
        turn, pose = (int(index) for index in last)
        while pose >= 0:
            order.append(pose)
            turn_before, pose_before = before[visited, turn, pose]
            visited ^= 1 << pose
            turn, pose = int(turn_before), int(pose_before)
        return order[::-1]

    def _extend(
        self, best: NDArray[np.float64], before: NDArray[np.int_], visited: int, turn: int
    ) -> None:
        here_s = best[visited, turn]
        lasts = np.flatnonzero(np.isfinite(here_s))
        left = [pose for pose in range(self.count) if not visited >> pose & 1]
        for last in lasts:
            for pose in left:
                then = turn + self.passes[last, pose]
                if then >= self.turns or not self.reachable[then, pose]:
                    continue
                seconds = here_s[last] + self.seconds_on[last, pose]
                after = visited | 1 << pose
                if seconds < best[after, then, pose] - 1e-9:
                    best[after, then, pose] = seconds
                    before[after, then, pose] = turn, last


def _clockwise_deg(start: Attitude, end: Attitude) -> float:
    """Return the clockwise turn from one heading to another, in [0, 360)."""
    turn_deg = (end.azimuth_deg - start.azimuth_deg) % 360.0
    return 0.0 if turn_deg > 360.0 - SAME_DEG else turn_deg


def planned_poses(plan: PosePlan) -> list[Attitude]:
    """Return the poses of a plan in the order of the shortest tour from level at 0 deg."""
    return shortest_tour(
        [
            Attitude(azimuth_deg=azimuth, pitch_deg=pitch, roll_deg=roll)
            for azimuth, pitch, roll in plan.attitudes_deg.tolist()
        ]
    )


def ring_lines(attitudes: Sequence[Attitude]) -> list[str]:
    """Return the poses as lines of a procedure's `rings`.

    >>> ring_lines([Attitude(azimuth_deg=7.5, roll_deg=-30.0)])
    ['- {count: 1, first: 7.5 deg, roll: -30 deg}']
    """
    lines = []
    for at in attitudes:
        parts = ["count: 1", f"first: {at.azimuth_deg:g} deg"]
        parts += [f"pitch: {at.pitch_deg:g} deg"] if at.pitch_deg else []
        parts += [f"roll: {at.roll_deg:g} deg"] if at.roll_deg else []
        lines.append(f"- {{{', '.join(parts)}}}")
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the rings of a plan; return the exit code, 2 where there is no such plan."""
    parser = argparse.ArgumentParser(
        prog="python -m bench.planned_tour",
        description="Print the poses of least heading error as rings of a procedure.",
    )
    wanted = parser.add_mutually_exclusive_group()
    wanted.add_argument("--poses", type=int, default=SMALLEST, help="number of poses")
    wanted.add_argument("--accuracy", type=float, help="largest predicted heading error, deg")
    parser.add_argument("--tilt", type=float, default=30.0, help="largest tilt, deg")
    parser.add_argument("--station", default="default", help="name or path of a station file")
    options = parser.parse_args(arguments)
    try:
        field_mg = field_rig_mg(load_station(options.station))
        conditions = bench_conditions(field_mg)
        plan = (
            optimal_poses(options.poses, options.tilt, conditions)
            if options.accuracy is None
            else poses_for(options.accuracy, options.tilt, conditions)
        )
        poses = planned_poses(plan)
    except (BenchError, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    lines = [
        f"# {len(poses)} poses, {plan.dof} degrees of freedom, tour {tour_time_s(poses):.1f} s; "
        f"heading error to expect {plan.predicted_rms_deg:.3f} deg RMS, "
        f"{plan.predicted_max_deg:.3f} deg at most",
        *ring_lines(poses),
    ]
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
