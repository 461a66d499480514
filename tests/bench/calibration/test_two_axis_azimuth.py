"""An azimuth error that all readings share is told from a sensor turned about z, by the tilts."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.tilt import ned_from_body
from bench.calibration.two_axis_azimuth import azimuth_error_batch

TILTS_DEG = np.array(
    [
        (azimuth, pitch, roll)
        for pitch, roll in ((30, 0), (-30, 0), (0, 30), (0, -30))
        for azimuth in range(0, 360, 90)
    ],
    dtype=float,
)


def aligned(
    error_deg: float,
    *,
    dip_deg: float = 60.0,
    shares: tuple[float, float] = (0.0, 0.0),
    angles_deg: np.ndarray = TILTS_DEG,
) -> np.ndarray:
    """Return x and y, over the horizontal field, that a level turn aligned to wrong azimuths."""
    down = np.tan(np.deg2rad(dip_deg))
    azimuth_deg, pitch_deg, roll_deg = angles_deg.T
    rotations = ned_from_body(azimuth_deg + error_deg, pitch_deg, roll_deg)
    body = np.einsum("nji,j->ni", rotations, np.array([1.0, 0.0, down]))
    seen = body[:, :2] + np.outer(body[:, 2] - down, shares)  # the turn takes out the level part
    e = np.deg2rad(error_deg)
    return seen @ np.array([[np.cos(e), -np.sin(e)], [np.sin(e), np.cos(e)]]).T


def found(readings: np.ndarray, *, dip_deg: float = 60.0, angles_deg: np.ndarray = TILTS_DEG):
    azimuth_deg, pitch_deg, roll_deg = angles_deg.T
    x, y = readings[..., 0], readings[..., 1]
    return azimuth_error_batch(x, y, pitch_deg, roll_deg, azimuth_deg, dip_deg=dip_deg)


@pytest.mark.parametrize("dip_deg", [60.0, -60.0, 48.72, 20.0])
@pytest.mark.parametrize("shares", [(0.0, 0.0), (0.02, -0.01)])
def test_the_error_is_found_on_both_hemispheres_and_beside_vertical_soft_iron(dip_deg, shares):
    for error_deg in (0.0, 0.5, -0.5):
        readings = aligned(error_deg, dip_deg=dip_deg, shares=shares)
        assert found(readings, dip_deg=dip_deg)[0] == pytest.approx(error_deg, abs=0.02)


def test_its_spread_over_units_is_the_standard_deviation_that_it_names():
    noise = np.random.default_rng(5).normal(0.0, 0.0014, (2000, len(TILTS_DEG), 2))

    error_deg, sd_deg = found(aligned(0.3) + noise)

    assert error_deg.shape == sd_deg.shape == (2000,)
    assert error_deg.std() == pytest.approx(sd_deg[0], rel=0.06)
    assert error_deg.mean() == pytest.approx(0.3, abs=0.01)
    alone = found(aligned(0.3) + noise[7])
    assert np.array([error_deg[7], sd_deg[7]]) == pytest.approx(np.array(alone))


@pytest.mark.parametrize(
    ("angles_deg", "dip_deg"),
    [(TILTS_DEG * [1, 0, 0], 60.0), (TILTS_DEG[:1], 60.0), (TILTS_DEG[:0], 60.0)],
)
def test_what_the_tilts_do_not_show_has_no_finite_deviation(angles_deg, dip_deg):
    error_deg, sd_deg = found(
        aligned(0.5, dip_deg=dip_deg, angles_deg=angles_deg), dip_deg=dip_deg, angles_deg=angles_deg
    )

    assert error_deg == 0.0
    assert np.isinf(sd_deg)
