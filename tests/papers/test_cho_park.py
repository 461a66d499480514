"""Cho & Park's rows of Table 1: what their azimuths make of them, and what breaks them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.cli.laboratory import open_laboratory
from bench.reproduction.cho_park_table import (
    HAND_SD_DEG,
    PUBLISHED_SD_DEG,
    SITE_DIP_DEG,
    SWEEPS,
    TWO_AXES,
    normalisation,
    predicted_spread,
    rows_of_twists_deg,
    tilt_at,
)

if TYPE_CHECKING:
    from bench.reproduction.setup import Setup

ROW_E = 4
TWIST_DEG = 1.5


def row_e_deg(setup: Setup) -> float:
    """Row (e) by the paper's rule, its azimuth off by 1.5 deg."""
    with open_laboratory(setup) as laboratory:
        return tilt_at(laboratory, normalisation(laboratory), SWEEPS[ROW_E], TWIST_DEG).adopted_deg


def test_a_row_is_what_its_azimuth_error_makes_of_it_and_another_dip_is_not() -> None:
    expected_deg = rows_of_twists_deg(np.full(len(SWEEPS), TWIST_DEG))[ROW_E]
    noise_deg = 3.0 * predicted_spread(hand_sd_deg=0.0).adopted_deg.std(axis=0)[ROW_E]

    assert abs(expected_deg - SITE_DIP_DEG) > 1.0
    assert row_e_deg(TWO_AXES) == pytest.approx(expected_deg, abs=noise_deg)
    steeper = row_e_deg(replace(TWO_AXES, dip_deg=SITE_DIP_DEG + 1.0))
    assert steeper != pytest.approx(expected_deg, abs=noise_deg)


def test_the_stated_noise_explains_the_published_rows() -> None:
    """None is off by 2 sd, and four of ten experiments scatter as much as the paper's or more."""
    spread = predicted_spread().adopted_deg
    published = np.array([sweep.published_deg for sweep in SWEEPS])

    assert (np.abs(published - SITE_DIP_DEG) < 2.0 * spread.std(axis=0)).all()
    assert 0.2 < (spread.std(axis=1, ddof=1) > PUBLISHED_SD_DEG).mean() < 0.6


def test_rolled_and_pitched_to_one_side_row_e_could_not_be_what_is_published() -> None:
    """An azimuth error of 2 deg cancels: the published 47.24 would be many sd away."""
    same_side = replace(SWEEPS[ROW_E], legs=((-48.0, 0.0), (0.0, -48.0)))
    sd_deg = predicted_spread([same_side]).adopted_deg.std()

    assert pytest.approx(2.0) == HAND_SD_DEG
    assert SITE_DIP_DEG - same_side.published_deg > 10.0 * sd_deg
