from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.geomagnetic import earth_field, true_heading_deg

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.data
def test_the_hundred_official_values_of_wmm2025_are_reproduced(recordings: Path) -> None:
    rows = np.loadtxt(recordings / "wmm" / "WMM2025_FINAL_TEST_VALUES_HIGHPREC.txt")
    assert len(rows) == 100
    for year, alt, lat, lon, decl, dip, _, x, y, z, *_ in rows:
        field = earth_field(lat, lon, alt, year)
        assert field.ned_mg == pytest.approx((x / 100, y / 100, z / 100), abs=2e-5)
        assert field.declination_deg == pytest.approx(decl, abs=0.006)
        assert field.dip_deg == pytest.approx(dip, abs=0.006)


def test_uncertainty_and_strengths_stand_beside_the_field() -> None:
    field = earth_field(47.0, 11.0, 0.5, 2026.9)
    assert 0.25 < field.declination_sd_deg < 0.5
    assert field.dip_sd_deg == pytest.approx(0.20)
    assert field.total_mg == pytest.approx(np.linalg.norm(field.ned_mg))
    assert field.horizontal_mg == pytest.approx(np.hypot(*field.ned_mg[:2]))
    assert not field.weak
    assert earth_field(85.9, 139.0, 0.0, 2026.0).weak


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
