"""Formulas of the papers that fail as printed, each beside the one that the product uses.

| paper | printed | used |
|---|---|---|
| Caruso (1) | arctan(Yh/Xh) | atan2(-Yh, Xh) |
| Caruso (2) | z up | z down, or one sign |
| Caruso (3) | no case for Xh > 0, Yh = 0 | atan2 |
| Caruso, declination | add if westerly | true = magnetic + east declination |
| Cho & Park (3), (18) | declination counts west | true = magnetic + east declination |
| Konvalin, bank | angle of the y axis to the horizon | Euler roll |
| Caruso Fig. 14 | 0.5 deg for 0.3 deg of pitch | tan(dip) times the tilt error |
| Cho & Park (17) | arcsin of one axis | atan2 of three |
| Cho & Park (24) | one-argument arctangent | atan2(b, a) |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.geomagnetic import true_heading_deg
from bench.calibration.tilt import (
    attitude_deg,
    caruso_heading_deg,
    heading_deg,
    ned_from_body,
    tilt_compensated_heading_deg,
    two_axis_attitude_deg,
)
from protocols.angles import wrap_180_deg, wrap_360_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

HEADINGS = np.arange(0.0, 360.0, 5.0)
FIELD_NED = np.array([250.0, 0.0, 250.0 * 3.0**0.5])
DOWN = np.array([0.0, 0.0, 1.0])


def body(vector_ned: NDArray[np.float64], pitch: float, roll: float) -> NDArray[np.float64]:
    return np.asarray(ned_from_body(HEADINGS, pitch, roll).transpose(0, 2, 1) @ vector_ned)


def worst_deg(found: NDArray[np.float64]) -> float:
    return float(np.abs(wrap_180_deg(found - HEADINGS)).max())


def caruso_horizontal(
    field: NDArray[np.float64], pitch_deg: float, roll_deg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Caruso (2), his phi = pitch and theta = roll, as printed."""
    phi, theta = np.deg2rad([pitch_deg, roll_deg])
    x, y, z = field.T
    xh = x * np.cos(phi) + y * np.sin(theta) * np.sin(phi) - z * np.cos(theta) * np.sin(phi)
    return xh, y * np.cos(theta) + z * np.sin(theta)


def test_caruso_1_mirrors_the_heading() -> None:
    field = body(FIELD_NED, 0.0, 0.0)
    printed = np.rad2deg(np.arctan2(field[:, 1], field[:, 0]))
    assert worst_deg(printed) == pytest.approx(180.0)
    assert worst_deg(heading_deg(field, 0.0, 0.0)) < 1e-9


@pytest.mark.parametrize(("z", "tilts"), [(1.0, 1.0), (-1.0, -1.0)], ids=["z down", "both"])
def test_caruso_2_with_z_down_or_with_z_and_tilts_negated_errs_by_179_8(
    z: float, tilts: float
) -> None:
    field = body(FIELD_NED, 30.0, 5.0)
    xh, yh = caruso_horizontal(field * [1.0, 1.0, z], tilts * 30.0, tilts * 5.0)
    assert worst_deg(np.rad2deg(np.arctan2(-yh, xh))) == pytest.approx(179.8, abs=0.1)
    x, y, down = field.T
    ours = caruso_heading_deg(x, y, -down, theta_deg=5.0, phi_deg=30.0)
    assert worst_deg(ours) < 1e-9


def test_caruso_2_is_wrong_with_z_down_and_right_with_z_negated_once() -> None:
    field = body(FIELD_NED, 30.0, -25.0)
    xh, yh = caruso_horizontal(field, 30.0, -25.0)
    assert worst_deg(np.rad2deg(np.arctan2(-yh, xh))) > 150.0
    adapted = caruso_horizontal(field * [1, 1, -1], 30.0, -25.0)
    assert worst_deg(np.rad2deg(np.arctan2(-adapted[1], adapted[0]))) < 1e-9
    negated = caruso_horizontal(field, -30.0, 25.0)
    assert worst_deg(np.rad2deg(np.arctan2(-negated[1], negated[0]))) < 1e-9
    both = caruso_horizontal(field * [1, 1, -1], -30.0, 25.0)
    assert worst_deg(np.rad2deg(np.arctan2(-both[1], both[0]))) > 150.0
    assert worst_deg(heading_deg(field, 30.0, -25.0)) < 1e-9


