from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.coverage import sphere_coverage


def test_coverage_of_a_half_sphere_is_about_a_half() -> None:
    points = np.random.default_rng(1).normal(size=(3000, 3))
    half = points[points[:, 2] > 0]
    assert sphere_coverage(half) == pytest.approx(0.5 + 0.17, abs=0.03)
    assert sphere_coverage(points) == 1.0
