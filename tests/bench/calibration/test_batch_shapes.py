"""Kernels take no units at all, and readings beyond any sensor, without a warning."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.affine_turn import affine_turn_batch
from bench.calibration.four_position import four_position_batch
from bench.calibration.min_max import min_max_batch
from bench.calibration.soft_iron import soft_iron_batch
from bench.calibration.three_headings import three_headings_batch
from bench.calibration.two_axis import extended_dip_batch
from bench.calibration.two_axis_azimuth import azimuth_error_batch
from bench.calibration.two_axis_batch import two_axis_batch

AZIMUTH_DEG = np.arange(0.0, 360.0, 90.0)
TURN_RAD = np.deg2rad(AZIMUTH_DEG)
TURN_MG = 250.0 * np.column_stack([np.cos(TURN_RAD), -np.sin(TURN_RAD)])
LEVEL_KERNELS = {
    "min_max": lambda turn: min_max_batch(turn, 0.3),
    "four_position": lambda turn: four_position_batch(turn, 0.3),
    "soft_iron": lambda turn: soft_iron_batch(np.repeat(turn, 3, axis=-2), 0.3),
    "three_headings": lambda turn: three_headings_batch(turn, AZIMUTH_DEG, 0.3),
    "affine": lambda turn: affine_turn_batch(turn, AZIMUTH_DEG),
    "two_axis": lambda turn: two_axis_batch(turn, None, turn, AZIMUTH_DEG, 30.0, 0.0),
    "two_axis_aided": lambda turn: two_axis_batch(turn, AZIMUTH_DEG, turn, AZIMUTH_DEG, 30.0, 0.0),
}


@pytest.mark.parametrize("name", LEVEL_KERNELS)
@pytest.mark.parametrize("units", [(0,), (2, 0), (1, 2)])
def test_units_are_the_leading_axes_also_when_there_are_none(name, units):
    fits = LEVEL_KERNELS[name](np.broadcast_to(TURN_MG, (*units, *TURN_MG.shape)))

    assert fits.cause.shape == units


@pytest.mark.parametrize("scale", [1e12, 1e200, 1e300])
def test_a_dip_of_readings_beyond_any_sensor_is_finite(scale):
    x, y = scale * TURN_MG.T

    dip = extended_dip_batch(x, y, 30.0, 0.0, AZIMUTH_DEG)

    assert np.isfinite([dip.dip_deg, dip.dip_sd_deg, dip.residual_rms]).all()


@pytest.mark.parametrize("kernel", [extended_dip_batch, azimuth_error_batch])
def test_a_reading_that_is_no_number_is_refused(kernel):
    more = {"dip_deg": 60.0} if kernel is azimuth_error_batch else {}

    with pytest.raises(ValueError, match="must be finite"):
        kernel([0.1, np.nan], [0.1, 0.2], 30.0, 0.0, [90.0, 270.0], **more)
