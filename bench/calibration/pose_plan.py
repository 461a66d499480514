"""Poses that leave the least heading error: I-optimal designs for the truth-aided fit.

The information of poses adds up (`bound.pose_information`), and the mean square heading error
over the verification grid is tr(A Cov), with A the mean of the outer products of the heading's
derivative by the parameters. A plan starts from poses added one by one, each the best for those
before it; then each in turn is exchanged for the candidate that leaves the least tr(A Cov), until
no exchange helps (Fedorov 1972, "Theory of Optimal Experiments", chapter 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.bound import (
    Conditions,
    HeadingBound,
    grid_rows,
    information_bound,
    pose_information,
)
from bench.calibration.fit import POSE_ACCEL_SD_G, POSE_FIELD_SD_MG, POSE_RIG_SD_DEG
from bench.calibration.prediction import COVERAGE_FACTOR, DEFAULT_FIELD_MG

if TYPE_CHECKING:
    from numpy.typing import NDArray

ESTIMATOR: Final = "truth_aided"
SMALLEST: Final = 8
"""Fewest poses of a plan."""
LARGEST: Final = 36
SMALLEST_DOF: Final = 20
"""Fewest degrees of freedom: 6 readings a pose less 28 parameters."""
READINGS: Final = 6
HEADING_STEP_DEG: Final = 15.0
FIRST_DEG: Final = 7.5
"""First heading of the candidates: they lie between those of the verification grid."""
TILT_STEP_DEG: Final = 15.0
SMALLEST_TILT_DEG: Final = 15.0
LARGEST_TILT_DEG: Final = 60.0
SAME: Final = 1e-6
"""Candidates whose errors differ by less, as a part, are equally good: the first is taken."""
PRIOR: Final = 1e-3
"""Information before the first pose, over that of a mean candidate."""
RIDGE: Final = 1e-9
"""Added information, over that of a mean candidate: poses that leave a parameter open cost most."""
ROUNDS: Final = 30


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosePlan:
    """Chosen poses and what they will leave.

    Attributes
    ----------
    attitudes_deg : ndarray, shape (n, 3)
        Azimuth, pitch and roll, sorted by them; the order of travel is not chosen here.
    predicted_rms_deg, predicted_max_deg : float
        Heading error over the verification grid: RMS, and two standard deviations at the worst
        attitude, of the coefficients alone.
    dof : int
        Readings less parameters.
    """

    attitudes_deg: NDArray[np.float64]
    predicted_rms_deg: float
    predicted_max_deg: float
    dof: int


def bench_conditions(station_field_mg: NDArray[np.float64] | None = None) -> Conditions:
    """Return the conditions that the bench's truth-aided fit assumes for one reading a pose.

    Parameters
    ----------
    station_field_mg : ndarray, shape (3,), optional
        Field in the rig's frame; horizontal 250 mG and dip 60 deg by default.
    """
    return Conditions(
        station_field_mg=DEFAULT_FIELD_MG if station_field_mg is None else station_field_mg,
        field_sd_mg=POSE_FIELD_SD_MG,
        accel_sd_g=POSE_ACCEL_SD_G,
        rig_sd_deg=POSE_RIG_SD_DEG,
    )


def candidate_attitudes_deg(tilt_limit_deg: float) -> NDArray[np.float64]:
    """Return the poses to choose from, shape (k, 3): 24 headings at every tilt of the grid.

    Tilt is the angle between the module's z and the vertical: cos(pitch) cos(roll) is at least
    the cosine of the limit.

    Raises
    ------
    ValueError
        If the limit is not within 15 and 60 deg.

    Examples
    --------
    >>> candidate_attitudes_deg(30.0).shape
    (312, 3)
    """
    if not SMALLEST_TILT_DEG <= tilt_limit_deg <= LARGEST_TILT_DEG:
        message = (
            f"tilt_limit_deg must be within {SMALLEST_TILT_DEG:g} and {LARGEST_TILT_DEG:g} deg; "
            f"instead received {tilt_limit_deg:g} deg"
        )
        raise ValueError(message)
    steps = int(tilt_limit_deg / TILT_STEP_DEG)
    angles_deg = TILT_STEP_DEG * np.arange(-steps, steps + 1)
    headings_deg = np.arange(FIRST_DEG, 360.0, HEADING_STEP_DEG)
    grid = np.stack(np.meshgrid(headings_deg, angles_deg, angles_deg, indexing="ij"), axis=-1)
    all_deg = grid.reshape(-1, 3)
    pitch_rad, roll_rad = np.deg2rad(all_deg[:, 1:]).T
    upright = np.cos(pitch_rad) * np.cos(roll_rad)
    allowed = upright >= np.cos(np.deg2rad(tilt_limit_deg)) - SAME
    return np.asarray(all_deg[allowed])


def optimal_poses(count: int, tilt_limit_deg: float, conditions: Conditions) -> PosePlan:
    """Return a number of different poses with the least heading error that exchange finds.

    The same arguments give the same poses.

    Parameters
    ----------
    count : int
        At least 8, so that 20 degrees of freedom are left.
    tilt_limit_deg : float
        Largest tilt, 15 to 60 deg.
    conditions : Conditions
        Field (with its dip) and noise; the accelerometer's noise must be given.

    Raises
    ------
    ValueError
        If an argument is not within its range.
    """
    if not SMALLEST <= count <= LARGEST:
        message = f"count must be {SMALLEST} to {LARGEST} poses; instead received {count}"
        raise ValueError(message)
    if conditions.accel_sd_g is None:
        message = "conditions must have the accelerometer's noise; instead received None"
        raise ValueError(message)
    candidates_deg = candidate_attitudes_deg(tilt_limit_deg)
    told = pose_information(ESTIMATOR, candidates_deg, conditions)
    search = PoseSearch(told, grid_rows(ESTIMATOR, conditions))
    chosen = np.sort(search.exchanged(search.greedy(count)))
    bound = information_bound(ESTIMATOR, told[chosen].sum(axis=0), conditions)
    return _plan(candidates_deg[chosen], bound)


def poses_for(wanted_max_deg: float, tilt_limit_deg: float, conditions: Conditions) -> PosePlan:
    """Return the plan of the fewest poses whose predicted largest error is at most the wanted.

    Raises
    ------
    ValueError
        If 36 poses do not reach it.
    """
    best = optimal_poses(LARGEST, tilt_limit_deg, conditions)
    if best.predicted_max_deg > wanted_max_deg:
        message = (
            f"wanted accuracy must be at least the {best.predicted_max_deg:.3f} deg that {LARGEST} "
            f"poses reach; instead received {wanted_max_deg:g} deg"
        )
        raise ValueError(message)
    for count in range(SMALLEST, LARGEST):
        plan = optimal_poses(count, tilt_limit_deg, conditions)
        if plan.predicted_max_deg <= wanted_max_deg:
            return plan
    return best


def _plan(attitudes_deg: NDArray[np.float64], bound: HeadingBound) -> PosePlan:
    dof = READINGS * len(attitudes_deg) - bound.unknowns
    assert dof >= SMALLEST_DOF  # noqa: S101
    return PosePlan(
        attitudes_deg=attitudes_deg,
        predicted_rms_deg=float(bound.rms_deg),
        predicted_max_deg=COVERAGE_FACTOR * float(bound.worst_deg),
        dof=dof,
    )


class PoseSearch:
    """Greedy choice and exchange over candidates' information, in well-scaled parameters."""

    def __init__(self, told: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        mean = told.mean(axis=0)
        self._scale = scale = 1.0 / np.sqrt(np.diagonal(mean))
        self._told = told * scale[:, None] * scale
        self._prior = PRIOR * (mean * scale[:, None] * scale)
        scaled = rows * scale
        self._weight = scaled.T @ scaled / len(rows)

    def greedy(self, count: int) -> list[int]:
        """Return candidates, each the best one to add to those before it."""
        chosen: list[int] = []
        for _ in range(count):
            chosen.append(self._best(self._prior + self._told[chosen].sum(axis=0), chosen))
        return chosen

    def exchanged(self, chosen: list[int]) -> list[int]:
        """Exchange candidates one at a time until none helps."""
        for _ in range(ROUNDS):
            before = list(chosen)
            for place in range(len(chosen)):
                others = chosen[:place] + chosen[place + 1 :]
                rest = self._told[others].sum(axis=0)
                found = self._best(rest, others)
                present, best = self._errors(rest, self._told[[chosen[place], found]])
                if best < present * (1.0 - SAME):
                    chosen[place] = found
            if chosen == before:
                break
        return chosen

    def _best(self, rest: NDArray[np.float64], others: list[int]) -> int:
        errors = self._errors(rest, self._told)
        errors[others] = np.inf
        return int(np.flatnonzero(errors <= errors.min() * (1.0 + SAME))[0])

    def errors_with_each(self, visited: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return tr(A Cov) of visited poses, and with each candidate added to them, shape (k,).

        `visited` is what those poses tell, `pose_information`, shape (n, p, p).
        """
        rest = (visited * self._scale[:, None] * self._scale).sum(axis=0)
        present = self._errors(rest, np.zeros((1, *rest.shape)))
        return float(present[0]), self._errors(rest, self._told)

    def _errors(self, rest: NDArray[np.float64], told: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return tr(A Cov) with each candidate added to the rest, shape (k,)."""
        covariance = np.linalg.inv(rest + told + RIDGE * np.eye(told.shape[-1]))
        return np.asarray(np.einsum("ij,nij->n", self._weight, covariance))
