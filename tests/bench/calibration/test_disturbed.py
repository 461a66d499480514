from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.disturbed import Disturbance, disturbed_poses, too_many
from bench.calibration.sphere_model import sphere_rows
from bench.calibration.truth_model import rig_poses
from bench.calibration.truth_solver import solved, started, whitened

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


def linear(
    seed: int, poses: int = 36, equations: int = 2, unknowns: int = 13
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals of a linear fit with unit noise, at its minimum, and the derivatives."""
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(poses, equations, unknowns))
    return rng.normal(size=(poses, equations)), jacobian


def fitted(readings: NDArray[np.float64], jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    flat = jacobian.reshape(-1, jacobian.shape[2])
    return readings - jacobian @ np.linalg.lstsq(flat, readings.ravel(), rcond=None)[0]


def test_undisturbed_runs_name_no_pose_more_often_than_promised() -> None:
    named = 0
    for seed in range(400):
        noise, jacobian = linear(seed, unknowns=9)
        named += bool(disturbed_poses(fitted(noise, jacobian), jacobian, level=0.05))
    assert 5 <= named <= 36  # 20 of 400, within 3.5 standard deviations


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_scale_of_the_noise_does_not_matter(scale: float) -> None:
    noise, jacobian = linear(1)
    noise[5] += 40.0
    found = disturbed_poses(scale * fitted(noise, jacobian), jacobian)
    assert [one.pose for one in found] == [5]
    assert found[0].significance < 1e-6
    assert found[0].sigmas > 15.0


@pytest.mark.parametrize("seed", range(8))
def test_two_poses_that_hide_each_other_are_both_named(seed: int) -> None:
    noise, jacobian = linear(seed)
    noise[[7, 20]] += 25.0
    found = disturbed_poses(fitted(noise, jacobian), jacobian)
    assert [one.pose for one in found] == [7, 20]


def test_the_size_is_that_under_the_fit_of_the_others() -> None:
    noise, jacobian = linear(4, equations=1, unknowns=3)
    noise[9] += 30.0
    kept = np.arange(36) != 9
    rows = jacobian[kept, 0]
    best = np.linalg.lstsq(rows, noise[kept, 0], rcond=None)[0]
    rest = noise[kept, 0] - rows @ best
    spread = 1.0 + jacobian[9, 0] @ np.linalg.inv(rows.T @ rows) @ jacobian[9, 0]
    expected = abs(noise[9, 0] - jacobian[9, 0] @ best) / np.sqrt(spread * (rest @ rest) / 32.0)
    (found,) = disturbed_poses(fitted(noise, jacobian), jacobian)
    assert found.sigmas == pytest.approx(expected)


def test_a_pose_that_nothing_else_can_contradict_is_not_named() -> None:
    noise, jacobian = linear(2, equations=1, unknowns=3)
    jacobian[:, 0, 2] = 0.0
    jacobian[3, 0, 2] = 1.0  # the only one to see the third parameter
    noise[3] += 1000.0
    assert disturbed_poses(fitted(noise, jacobian), jacobian) == ()


def test_at_most_a_quarter_of_the_poses_is_named() -> None:
    noise, jacobian = linear(3, unknowns=4)
    noise[:20] += 50.0 * np.random.default_rng(1).normal(size=(20, 2))
    assert len(disturbed_poses(fitted(noise, jacobian), jacobian)) <= 9


@pytest.mark.parametrize(
    ("named", "poses", "refused"), [(4, 24, False), (5, 24, True), (11, 72, False), (12, 72, True)]
)
def test_more_than_one_in_six_or_all_that_can_be_named_are_too_many(
    named: int, poses: int, refused: bool
) -> None:
    found = [Disturbance(pose=row, sigmas=9.0, significance=0.0) for row in range(named)]
    assert too_many(found, poses) == refused


def test_too_few_degrees_of_freedom_name_nothing() -> None:
    noise, jacobian = linear(1, poses=8, equations=2, unknowns=13)
    noise[2] += 100.0
    assert disturbed_poses(fitted(noise, jacobian), jacobian) == ()


def test_a_disturbed_pose_of_the_truth_aided_fit_is_named(
    drawn: Callable[..., Any], eol_deg: NDArray[np.float64]
) -> None:
    data = drawn(3).data
    field_mg = data.field_mg.copy()
    field_mg[30] += [4.0, -3.0, 2.0]
    poses = rig_poses(*eol_deg.T)
    start = started(poses, replace(data, field_mg=field_mg))
    residual, jacobian = whitened(solved(start, poses, data.rig_sd_deg), poses, data.rig_sd_deg)
    found = disturbed_poses(residual.reshape(72, 6), jacobian.reshape(72, 6, -1))
    assert [one.pose for one in found] == [30]


def test_a_disturbed_pose_of_the_ellipsoid_is_named() -> None:
    rng = np.random.default_rng(5)
    turned = rng.normal(size=(40, 3))
    points = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    points += 0.002 * rng.normal(size=(40, 3))
    points[11] *= 1.05
    residual, jacobian = sphere_rows(np.eye(3)[None], np.zeros((1, 3)), points[None], np.ones(1))
    found = disturbed_poses(residual[0][:, None], jacobian[0][:, None])
    assert [one.pose for one in found] == [11]
