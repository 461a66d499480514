"""The play of a turn both ways, against the play operator itself."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.hysteresis import hysteresis_of

HALF_MG = np.array([0.16, 0.12, 0.20])
HEADINGS = np.arange(0.0, 360.0, 15.0)


def lagging(field_mg, half_mg):
    """The play operator along a way, shape (n,)."""
    out, lag = np.empty_like(field_mg), field_mg[0]
    for row, here in enumerate(field_mg):
        lag = min(max(lag, here - half_mg), here + half_mg)
        out[row] = lag
    return out


def field_mg_at(azimuth_deg):
    turn = np.deg2rad(azimuth_deg)
    columns = [250.0 * np.cos(turn), -240.0 * np.sin(turn + 0.1), 433.0 + 20.0 * np.sin(turn - 1.0)]
    return np.column_stack(columns)


def turn_both_ways(half_mg=HALF_MG, repeatability_mg=0.0, seed=1):
    """Readings, azimuths and directions of 24 headings clockwise and back, walked in 0.5 deg."""
    way = np.concatenate([np.arange(-30.0, 360.1, 0.5), np.arange(360.0, -0.1, -0.5)])
    field = field_mg_at(way)
    lag = np.column_stack([lagging(field[:, axis], half_mg[axis]) for axis in range(3)])
    rows_up = [int((heading + 30.0) * 2) for heading in HEADINGS]
    rows_down = [len(way) - 1 - int(heading * 2) for heading in HEADINGS]
    rows = np.array([*rows_up, *rows_down])
    noise = np.random.default_rng(seed).normal(0.0, repeatability_mg, (len(rows), 3))
    direction = np.repeat([1, -1], len(HEADINGS))
    return lag[rows] + noise, way[rows] % 360.0, direction


def test_the_play_is_found_exactly_where_nothing_else_is():
    found = hysteresis_of(*turn_both_ways())

    assert found.half_width_mg == pytest.approx(HALF_MG, abs=0.01)


def test_with_repeatability_it_is_found_within_its_uncertainty():
    runs = [hysteresis_of(*turn_both_ways(repeatability_mg=0.3, seed=seed)) for seed in range(100)]

    sigmas = np.array([(one.half_width_mg - HALF_MG) / one.sd_mg for one in runs])
    assert np.abs(sigmas.mean(axis=0)).max() < 0.4
    assert 0.85 < np.sqrt((sigmas**2).mean()) < 1.2
    assert np.mean([one.sd_mg for one in runs]) == pytest.approx(0.05, rel=0.2)


def test_a_film_without_play_shows_none():
    found = hysteresis_of(*turn_both_ways(half_mg=np.zeros(3), repeatability_mg=0.3))

    assert (np.abs(found.half_width_mg) < 3.0 * found.sd_mg).all()


def test_what_belongs_to_the_heading_or_drifts_between_the_turns_cancels():
    field, azimuth, direction = turn_both_ways()
    of_heading = 3.0 * np.sin(np.deg2rad(2.0 * azimuth))[:, None]
    drifted = 0.5 * (direction < 0)[:, None]

    found = hysteresis_of(field + of_heading + drifted, azimuth, direction)

    assert found.half_width_mg == pytest.approx(HALF_MG, abs=0.02)


def test_an_axis_that_the_turn_hardly_changes_is_not_told():
    field, azimuth, direction = turn_both_ways()
    field[:, 2] = 433.0 + 0.02 * (field[:, 2] - 433.0)

    found = hysteresis_of(field, azimuth, direction)

    assert np.isnan(found.half_width_mg[2])
    assert np.isnan(found.sd_mg[2])
    assert np.isfinite(found.half_width_mg[:2]).all()


@pytest.mark.parametrize("rows", [slice(0, 0), slice(0, 24), slice(24, 48), slice(0, 4)])
def test_a_turn_one_way_only_tells_nothing(rows):
    field, azimuth, direction = turn_both_ways()

    found = hysteresis_of(field[rows], azimuth[rows], direction[rows])

    assert np.isnan(found.half_width_mg).all()
