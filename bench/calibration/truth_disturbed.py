"""Disturbed poses at known rig angles: found, named and left out, never only weighted down.

The search itself does not look at the noise that the weights assume. Here a pose must first stand
out of that noise, so that an undisturbed run is not searched and keeps its solution as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from bench.calibration.disturbed import MOST_POSES, Disturbance, disturbed_poses, search
from bench.calibration.fit import rows_of
from bench.calibration.truth_model import RigPoses, poses_of
from bench.calibration.truth_solver import Solution, solved, started, whitened

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData

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

    Parameters
    ----------
    data : CalibrationData
        With the rig's angles.
    poses : RigPoses
        Of the data.
    solution : Solution
        Of all poses, for both sensors or for one.
    """

    def contradicting(kept: NDArray[np.bool_]) -> tuple[Disturbance, ...] | None:
        state = solution if kept.all() else _solved(rows_of(data, kept), solution)[1]
        return _found(data, poses, state) if state.converged else None

    seen = search(len(data), contradicting)
    if seen.hopeless:
        return Undisturbed(found=seen.found, data=data, poses=poses, solution=None)
    if not seen.found:
        return Undisturbed(found=(), data=data, poses=poses, solution=solution)
    rest = rows_of(data, seen.kept)
    rest_poses, state = _solved(rest, solution)
    left = state if state.converged else None
    return Undisturbed(found=seen.found, data=rest, poses=rest_poses, solution=left)


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


def _solved(data: CalibrationData, like: Solution) -> tuple[RigPoses, Solution]:
    """Return poses and solution of data, of the same sensors as another solution."""
    poses = poses_of(data)
    assert poses is not None  # noqa: S101
    start = started(poses, data, with_magnetometer=like.magnetometer is not None)
    return poses, solved(start, poses, data.rig_sd_deg)
