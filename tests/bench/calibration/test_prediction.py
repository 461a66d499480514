from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.prediction import (
    grid_attitudes_deg,
    heading_gradients_deg,
    heading_grid,
    model_jacobian,
    predicted_heading_deg,
)
from bench.calibration.tilt import tilt_compensated_heading_deg
from protocols.angles import wrap_180_deg


def test_grid_holds_24_headings_level_and_at_each_of_four_tilts() -> None:
    grid = grid_attitudes_deg()
    tilts, counts = np.unique(grid[:, 1:], axis=0, return_counts=True)
    assert len(tilts) == 5
    assert counts.tolist() == [24] * 5


def test_one_mg_of_horizontal_field_is_a_milliradian_at_250() -> None:
    across = np.linalg.norm(heading_grid().field_gradient_deg[:24, :2], axis=1)
    assert across == pytest.approx(np.full(24, np.rad2deg(1 / 250.0)), rel=1e-6)


def test_a_tilt_error_turns_the_heading_by_tan_dip() -> None:
    by_tilt = np.linalg.norm(heading_grid().force_gradient_deg[:24, :2], axis=1)
    assert by_tilt == pytest.approx(np.full(24, np.rad2deg(np.tan(np.deg2rad(60.0)))), rel=1e-6)


def test_lengths_of_field_and_force_do_not_turn_the_heading() -> None:
    grid = heading_grid()
    along_field = (grid.field_gradient_deg * grid.field_mg).sum(axis=1)
    along_force = (grid.force_gradient_deg * grid.force_g).sum(axis=1)
    assert along_field == pytest.approx(np.zeros(120), abs=1e-4)
    assert along_force == pytest.approx(np.zeros(120), abs=1e-4)


def test_model_jacobian_is_that_of_a_changed_coefficient() -> None:
    rng = np.random.default_rng(1)
    grid = heading_grid()
    gain = np.eye(3) + rng.normal(0, 0.1, (3, 3))
    raw = grid.field_mg @ gain.T
    jacobian = model_jacobian(grid.field_gradient_deg, grid.field_mg, gain)
    before = tilt_compensated_heading_deg(grid.field_mg, grid.force_g)
    for column in range(12):
        step = np.zeros(12)
        step[column] = 1e-5
        changed = np.linalg.solve(gain + step[:9].reshape(3, 3), (raw - step[9:]).T).T
        turned = wrap_180_deg(tilt_compensated_heading_deg(changed, grid.force_g) - before)
        expected = 1e-5 * jacobian[:, column]
        assert turned == pytest.approx(expected, abs=1e-3 * np.abs(expected).max() + 1e-10)


def test_offset_of_unit_variance_gives_its_error_by_the_horizontal_field() -> None:
    grid = heading_grid()
    jacobian = model_jacobian(grid.field_gradient_deg, grid.field_mg, np.eye(3))[:24, 9:11]
    rms_deg, max_deg = predicted_heading_deg(jacobian, np.eye(2))
    assert rms_deg == pytest.approx(np.rad2deg(1 / 250.0), rel=1e-6)
    assert max_deg == pytest.approx(2.0 * rms_deg, rel=1e-6)


def test_gradients_at_one_attitude_have_three_components_each() -> None:
    field = np.array([[250.0, 0.0, 433.0]])
    by_field, by_force = heading_gradients_deg(field, np.array([[0.0, 0.0, -1.0]]))
    assert by_field[0] == pytest.approx([0.0, -np.rad2deg(1 / 250.0), 0.0], abs=1e-6)
    assert by_force.shape == (1, 3)
