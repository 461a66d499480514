"""Disturbed poses of the truth-aided fit: found, named and left out, never only weighted down.

The search itself does not look at the noise that the weights assume. Here a pose must first stand
out of that noise, so that an undisturbed run is not searched and keeps its solution as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.disturbed import Disturbance, disturbed_poses, too_many
from bench.calibration.truth_model import RigPoses, rig_poses
from bench.calibration.truth_solver import Solution, solved, started, whitened

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData

MOST_POSES: Final = 500
"""Longer recordings are not of poses: single rows are then not tested."""
ROUNDS: Final = 5
OUTSTANDING: Final = 0.001
"""Chance by which noise alone puts one pose's residuals so far out that the run is searched."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Undisturbed:
    """What is left without the disturbed poses.

    `solution` is None where they are too many, or the rest determines no solution.
    """

    found: tuple[Disturbance, ...]
    data: CalibrationData
    poses: RigPoses
    solution: Solution | None


def outstanding(solution: Solution, poses: RigPoses, rig_sd_deg: float) -> bool:
    """Return whether some pose's residuals stand out of the noise that the weights assume."""
    from scipy.special import chdtri

    count = len(poses.body_from_rig)
    if not solution.converged or count > MOST_POSES:
        return False
    residual = whitened(solution, poses, rig_sd_deg)[0].reshape(count, -1)
    return bool((residual**2).sum(axis=1).max() > chdtri(residual.shape[1], OUTSTANDING))


def undisturbed(data: CalibrationData, poses: RigPoses, solution: Solution) -> Undisturbed:
    """Return the data without those poses that contradict the others, and its solution.

    Every round searches all poses under the solution of those that are left, until the same are
    found again.

    Parameters
    ----------
    data : CalibrationData
        With the rig's angles.
    poses : RigPoses
        Of the data.
    solution : Solution
        Of all poses.
    """
    kept = np.ones(len(data), dtype=bool)
    rest, rest_poses, state = data, poses, solution
    found: tuple[Disturbance, ...] = ()
    for _ in range(ROUNDS):
        found = _found(data, poses, state)
        rows = [one.pose for one in found]
        if set(rows) == set(np.flatnonzero(~kept)):
            break
        if too_many(found, len(data)):
            return Undisturbed(found=found, data=data, poses=poses, solution=None)
        kept = ~np.isin(np.arange(len(data)), rows)
        rest = _rows(data, kept)
        rest_poses = _poses(rest)
        state = _solved(rest, rest_poses)
        if not state.converged:
            return Undisturbed(found=found, data=rest, poses=rest_poses, solution=None)
    return Undisturbed(found=found, data=rest, poses=rest_poses, solution=state)


def _found(data: CalibrationData, poses: RigPoses, solution: Solution) -> tuple[Disturbance, ...]:
    """Return the poses, of all, that contradict the others under a solution of some of them."""
    magnetometer, accelerometer = solution.magnetometer, solution.accelerometer
    every = solution
    if magnetometer is not None:
        every = replace(every, magnetometer=replace(magnetometer, raw=data.field_mg))
    if accelerometer is not None and data.accel_g is not None:
        every = replace(every, accelerometer=replace(accelerometer, raw=data.accel_g))
    residual, jacobian = whitened(every, poses, data.rig_sd_deg)
    count = len(data)
    by_pose = residual.reshape(count, -1)
    return disturbed_poses(by_pose, jacobian.reshape(count, by_pose.shape[1], -1))


def _solved(data: CalibrationData, poses: RigPoses) -> Solution:
    return solved(started(poses, data), poses, data.rig_sd_deg)


def _poses(data: CalibrationData) -> RigPoses:
    assert data.azimuth_deg is not None  # noqa: S101
    assert data.pitch_deg is not None  # noqa: S101
    assert data.roll_deg is not None  # noqa: S101
    return rig_poses(data.azimuth_deg, data.pitch_deg, data.roll_deg)


def _rows(data: CalibrationData, kept: NDArray[np.bool_]) -> CalibrationData:
    assert data.azimuth_deg is not None  # noqa: S101
    assert data.pitch_deg is not None  # noqa: S101
    assert data.roll_deg is not None  # noqa: S101
    return replace(
        data,
        field_mg=data.field_mg[kept],
        accel_g=None if data.accel_g is None else data.accel_g[kept],
        azimuth_deg=data.azimuth_deg[kept],
        pitch_deg=data.pitch_deg[kept],
        roll_deg=data.roll_deg[kept],
        offset_mg=None if data.offset_mg is None else data.offset_mg[kept],
    )
