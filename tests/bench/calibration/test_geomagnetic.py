from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.geomagnetic import (
    compare_dips,
    dip_from_latitude_deg,
    earth_field,
    geomagnetic_latitude_deg,
    geomagnetic_pole_deg,
    true_heading_deg,
)

if TYPE_CHECKING:
    from pathlib import Path


NT_PER_MG = 100.0
OFFICIAL_NT = 0.01
OFFICIAL_DEG = 0.001
PRINTED_DEG = 0.005001
"""The file prints angles to two decimals, and the components that they are of to six."""


@pytest.mark.data
def test_the_hundred_official_values_of_wmm2025_are_reproduced(recordings: Path) -> None:
    rows = np.loadtxt(recordings / "wmm" / "WMM2025_FINAL_TEST_VALUES_HIGHPREC.txt")
    assert len(rows) == 100
    for year, alt, lat, lon, printed_decl, printed_dip, h, x, y, z, f, *_ in rows:
        field = earth_field(lat, lon, alt, year)
        ned_nt = np.array(field.ned_mg) * NT_PER_MG
        strengths_nt = np.array([field.horizontal_mg, field.total_mg]) * NT_PER_MG

        assert ned_nt == pytest.approx((x, y, z), abs=OFFICIAL_NT, rel=0.0)
        assert strengths_nt == pytest.approx((h, f), abs=OFFICIAL_NT, rel=0.0)
        official_deg = np.rad2deg([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])
        angles_deg = (field.declination_deg, field.dip_deg)
        assert angles_deg == pytest.approx(official_deg, abs=OFFICIAL_DEG, rel=0.0)
        assert angles_deg == pytest.approx((printed_decl, printed_dip), abs=PRINTED_DEG, rel=0.0)


def test_uncertainty_and_strengths_stand_beside_the_field() -> None:
    field = earth_field(47.0, 11.0, 0.5, 2026.9)
    assert 0.25 < field.declination_sd_deg < 0.5
    assert field.dip_sd_deg == pytest.approx(0.20)
    assert field.total_mg == pytest.approx(np.linalg.norm(field.ned_mg))
    assert field.horizontal_mg == pytest.approx(np.hypot(*field.ned_mg[:2]))


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ((91, 0, 0, 2026), "latitude_deg"),
        ((0, 400, 0, 2026), "longitude_deg"),
        ((0, 0, 900, 2026), "altitude_km"),
        ((0, 0, 0, 2024.9), "year"),
        ((0, 0, 0, 2031.0), "year"),
        ((float("nan"), 0, 0, 2026), "latitude_deg"),
    ],
)
def test_what_is_outside_the_model_is_named(
    arguments: tuple[float, float, float, float], name: str
) -> None:
    with pytest.raises(ValueError, match=f"{name} must be"):
        earth_field(*arguments)


def test_true_heading_adds_east_declination() -> None:
    assert true_heading_deg([10.0, 350.0], -15.0) == pytest.approx([355.0, 335.0])


def test_the_three_dips_of_seoul_stand_side_by_side() -> None:
    """Cho & Park's (25) wants geomagnetic latitude: 47.7, not 56.91; the model has 54.5."""
    seoul = compare_dips(37.5, 127.0, 0.0, 2025.0)
    assert seoul.geographic_deg == pytest.approx(56.91, abs=0.005)
    assert seoul.geomagnetic_deg == pytest.approx(47.7, abs=0.05)
    assert seoul.model_deg == pytest.approx(54.6, abs=0.1)
    assert dip_from_latitude_deg(seoul.geomagnetic_latitude_deg) == seoul.geomagnetic_deg
    assert seoul.model_deg == earth_field(37.5, 127.0, 0.0, 2025.0).dip_deg


def test_the_dip_of_a_dipole_is_that_of_its_field() -> None:
    """Field of a dipole: radial 2 sin(latitude), north cos(latitude)."""
    latitude_deg = np.linspace(-90.0, 90.0, 181)
    latitude = np.deg2rad(latitude_deg)
    expected = np.rad2deg(np.arctan2(2.0 * np.sin(latitude), np.cos(latitude)))
    assert dip_from_latitude_deg(latitude_deg) == pytest.approx(expected)
    assert dip_from_latitude_deg([-90.0, 90.0]) == pytest.approx([-90.0, 90.0])


def test_the_pole_is_that_of_the_model_s_dipole() -> None:
    latitude_deg, longitude_deg = geomagnetic_pole_deg(2025.0)
    assert (latitude_deg, longitude_deg) == pytest.approx((80.8, -72.8), abs=0.05)
    assert geomagnetic_latitude_deg(latitude_deg, longitude_deg, 2025.0) == pytest.approx(90.0)
    assert geomagnetic_latitude_deg(-latitude_deg, longitude_deg + 180.0, 2025.0) == pytest.approx(
        -90.0
    )
    across = geomagnetic_latitude_deg(0.0, longitude_deg + 90.0, 2025.0)
    assert across == pytest.approx(0.0, abs=1e-9)
    assert geomagnetic_pole_deg(2029.0)[0] > latitude_deg


def test_dips_outside_the_model_are_refused() -> None:
    with pytest.raises(ValueError, match="year must be"):
        geomagnetic_pole_deg(2031.0)
    with pytest.raises(ValueError, match="latitude_deg must be"):
        compare_dips(91.0, 0.0, 0.0, 2026.0)
