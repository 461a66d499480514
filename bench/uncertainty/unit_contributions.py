"""What the unit adds to a heading at one pose and not at the next: noise, play, drift of its zero.

None of it is the unit's own systematic error, and none of it is the bench's. It belongs to the
certificate; a verification test lets the unit answer for it (ISO 14253-5).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.temperature import WANDER_S
from bench.uncertainty.contribution import Contribution, own_axes
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.uncertainty.sensitivities import Sensitivities
    from bench.uncertainty.unit_data import UnitData

DITHERED_SHARE: Final = 0.4
"""Noise over one count from which on the rounding of a reading is random (dither)."""


def unit_contributions(
    readings: NDArray[np.void], by: Sensitivities, unit: UnitData
) -> tuple[Contribution, ...]:
    """Return the unit's lines of the budget, of readings in the order of their visit."""
    return (
        _sensor_noise(readings, by),
        _converter(readings, by, unit),
        _repeatability(by, unit),
        _hysteresis(readings, by, unit),
        _accelerometer_noise(readings, by),
        _accelerometer_tempco(readings, by, unit),
        _accelerometer_wander(readings, by, unit),
        *_of_the_unit_itself(len(readings)),
    )


def _sensor_noise(readings: NDArray[np.void], by: Sensitivities) -> Contribution:
    """Mean of `count` half differences of set and reset readings of pooled noise."""
    single_mg = np.sqrt(np.mean(readings["noise_mg"] ** 2, axis=0))
    mean_mg = single_mg / np.sqrt(2.0 * readings["count"])[:, None]
    return Contribution(
        name="sensor noise",
        source="A",
        distribution="normal, mean of the dwell",
        group="unit",
        shared=False,
        value=_rms(mean_mg),
        unit="mG",
        columns_deg=own_axes(by.raw_field * mean_mg),
    )


def _converter(readings: NDArray[np.void], by: Sensitivities, unit: UnitData) -> Contribution:
    """Return the line of rounding to one count: half a count/sqrt(3).

    Noise that spans the counts averages the rounding over the dwell; the measured noise holds it
    then already, and this line is the little that is counted twice.
    """
    rounding_mg = unit.converter_mg / math.sqrt(12.0) / math.sqrt(2.0)
    noise_mg = np.sqrt(np.mean(readings["noise_mg"] ** 2, axis=0))
    dithered = noise_mg >= DITHERED_SHARE * unit.converter_mg
    counts = np.where(dithered, readings["count"][:, None], 1)
    value_mg = rounding_mg / np.sqrt(counts)
    return Contribution(
        name="converter",
        source="B",
        distribution="rectangular, count/sqrt(12)" + (", dithered" if dithered.all() else ""),
        group="unit",
        shared=False,
        value=_rms(value_mg),
        unit="mG",
        columns_deg=own_axes(by.raw_field * value_mg),
    )


def _repeatability(by: Sensitivities, unit: UnitData) -> Contribution:
    return Contribution(
        name="repeatability",
        source="B",
        distribution="normal",
        group="unit",
        shared=False,
        value=unit.repeatability_mg,
        unit="mG",
        columns_deg=own_axes(by.raw_field * unit.repeatability_mg),
    )


def _hysteresis(readings: NDArray[np.void], by: Sensitivities, unit: UnitData) -> Contribution:
    """Return the line of the play: every axis lags behind a turn, so that the heading does.

    The axes do not lag each for itself: the side of each follows from the direction of the turn,
    and their parts of the heading add up. A stop rings down into the play by a little, so that
    the lag is near an edge and not at it: the U-shaped distribution, a/sqrt(2)
    (tests/system/test_certificate.py holds the virtual bridge against it).
    """
    value_mg = unit.hysteresis_mg / math.sqrt(2.0)
    order = np.argsort(readings["t_s"], kind="stable")
    azimuth_deg = by.angles_deg[order, 0]
    direction = np.empty(len(readings))
    direction[order] = np.where(
        wrap_180_deg(np.diff(azimuth_deg, prepend=azimuth_deg[:1])) < 0.0, -1.0, 1.0
    )
    lag_deg = -np.sum(by.raw_field * np.sign(by.raw_turn), axis=1) * direction * value_mg
    return Contribution(
        name="hysteresis",
        source="B",
        distribution="U-shaped, half play/sqrt(2), side by the turn",
        group="unit",
        shared=True,
        value=value_mg,
        unit="mG",
        columns_deg=lag_deg[:, None],
    )


def _accelerometer_noise(readings: NDArray[np.void], by: Sensitivities) -> Contribution:
    single_g = np.sqrt(np.mean(readings["accel_sd_g"] ** 2, axis=0))
    mean_g = single_g / np.sqrt(readings["count"])[:, None]
    return Contribution(
        name="accelerometer noise",
        source="A",
        distribution="normal, mean of the dwell",
        group="unit",
        shared=False,
        value=1000.0 * _rms(mean_g),
        unit="mg",
        columns_deg=own_axes(by.raw_force * mean_g),
    )


def _accelerometer_tempco(
    readings: NDArray[np.void], by: Sensitivities, unit: UnitData
) -> Contribution:
    """Zero's tempco times the temperature against the mean of the verification."""
    warmer_c = readings["temperature_c"] - readings["temperature_c"].mean()
    value_g = unit.accel_tempco_g_per_c / math.sqrt(3.0) * warmer_c
    return Contribution(
        name="accelerometer tempco",
        source="B",
        distribution="rectangular, limit/sqrt(3)",
        group="unit",
        shared=True,
        value=1000.0 * _rms(value_g),
        unit="mg",
        columns_deg=by.raw_force * value_g[:, None],
    )


def _accelerometer_wander(
    readings: NDArray[np.void], by: Sensitivities, unit: UnitData
) -> Contribution:
    """Random walk of the zero against its mean over the verification: one step between poses."""
    n, order = len(readings), np.argsort(readings["t_s"], kind="stable")
    t_s = readings["t_s"][order]
    walk = np.empty((n, n))
    walk[order] = np.tril(np.ones((n, n))) * np.sqrt(np.diff(t_s, prepend=t_s[:1]) / WANDER_S)
    walk_g = unit.accel_wander_g * (walk - walk.mean(axis=0))
    columns = by.raw_force.T[:, :, None] * walk_g
    return Contribution(
        name="accelerometer wander",
        source="B",
        distribution="normal, random walk",
        group="unit",
        shared=True,
        value=1000.0 * float(np.sqrt(np.mean(np.sum(walk_g**2, axis=1)))),
        unit="mg",
        columns_deg=np.concatenate(list(columns), axis=1),
    )


def _of_the_unit_itself(n: int) -> tuple[Contribution, ...]:
    """Return the lines that are nothing here: they are what the certificate is to state."""
    return tuple(
        Contribution(
            name=name,
            source="B",
            distribution="part of the unit's own error",
            group="unit",
            shared=True,
            value=0.0,
            unit="deg",
            columns_deg=np.zeros((n, 1)),
        )
        for name in ("nonlinearity", "covariance of the fit")
    )


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
