from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.calibration.ellipsoid import fit_ellipsoid
from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.saturation import saturated_axis
from bench.calibration.truth_aided import fit_truth_aided

if TYPE_CHECKING:
    from collections.abc import Callable


def all_round_mg(count: int = 300, noise_mg: float = 0.5) -> np.ndarray:
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return 500.0 * directions + [90.0, -60.0, 30.0] + rng.normal(0.0, noise_mg, (count, 3))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_an_axis_held_at_an_end_is_named_and_refused(axis: int, side: float) -> None:
    held = all_round_mg()
    outwards = side * held[:, axis]
    held[:, axis] = side * np.minimum(outwards, np.quantile(outwards, 0.93))
    assert saturated_axis(held) == "xyz"[axis]
    fit = fit_ellipsoid(CalibrationData(field_mg=held))
    assert (fit.cause, fit.matrix) == (Cause.SATURATED, None)
    assert f"axis {'xyz'[axis]}" in fit.message


def test_poses_of_a_saturated_axis_are_refused_by_the_truth_aided_fit(
    drawn: Callable[..., Any],
) -> None:
    data = drawn(1).data
    held = data.field_mg.copy()
    held[:, 0] = np.minimum(held[:, 0], np.quantile(held[:, 0], 0.8))
    assert fit_truth_aided(replace(data, field_mg=held)).cause == Cause.SATURATED
    assert not fit_truth_aided(data).refused


@pytest.mark.parametrize("step_mg", [0.1, 1.0, 10.0, 40.0])
def test_a_coarse_converter_is_not_saturated(step_mg: float) -> None:
    assert saturated_axis(np.round(all_round_mg(3000) / step_mg) * step_mg) is None


def test_rest_at_the_extreme_of_a_turn_is_not_saturation() -> None:
    rest = np.tile([590.0, -60.0, 30.0], (500, 1)) + np.random.default_rng(1).normal(0, 0.5, 3)
    assert saturated_axis(np.vstack([all_round_mg(), rest])) is None
