from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.ranking import heading_error
from bench.calibration.three_headings import fit_three_headings, three_headings_batch

THIRDS = np.array([0.0, 120.0, 240.0])


def data_at(azimuths_deg: np.ndarray, *, index_deg: float = 3.0) -> CalibrationData:
    turn = np.deg2rad(azimuths_deg + index_deg)
    x_mg, y_mg = 40.0 + 250.0 * np.cos(turn), -30.0 - 250.0 * np.sin(turn)
    field_mg = np.column_stack([x_mg, y_mg, np.full_like(turn, 433.0)])
    return CalibrationData(field_mg=field_mg, azimuth_deg=azimuths_deg)


def test_three_headings_show_the_index_error_that_no_turn_shows() -> None:
    data = data_at(THIRDS + 17.0)
    fit = fit_three_headings(data)
    assert fit.offset_mg == pytest.approx([40.0, -30.0, 0.0])
    assert fit.extra["index_deg"] == pytest.approx(3.0)
    assert fit.extra["gain_mg"] == pytest.approx(250.0)
    assert heading_error(data_at(np.arange(0.0, 360.0, 7.0)), fit).max_deg < 1e-6


def test_the_stations_field_azimuth_is_no_index_error() -> None:
    """The station's field stands 10 deg east of the rig's zero."""
    rad = np.deg2rad(10.0)
    station = np.array([250.0 * np.cos(rad), 250.0 * np.sin(rad), 433.0])
    data = replace(data_at(THIRDS, index_deg=-10.0), station_field_mg=station)
    fit = fit_three_headings(data)
    assert fit.extra["index_deg"] == pytest.approx(0.0, abs=1e-9)
    assert heading_error(data, fit).max_deg < 1e-6


def test_first_headings_near_thirds_are_taken_from_a_longer_turn() -> None:
    azimuths = np.array([10.0, 40.0, 135.0, 125.0, 255.0, 250.0, 130.0])
    data = data_at(azimuths)
    field_mg = data.field_mg.copy()
    field_mg[[1, 3, 5, 6]] += 5.0
    fit = fit_three_headings(replace(data, field_mg=field_mg))
    assert fit.samples == 3
    assert fit.offset_mg == pytest.approx([40.0, -30.0, 0.0])


def test_without_thirds_all_headings_without_a_large_gap_are_used() -> None:
    fit = fit_three_headings(data_at(np.array([0.0, 85.0, 170.0, 310.0])))
    assert fit.samples == 4
    assert fit.offset_mg == pytest.approx([40.0, -30.0, 0.0])


@pytest.mark.parametrize("azimuths", [[0.0, 60.0, 120.0], [0.0, 90.0, 180.0], [5.0, 5.0, 5.0]])
def test_headings_on_one_side_are_refused(azimuths: list[float]) -> None:
    fit = fit_three_headings(data_at(np.array(azimuths)))
    assert fit.cause == Cause.POSITIONS_NOT_SQUARE
    assert "no gap of more than 150 deg" in fit.message


def test_without_known_headings_too_few_or_a_still_module_are_refused() -> None:
    data = data_at(THIRDS)
    assert fit_three_headings(replace(data, azimuth_deg=None)).cause == Cause.NO_TRUTH
    assert fit_three_headings(data_at(THIRDS[:2])).cause == Cause.TOO_FEW
    still = replace(data, field_mg=np.tile([100.0, 50.0, 400.0], (3, 1)))
    assert fit_three_headings(still).cause == Cause.NO_TURN


def test_a_wrong_heading_leaves_a_residual() -> None:
    data = data_at(THIRDS)
    wrong = replace(data, azimuth_deg=np.array([0.0, 240.0, 120.0]))
    assert fit_three_headings(wrong).refused


def test_values_that_are_not_finite_are_named() -> None:
    with pytest.raises(ValueError, match="heading_deg must be finite"):
        three_headings_batch(np.zeros((3, 2)), [0.0, np.inf, 240.0], 0.5)
