"""Steps to the Sampson minimum, and what is told of it without eigenvalues."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration import taubin
from bench.calibration.least_squares import inverted, minimised
from bench.calibration.sphere_minimum import (
    covariance_of,
    one_step,
    sphere_minimum,
    sphere_rows_of,
    weighed_minimum,
)
from bench.calibration.sphere_model import (
    folded,
    sphere_rows,
    symmetric,
    symmetric_sphere_rows,
)
from bench.calibration.sphere_prediction import DEFAULT_SINE, predicted_at, predicted_rms_deg
from bench.calibration.taubin import TaubinStarts, normalised, taubin_batch

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHAPE = np.array([[1.1, 0.05, -0.02], [0.05, 0.9, 0.03], [-0.02, 0.03, 1.0]])


def points_of(units: int, count: int, cap: float, noise: float) -> NDArray[np.float64]:
    """Readings of a field of one whose direction x is above `cap`, normalised."""
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(100 * count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions[directions[:, 0] > cap][:count]
    readings = directions @ np.linalg.inv(SHAPE) + [0.3, -0.1, 0.2]
    return normalised(readings + rng.normal(0.0, noise, (units, count, 3))).points


@pytest.mark.parametrize(("cap", "noise"), [(-1.0, 0.001), (-1.0, 0.02), (0.3, 0.001), (0.5, 0.01)])
def test_the_minimum_is_that_of_the_damped_iteration(cap: float, noise: float) -> None:
    points, sd = points_of(60, 36, cap, noise), np.full(60, noise)
    starts = taubin_batch(points)
    best = sphere_minimum(points, starts, sd)
    rows = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    start = np.concatenate([starts.matrix[:, *rows], starts.centre], axis=1)
    slow = minimised(sphere_rows_of(points, sd), start)

    both = best.converged & slow.converged
    assert both.mean() > 0.9
    sd_of = np.sqrt(np.diagonal(inverted(slow.normal).covariance, axis1=1, axis2=2))
    assert (np.abs(best.parameters - slow.parameters) <= 5e-3 * sd_of)[both].all()
    assert best.chi2[both] == pytest.approx(slow.chi2[both], rel=1e-5, abs=1e-5)


def test_a_start_far_away_ends_at_the_same_minimum() -> None:
    points, sd = points_of(20, 36, -1.0, 0.005), np.full(20, 0.005)
    sphere = TaubinStarts(
        matrix=np.tile(0.5 * np.eye(3), (20, 1, 1)),
        centre=np.full((20, 3), 0.4),
        found=np.ones(20, dtype=bool),
        told_apart=np.ones(20, dtype=bool),
    )
    near = sphere_minimum(points, taubin_batch(points), sd)
    far = sphere_minimum(points, sphere, sd)

    assert not one_step(points, sphere, sd)[0].converged.any()
    assert far.converged.all()
    assert far.parameters == pytest.approx(near.parameters, abs=1e-5)


def test_one_step_is_next_to_the_minimum_where_readings_are_all_round() -> None:
    points, sd = points_of(200, 36, -1.0, 0.002), np.full(200, 0.002)
    starts = taubin_batch(points)
    step, covariance, full = one_step(points, starts, sd)
    best = sphere_minimum(points, starts, sd)

    assert full.all()
    assert step.converged.mean() > 0.95
    sd_of = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert (np.abs(step.parameters - best.parameters) <= 0.02 * sd_of)[step.converged].all()


def test_covariance_without_eigenvalues_is_that_with_them() -> None:
    rng = np.random.default_rng(2)
    jacobian = rng.normal(size=(4, 30, 9))
    jacobian[1, :, 3] = jacobian[1, :, 4]
    jacobian[2] *= 10.0 ** np.arange(-3, 6)
    normal = np.swapaxes(jacobian, 1, 2) @ jacobian

    assert covariance_of(normal) == pytest.approx(inverted(normal).covariance, rel=1e-6, abs=1e-12)


def test_points_that_leave_a_parameter_open_have_not_full_rank() -> None:
    points = points_of(3, 36, -1.0, 0.001)
    points[1, 8:] = points[1, 7]
    _, _, full = weighed_minimum(points, taubin_batch(points), np.full(3, 0.001))

    assert full.tolist() == [True, False, True]


def test_rows_of_a_symmetric_matrix_are_the_general_ones_folded() -> None:
    rng = np.random.default_rng(3)
    matrix = symmetric(rng.normal([1, 1, 1, 0, 0, 0], 0.1, (4, 6)))
    centre, points, sd = rng.normal(0, 0.1, (4, 3)), rng.normal(size=(4, 20, 3)), np.full(4, 0.01)
    residual, columns = sphere_rows(matrix, centre, points, sd)
    found = np.moveaxis(symmetric_sphere_rows(matrix, centre, points, sd), 0, -1)

    assert found[..., 9] == pytest.approx(residual)
    assert found[..., :6] == pytest.approx(folded(columns[..., :9]))
    assert found[..., 6:9] == pytest.approx(columns[..., 9:])


def test_rows_are_differentiated_in_full() -> None:
    rng = np.random.default_rng(4)
    points, sd = rng.normal(size=(1, 15, 3)), np.full(1, 0.01)
    rows, unit = sphere_rows_of(points, sd), np.array([0])
    at = np.array([[1.0, 0.9, 1.1, 0.05, -0.03, 0.02, 0.1, -0.2, 0.05]])
    change = 1e-6 * np.eye(9)
    steps = [(rows(at + one, unit)[0] - rows(at - one, unit)[0]) / 2e-6 for one in change]

    assert rows(at, unit)[1] == pytest.approx(np.stack(steps, axis=-1), rel=1e-5, abs=1e-3)


def test_the_predicted_rms_is_that_over_all_attitudes() -> None:
    points, sd = points_of(10, 36, 0.2, 0.003), np.full(10, 0.003)
    best, covariance, _ = weighed_minimum(points, taubin_batch(points), sd)
    matrix = symmetric(best.parameters[:, :6])
    wanted_deg = predicted_at(np.ones(10), np.full(10, DEFAULT_SINE), matrix, covariance)[0]

    assert predicted_rms_deg(DEFAULT_SINE, matrix, covariance) == pytest.approx(
        wanted_deg, rel=1e-9
    )


@pytest.mark.parametrize(("cap", "noise"), [(-1.0, 0.001), (0.3, 0.001), (-1.0, 0.02)])
def test_inverse_iteration_gives_the_nearest_quadric(cap: float, noise: float) -> None:
    _, moments, weights = taubin._moments(points_of(40, 36, cap, noise))
    found, clear = taubin._nearest(moments, weights)
    wanted, told_apart = taubin._by_eigenvectors(moments, weights)

    assert clear.all()
    assert told_apart.all()
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    assert found == pytest.approx(wanted, abs=2e-3 if cap > 0 or noise > 0.01 else 1e-6)


def test_what_inverse_iteration_calls_clear_the_eigenvectors_tell_apart() -> None:
    """Noise from nothing to most of the readings: the trace never promises too much."""
    for noise in (0.003, 0.01, 0.03, 0.1, 0.3):
        _, moments, weights = taubin._moments(points_of(200, 12, 0.2, noise))
        clear = taubin._nearest(moments, weights)[1]
        told_apart = taubin._by_eigenvectors(moments, weights)[1]
        assert not (clear & ~told_apart).any()
