"""Claims of Skula's paper that fail as printed, each beside what the product does; exact data.

| paper | printed | used |
|---|---|---|
| (5)-(7) | arctan, 'or 1, what is bigger' | A = hypot(H1 - H3, H2 - H4)/2 |
| (6) | c = (H1 + H3)/2 | mean of the four |
| Fig. 2 | from linear soft iron | harmonics of the sensor, mean absolute error |
| Section 5 | same or better than min-max | if the positions are right |
"""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData
from bench.calibration.four_position import (
    fit_four_position,
    four_position_batch,
)
from bench.calibration.min_max import min_max_batch
from bench.reproduction.printed_formulas import printed_four_position
from bench.reproduction.skula_turn import (
    Turn,
    by_first_position,
    by_four,
    errors_deg,
    four_of,
    largest_error_deg,
    mean_error_deg,
)

AZIMUTH = np.arange(0.0, 360.0, 5.0)
PSI = np.deg2rad(AZIMUTH)


def sines(*, ratio: float = 1.0, start_deg: float = 0.0) -> Turn:
    psi = np.deg2rad(AZIMUTH + start_deg)
    field = np.column_stack([60.0 + 250.0 * np.cos(psi), -40.0 - ratio * 250.0 * np.sin(psi)])
    return Turn(azimuth_deg=AZIMUTH + start_deg, field_mg=field)


def second_harmonic(x_mg: float, y_mg: float, x_deg: float, y_deg: float) -> Turn:
    x = 250.0 * np.cos(PSI) + x_mg * np.cos(2.0 * PSI + np.deg2rad(x_deg))
    y = -250.0 * np.sin(PSI) + y_mg * np.cos(2.0 * PSI + np.deg2rad(y_deg))
    return Turn(azimuth_deg=AZIMUTH, field_mg=np.column_stack([x, y]))


def test_printed_amplitude_loses_the_scale_at_half_of_all_start_angles() -> None:
    """Ay/Ax = 0.8: 6.4 deg at 36 of 72; between them the formula is right."""
    turn = sines(ratio=0.8, start_deg=2.5)
    left = largest_error_deg(printed_four_position(four_of(turn.field_mg)), turn)
    assert (left > 6.0).sum() == 36
    assert left.max() == pytest.approx(6.4, abs=0.05)
    assert np.sort(left)[:36].max() < 1e-9
    ours = four_position_batch(four_of(turn.field_mg), 0.5)
    assert largest_error_deg(ours, turn).max() < 1e-9


@pytest.mark.parametrize("first_deg", [0.0, 180.0])
def test_printed_amplitude_is_no_number_at_an_angle_of_0_or_180(first_deg: float) -> None:
    quarters = np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]])
    if first_deg:
        quarters = -quarters
    readings = 250.0 * quarters + [60.0, -40.0]
    assert not np.isfinite(printed_four_position(readings).matrix).all()
    fit = fit_four_position(CalibrationData(field_mg=np.insert(readings, 2, 433.0, axis=1)))
    assert not fit.refused
    assert fit.offset_mg == pytest.approx([60.0, -40.0, 0.0])
    assert fit.extra["alpha_x_deg"] % 360.0 == pytest.approx(first_deg)


def test_a_second_harmonic_acts_through_the_printed_offset_only() -> None:
    """The errata's example: 1.39-1.70 deg by first position, mean of four 1.23, min-max 1.77."""
    turn = second_harmonic(7.451, 9.396, 19.49, 304.27)
    found = by_first_position(turn)
    assert found.printed_offset_deg.min() == pytest.approx(1.39, abs=0.005)
    assert found.printed_offset_deg.max() == pytest.approx(1.70, abs=0.005)
    assert found.four_deg == pytest.approx(np.full(72, 1.23), abs=0.005)
    assert found.min_max_deg == pytest.approx(1.77, abs=0.005)


def test_first_positions_as_good_as_min_max_are_all_by_the_mean_and_half_by_the_printed() -> None:
    """The module of Fig. 2 on the bench as formulas: film of 5 G, cubic error of y."""
    x, y = 250.0 * np.cos(PSI), -250.0 * np.sin(PSI)
    along = np.column_stack([x / (1.0 + y / 5000.0), 0.8 * (y - 1e-6 * y**3) / (1.0 + x / 5000.0)])
    found = by_first_position(Turn(azimuth_deg=AZIMUTH, field_mg=along + [60.0, -40.0]))
    limit = found.min_max_deg + 0.01
    assert (found.four_deg <= limit).sum() == 72
    assert (found.printed_offset_deg <= limit).sum() == 38


def test_linear_soft_iron_makes_no_second_harmonic_in_an_axis() -> None:
    soft = np.array([[1.1, 0.07], [-0.03, 0.9]])
    field = 250.0 * np.column_stack([np.cos(PSI), -np.sin(PSI)]) @ soft.T + [60.0, -40.0]
    spectrum = np.abs(np.fft.rfft(field, axis=0)) / len(PSI)
    assert spectrum[2:].max() < 1e-12
    four = four_of(field)
    assert four[:, 0] + four[:, 2] == pytest.approx(np.tile([120.0, -80.0], (72, 1)))


def test_the_mean_error_must_be_of_magnitudes() -> None:
    """The signed mean of a harmonic's error is nothing: Fig. 2 would be flat at 0."""
    turn = second_harmonic(7.451, 9.396, 19.49, 304.27)
    fits = by_four(four_of(turn.field_mg))
    assert np.abs(errors_deg(fits, turn).mean(axis=-1)).max() < 0.03
    assert mean_error_deg(fits, turn).min() > 1.2


def test_four_positions_are_worse_than_min_max_when_they_miss_their_places() -> None:
    turn = sines()
    stood = np.deg2rad([0.0, 92.0, 181.0, 268.0])
    four = np.column_stack([60.0 + 250.0 * np.cos(stood), -40.0 - 250.0 * np.sin(stood)])
    by_extremes = min_max_batch(turn.field_mg, 0.5)
    assert mean_error_deg(by_extremes, turn) < 1e-9
    assert mean_error_deg(by_four(four), turn) > 0.5
    assert fit_four_position(CalibrationData(field_mg=np.insert(four, 2, 0.0, axis=1))).refused
