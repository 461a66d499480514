"""Wrapping of angles, at the places where it goes wrong: 0, 180, 360 and just below."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.angles import circular_mean_deg, wrap_180_deg, wrap_360_deg

angles = st.floats(min_value=-1e6, max_value=1e6)


@given(angles)
def test_headings_lie_in_0_to_360_and_mean_the_same_direction(angle_deg: float) -> None:
    wrapped = float(wrap_360_deg(angle_deg))

    assert 0.0 <= wrapped < 360.0
    assert math.isclose(math.cos(math.radians(wrapped - angle_deg)), 1.0, abs_tol=1e-9)


@given(angles)
def test_differences_lie_in_minus_180_to_180_and_mean_the_same_turn(angle_deg: float) -> None:
    wrapped = float(wrap_180_deg(angle_deg))

    assert -180.0 < wrapped <= 180.0
    assert math.isclose(math.cos(math.radians(wrapped - angle_deg)), 1.0, abs_tol=1e-9)


@pytest.mark.parametrize(
    ("angle_deg", "wrapped_deg"),
    [(0.0, 0.0), (360.0, 0.0), (-360.0, 0.0), (-1e-15, 0.0), (720.5, 0.5), (-90.0, 270.0)],
)
def test_heading_wraps_at_the_boundary(angle_deg: float, wrapped_deg: float) -> None:
    assert float(wrap_360_deg(angle_deg)) == wrapped_deg


@pytest.mark.parametrize(
    ("angle_deg", "wrapped_deg"),
    [(180.0, 180.0), (-180.0, 180.0), (180.5, -179.5), (540.0, 180.0), (-190.0, 170.0)],
)
def test_difference_wraps_at_the_boundary(angle_deg: float, wrapped_deg: float) -> None:
    assert float(wrap_180_deg(angle_deg)) == wrapped_deg


def test_wrapping_keeps_the_shape_and_leaves_the_argument_alone() -> None:
    angle_deg = np.array([[-10.0, 370.0], [180.0, 0.0]])
    before = angle_deg.copy()

    wrapped = wrap_360_deg(angle_deg)

    assert wrapped.tolist() == [[350.0, 10.0], [180.0, 0.0]]
    assert np.array_equal(angle_deg, before)


@given(st.floats(min_value=0.0, max_value=359.99), st.floats(min_value=0.0, max_value=80.0))
def test_mean_of_a_symmetric_pair_is_its_middle(middle_deg: float, half_deg: float) -> None:
    mean_deg = circular_mean_deg([middle_deg - half_deg, middle_deg + half_deg])

    assert abs(float(wrap_180_deg(mean_deg - middle_deg))) < 1e-9