def test_caruso_3_has_no_case_for_north_and_ours_has() -> None:
    def printed(x: float, y: float) -> float | None:
        cases = (
            (x < 0, lambda: 180.0 - np.rad2deg(np.arctan(y / x))),
            (x > 0 and y < 0, lambda: -np.rad2deg(np.arctan(y / x))),
            (x > 0 and y > 0, lambda: 360.0 - np.rad2deg(np.arctan(y / x))),
            (x == 0 and y < 0, lambda: 90.0),
            (x == 0 and y > 0, lambda: 270.0),
        )
        return next((float(value()) for holds, value in cases if holds), None)

    assert printed(1.0, 0.0) is None
    assert heading_deg([1.0, 0.0, 2.0], 0.0, 0.0) == 0.0
    for azimuth in (30.0, 90.0, 135.0, 225.0, 300.0):
        x, y = np.cos(np.deg2rad(azimuth)), -np.sin(np.deg2rad(azimuth))
        assert heading_deg([x, y, 2.0], 0.0, 0.0) == pytest.approx(azimuth)


def test_declination_is_added_when_easterly() -> None:
    magnetic_deg, east_deg = 100.0, 15.0
    printed = magnetic_deg - east_deg
    used = true_heading_deg(magnetic_deg, east_deg)
    # A needle that points 15 deg east of true north: the nose 100 right of it is 115 from north.
    assert used == pytest.approx(115.0)
    assert abs(printed - float(used)) == pytest.approx(2.0 * east_deg)


@pytest.mark.parametrize("east_deg", [-9.0, 4.0])
def test_cho_park_18_subtracts_a_declination_that_counts_west(east_deg: float) -> None:
    magnetic_deg = wrap_360_deg(HEADINGS - east_deg)  # HEADINGS are true here
    west_deg = -east_deg
    assert worst_deg(magnetic_deg - west_deg) < 1e-9
    assert worst_deg(magnetic_deg - east_deg) == pytest.approx(2.0 * abs(east_deg))
    assert worst_deg(true_heading_deg(magnetic_deg, east_deg)) < 1e-9


def test_konvalin_s_bank_is_not_the_roll_of_a_pitched_module() -> None:
    """The y axis to the horizon: arcsin(cos(pitch) sin(roll)), 25.7 for a roll of 30 deg."""
    field = body(FIELD_NED, 30.0, 30.0)
    bank_deg = np.rad2deg(np.arcsin(ned_from_body(0.0, 30.0, 30.0)[2, 1]))
    assert worst_deg(heading_deg(field, 30.0, bank_deg)) == pytest.approx(8.7, abs=0.05)
    assert worst_deg(heading_deg(field, 30.0, 30.0)) < 1e-9


def test_caruso_fig_14_holds_at_dip_59_only() -> None:
    def error_deg(dip_deg: float) -> float:
        ned = np.array([np.cos(np.deg2rad(dip_deg)), 0.0, np.sin(np.deg2rad(dip_deg))])
        return worst_deg(heading_deg(body(ned, 0.3, 0.0), 0.0, 0.0))

    assert error_deg(59.0) == pytest.approx(0.5, abs=0.01)
    assert error_deg(70.0) == pytest.approx(0.3 * np.tan(np.deg2rad(70.0)), abs=0.02)
    assert error_deg(45.0) == pytest.approx(0.3, abs=0.01)


def test_cho_park_17_folds_a_roll_of_100_to_80() -> None:
    force = body(-DOWN, 0.0, 100.0)
    printed = np.rad2deg(np.arcsin(-force[:, 1]))
    assert printed == pytest.approx(np.full(72, 80.0))
    assert attitude_deg(force)[1] == pytest.approx(np.full(72, 100.0))


def test_cho_park_17_with_gravity_for_specific_force_errs_by_177_deg() -> None:
    """Pitch 30, roll -25: both come out with the wrong sign."""
    field, force = body(FIELD_NED, 30.0, -25.0), body(-DOWN, 30.0, -25.0)
    printed = two_axis_attitude_deg(-force)
    assert np.allclose(printed, np.array([[-30.0], [25.0]]))
    assert worst_deg(heading_deg(field, *printed)) == pytest.approx(177.0, abs=0.5)
    assert worst_deg(heading_deg(field, *two_axis_attitude_deg(force))) < 1e-9


def test_gravity_fed_in_for_specific_force_turns_the_heading_round() -> None:
    field, force = body(FIELD_NED, 10.0, -5.0), body(-DOWN, 10.0, -5.0)
    assert worst_deg(tilt_compensated_heading_deg(field, -force)) == pytest.approx(180.0)
    assert worst_deg(tilt_compensated_heading_deg(field, force)) < 1e-9


def test_cho_park_24_with_one_argument_loses_half_the_circle() -> None:
    field = body(FIELD_NED, 15.0, 10.0)
    pitch, roll = np.deg2rad([15.0, 10.0])
    x, y, z = field.T
    a = x * np.cos(pitch) + (y * np.sin(roll) + z * np.cos(roll)) * np.sin(pitch)
    b = z * np.sin(roll) - y * np.cos(roll)
    assert worst_deg(np.rad2deg(np.arctan(b / a))) == pytest.approx(180.0)
    assert worst_deg(np.rad2deg(np.arctan2(b, a))) < 1e-9
    assert worst_deg(heading_deg(field, 15.0, 10.0)) < 1e-9
