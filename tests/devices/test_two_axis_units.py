"""Good two-axis units without CAN: what the best calibration of two axes leaves of their heading.

Calibration and heading are the test's own, written apart from bench.calibration and from the
firmware.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from devices.accelerometer import Accelerometer
from devices.bridge import Bridge3, BridgeParameters
from devices.field import EarthField
from devices.magnetics import Magnetics
from devices.unit import draw_unit, peak_reading_mg, unit_stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from devices.unit import ModuleUnit

    Array = NDArray[np.float64]

PART = "CB-AMR2"
UNITS = [draw_unit(f"SN{n:04d}", n, part=PART) for n in range(40)]
NORTH_MG, _, DOWN_MG = EarthField().ned_mg
TILTS = ((30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -30.0))
LEVEL = np.array([(15.0 * k, 0.0, 0.0) for k in range(24)])
TILTED = np.array([(15.0 * k, *tilt) for tilt in TILTS for k in range(24)])
BETWEEN = np.array([7.5, 0.0, 0.0])
"""Headings of the verification lie between those of the calibration."""


@dataclass(frozen=True)
class Readings:
    """Raw x and y of the poses, shape (n, 2), and what a perfect module would show, (n, 3)."""

    field_mg: Array
    force_g: Array
    true_mg: Array
    true_g: Array


def readings(unit: ModuleUnit, poses: Array) -> Readings:
    """Visit poses one after the other: the films remember where they came from."""
    rng = unit_stream(unit.serial, unit.seed, 9)
    bridges = Bridge3(unit.bridges, unit.strap, rng.standard_normal, unit.bits)
    body_from_ned = Rotation.from_euler("ZYX", poses, degrees=True).inv()
    true_mg = body_from_ned.apply([NORTH_MG, 0.0, DOWN_MG])
    true_g = body_from_ned.apply([0.0, 0.0, -1.0])
    rows, forces = [], []
    for body_mg, body_g in zip(true_mg.tolist(), true_g.tolist(), strict=True):
        levels = bridges.levels_mg(unit.magnetics.sensor_field_mg(body_mg), unit.ambient_c)
        rows.append([(levels[axis] - levels[axis + 3]) / 2.0 for axis in (0, 1)])
        forces.append(unit.accelerometer.level_g(body_g, unit.ambient_c)[:2])
    return Readings(np.array(rows), np.array(forces), true_mg, true_g)


def affine(raw: Array, true: Array) -> Array:
    return np.linalg.lstsq(np.column_stack([raw, np.ones(len(raw))]), true, rcond=None)[0]


def apply(raw: Array, coefficients: Array) -> Array:
    return np.column_stack([raw, np.ones(len(raw))]) @ coefficients


def heading_deg(field_mg: Array, force_g: Array, down_mg: float) -> Array:
    """Return the heading from x and y: z from the field along the force, then east = down x m."""
    ax, ay = force_g.T
    az = -np.sqrt(1.0 - ax**2 - ay**2)
    force = np.column_stack([ax, ay, az])
    z = -(down_mg + field_mg[:, 0] * ax + field_mg[:, 1] * ay) / az
    field = np.column_stack([field_mg, z])
    east = np.cross(-force, field)
    north = np.cross(east, -force)
    return np.degrees(np.arctan2(east[:, 0], north[:, 0]))


def errors_deg(unit: ModuleUnit, *, paper: bool = False) -> tuple[Array, Array]:
    """Calibrate and return the errors of other headings: level, and 30 deg tilted.

    x and y are fitted to the truth of the level turn or, as in the paper, centred between their
    largest and smallest readings and scaled; the force is fitted to the truth; the vertical field
    is that which leaves the least error.
    """
    level, tilted = readings(unit, LEVEL), readings(unit, TILTED)
    if paper:
        high, low = level.field_mg.max(axis=0), level.field_mg.min(axis=0)
        gain = 2.0 * NORTH_MG / (high - low)
        mag = np.vstack([np.diag(gain), -gain * (high + low) / 2.0])
    else:
        mag = affine(level.field_mg, level.true_mg[:, :2])
    accel = affine(
        np.concatenate([level.force_g, tilted.force_g]),
        np.concatenate([level.true_g, tilted.true_g])[:, :2],
    )

    def error_deg(made: Readings, poses: Array, down_mg: float) -> Array:
        shown_deg = heading_deg(apply(made.field_mg, mag), apply(made.force_g, accel), down_mg)
        return (shown_deg - poses[:, 0] + 180.0) % 360.0 - 180.0

    downs_mg = DOWN_MG * np.linspace(0.95, 1.05, 41)
    squares = [np.square(error_deg(tilted, TILTED, down_mg)).sum() for down_mg in downs_mg]
    best_mg = float(downs_mg[int(np.argmin(squares))])
    return (
        error_deg(readings(unit, LEVEL + BETWEEN), LEVEL + BETWEEN, best_mg),
        error_deg(readings(unit, TILTED + BETWEEN), TILTED + BETWEEN, best_mg),
    )


def test_two_parts_of_one_serial_are_different_units() -> None:
    three, two = draw_unit("SN0001", 1), draw_unit("SN0001", 1, part=PART)

    assert three.part == "CB-AMR3"
    assert two.part == PART
    assert two == draw_unit("SN0001", 1, part=PART)
    assert replace(two, part=three.part) != three


def test_their_iron_is_as_little_as_the_method_needs() -> None:
    soft = np.array([np.reshape(unit.magnetics.soft_iron, (3, 3)) for unit in UNITS])
    hard = [math.hypot(*unit.magnetics.hard_iron_mg[:2]) / 250.0 for unit in UNITS]
    biases_g = np.array([unit.accelerometer.bias_g for unit in UNITS])

    assert np.abs(soft[:, (0, 1), (0, 1)] - 1.0).max() < 0.031
    assert 0.002 < np.abs(soft[:, (0, 1), (2, 2)]).mean() < 0.006
    assert 0.19 < min(hard) < max(hard) < 0.51
    assert 0.020 < biases_g.std() < 0.038
    assert max(peak_reading_mg(unit, EarthField()) for unit in UNITS) < 720.0


def test_the_best_calibration_of_two_axes_leaves_less_than_a_degree_at_30_deg_of_tilt() -> None:
    worst = np.array([[np.abs(one).max() for one in errors_deg(unit)] for unit in UNITS])
    level_deg, tilted_deg = worst.T

    assert 0.05 < np.median(level_deg) < 0.35
    assert level_deg.max() < 0.6
    assert 0.2 < np.median(tilted_deg) < 0.6
    assert tilted_deg.max() < 1.2


def test_the_papers_normalisation_leaves_less_than_one_level_and_two_tilted() -> None:
    worst = np.array(
        [[np.abs(one).max() for one in errors_deg(unit, paper=True)] for unit in UNITS]
    )

    assert 0.3 < np.median(worst[:, 0]) < 0.8
    assert np.quantile(worst[:, 0], 0.9) < 1.0
    assert worst[:, 1].max() < 2.0


@pytest.mark.parametrize(("leak", "left_deg"), [(0.02, 0.83), (0.05, 2.08)])
def test_vertical_soft_iron_stays_in_the_heading_whatever_two_axes_are_calibrated(
    leak: float, left_deg: float
) -> None:
    soft = (1.0, 0.0, leak, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    unit = _perfect(UNITS[0], soft)

    _, tilted_deg = errors_deg(unit)

    rolled_deg = np.abs(tilted_deg[48:]).max()
    assert rolled_deg == pytest.approx(left_deg, rel=0.02)


def _perfect(unit: ModuleUnit, soft_iron: tuple[float, ...]) -> ModuleUnit:
    one = BridgeParameters(hk_mg=math.inf)
    return replace(
        unit,
        bridges=(one, one, one),
        magnetics=Magnetics(soft_iron=soft_iron),  # type: ignore[arg-type]
        accelerometer=Accelerometer(),
        ambient_c=25.0,
    )
