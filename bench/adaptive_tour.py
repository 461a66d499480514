"""Poses one after the other until the heading is known well enough: what comes next, and when.

The first poses are the I-optimal ones of the least number, on the shortest tour. Each later one is
chosen by what all visited poses tell: of the candidates that lower the mean square heading error
by at least 0.7 of what the best one would, that with the least travel. The azimuth is always
approached clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.bound import grid_rows, information_bound, pose_information
from bench.calibration.heading_claim import largest_error_deg, pooled_variance
from bench.calibration.pose_plan import (
    ESTIMATOR,
    READINGS,
    PoseSearch,
    bench_conditions,
    candidate_attitudes_deg,
    optimal_poses,
)
from bench.planned_tour import HOME, planned_poses
from bench.pose import Attitude
from bench.travel import azimuth_path_deg, travel_time_s

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.calibration.bound import Conditions

CLOCKWISE: Final = 1
LEAST_SHARE: Final = 0.7
"""What a pose must improve, over what the best one would."""


@dataclass(frozen=True, kw_only=True)
class AdaptiveTour:
    """Candidates and the rule by which one follows another.

    Attributes
    ----------
    least : int
        Number of poses to begin with, 8 to 14.
    tilt_limit_deg : float
        Largest tilt, 15 to 60 deg.
    horizontal_mg, dip_deg : float
        Field for which poses are chosen: the choice is the same at every station, what the fit
        claims is the station's own.
    """

    least: int
    tilt_limit_deg: float
    horizontal_mg: float
    dip_deg: float

    @cached_property
    def conditions(self) -> Conditions:
        """Field and noise for which poses are chosen."""
        down_mg = self.horizontal_mg * np.tan(np.deg2rad(self.dip_deg))
        return bench_conditions(np.array([self.horizontal_mg, 0.0, down_mg]))

    @cached_property
    def candidates(self) -> list[Attitude]:
        """Every pose that the tour may visit."""
        return [
            Attitude(azimuth_deg=azimuth, pitch_deg=pitch, roll_deg=roll)
            for azimuth, pitch, roll in candidate_attitudes_deg(self.tilt_limit_deg).tolist()
        ]

    @cached_property
    def first(self) -> list[Attitude]:
        """The poses to begin with, in the order of the shortest tour."""
        return planned_poses(optimal_poses(self.least, self.tilt_limit_deg, self.conditions))

    @cached_property
    def _search(self) -> PoseSearch:
        told = pose_information(ESTIMATOR, _angles_deg(self.candidates), self.conditions)
        return PoseSearch(told, grid_rows(ESTIMATOR, self.conditions))

    def following(self, visited: Sequence[Attitude], present: Attitude) -> Attitude:
        """Return the pose to visit after others.

        Parameters
        ----------
        visited : sequence of Attitude
            Poses whose readings count so far.
        present : Attitude
            Where the rig is, its azimuth wound.
        """
        told = pose_information(ESTIMATOR, _angles_deg(visited), self.conditions)
        now, with_each = self._search.errors_with_each(told)
        free = [not any(one.is_at(other) for other in visited) for one in self.candidates]
        better = np.where(free, now - with_each, -np.inf)
        enough = np.flatnonzero(better >= LEAST_SHARE * better.max())
        seconds = [travel_time_s(present, self.candidates[index], CLOCKWISE) for index in enough]
        best = min(zip(seconds, -better[enough], enough, strict=True))
        return self.candidates[int(best[2])]

    def foreseen(self, count: int) -> list[Attitude]:
        """Return the poses of a run in which no pose is lost."""
        poses, present = list(self.first), HOME
        for pose in poses:
            present = wound(present, pose)
        while len(poses) < count:
            poses.append(self.following(poses, present))
            present = wound(present, poses[-1])
        return poses

    def claimed_deg(self, poses: Sequence[Attitude]) -> float:
        """Return the largest heading error, at 95 %, to be claimed where the noise is as stated."""
        told = pose_information(ESTIMATOR, _angles_deg(poses), self.conditions)
        bound = information_bound(ESTIMATOR, told.sum(axis=0), self.conditions)
        _, dof = pooled_variance(np.ones(()), READINGS * len(poses) - bound.unknowns)
        rows = grid_rows(ESTIMATOR, self.conditions)
        return float(largest_error_deg(rows, bound.covariance, dof))


@cache
def adaptive_tour(
    least: int, tilt_limit_deg: float, horizontal_mg: float, dip_deg: float
) -> AdaptiveTour:
    """Return the tour of a design; the same one every time, as its search costs half a second."""
    return AdaptiveTour(
        least=least, tilt_limit_deg=tilt_limit_deg, horizontal_mg=horizontal_mg, dip_deg=dip_deg
    )


@cache
def foreseen_poses(tour: AdaptiveTour, most: int) -> tuple[Attitude, ...]:
    """Return the longest run's poses, where none is lost."""
    return tuple(tour.foreseen(most))


@cache
def expected_count(tour: AdaptiveTour, wanted_deg: float, most: int) -> int | None:
    """Return after how many poses the claim is small enough; None if not within the most."""
    poses = foreseen_poses(tour, most)
    counts = range(tour.least, most + 1)
    return next((n for n in counts if tour.claimed_deg(poses[:n]) <= wanted_deg), None)


def wound(present: Attitude, pose: Attitude) -> Attitude:
    """Return a pose with the azimuth to which the rig winds it, clockwise from the present one."""
    path = azimuth_path_deg(present.azimuth_deg, pose.azimuth_deg, CLOCKWISE)
    return Attitude(azimuth_deg=path[-1], pitch_deg=pose.pitch_deg, roll_deg=pose.roll_deg)


def _angles_deg(attitudes: Sequence[Attitude]) -> NDArray[np.float64]:
    return np.array([(one.azimuth_deg, one.pitch_deg, one.roll_deg) for one in attitudes])
