"""Caruso, Table 1: the magnetic sensor's error budget, printed, summed again, and measured.

The unit is one at its limits. What data sheets call the errors is measured on x over the full
scale of +-400 mG; what they do to a heading is measured in 200 mG, as the RMS of swings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.reproduction.caruso_turn import HORIZONTAL_MG
from bench.reproduction.setup import Setup
from bench.reproduction.turns import error_deg, headings, largest, rms, turn
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from bench.reproduction.laboratory import Laboratory, OpenLaboratory

SOURCES: Final = ("noise", "linearity", "hysteresis", "repeatability")
LIMIT_MG: Final = {"noise": 0.085, "linearity": 0.2, "hysteresis": 0.32, "repeatability": 0.32}
"""Table 1, 'Field Error': 85 uG, 0.05 %, 0.08 % and 0.08 % of a full scale of 400 mG."""
FULL_SCALE_MG: Final = 400.0
END_POINT_SHARE: Final = 2.0 / 27.0**0.5
"""A cubic's largest distance from the line through its ends, over its value there."""
_CUBIC_PER_MG2: Final = LIMIT_MG["linearity"] / END_POINT_SHARE / FULL_SCALE_MG**3
_RANGE_MG: Final = 500.0
"""Of the converter where data sheets' errors are measured: 0.015 mG a count."""
_SITE: Final = Setup(horizontal_mg=HORIZONTAL_MG, dip_deg=0.0)
UNITS: Final = {
    "noise": replace(_SITE, noise_mg=LIMIT_MG["noise"]),
    "linearity": replace(_SITE, cubic_per_mg2=(_CUBIC_PER_MG2,) * 3),
    "hysteresis": replace(
        _SITE, hysteresis_mg=LIMIT_MG["hysteresis"] / 2.0, azimuth_acceleration_dps2=18.0
    ),
    "repeatability": replace(_SITE, repeatability_mg=LIMIT_MG["repeatability"]),
}
"""Units with one error each, at its limit; the hysteresis is the width of the loop.

Its rig moves gently: the seat's ring-down after a hard stop shakes hysteresis out of the film.
"""
ALL: Final = replace(
    UNITS["hysteresis"],
    noise_mg=UNITS["noise"].noise_mg,
    cubic_per_mg2=UNITS["linearity"].cubic_per_mg2,
    repeatability_mg=UNITS["repeatability"].repeatability_mg,
)
SWINGS: Final = {"linearity": 1, "hysteresis": 1, "repeatability": 2, "all": 2}
"""Swings there and back of 24 headings each way."""
NOISE_S: Final = 40.0
SWEEP_MG: Final = np.linspace(-FULL_SCALE_MG, FULL_SCALE_MG, 17)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BudgetSwing:
    """Readings of swings there and back in 200 mG.

    Attributes
    ----------
    azimuth_deg, error_deg, clockwise : ndarray, shape (n,)
        Rig azimuth, heading error, and from which side the pose was approached.
    field_rms_mg : float
        Field error, RMS of x and y.
    """

    azimuth_deg: NDArray[np.float64]
    error_deg: NDArray[np.float64]
    clockwise: NDArray[np.bool_]
    field_rms_mg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Standard deviations at one pose: of x and y, and of the heading."""

    field_mg: float
    heading_deg: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Budget:
    """All that was measured of Table 1.

    Attributes
    ----------
    field_mg : dict of str to float
        By source, as data sheets define it.
    swings : dict of str to BudgetSwing
        By source, and of all together.
    noise : dict of str to Noise
        Of ``"set"`` readings alone and of ``"pair"``s, (set - reset)/2.
    """

    field_mg: dict[str, float]
    swings: dict[str, BudgetSwing]
    noise: dict[str, Noise]

    @property
    def total_mg(self) -> float:
        """Root of the sum of the squares."""
        return root_sum_square(self.field_mg.values())


def root_sum_square(values: Iterable[float]) -> float:
    """Return the root of the sum of the squares."""
    return math.sqrt(sum(value * value for value in values))


def across_deg(field_mg: float) -> float:
    """Return the heading error of a field error across 200 mG.

    >>> round(across_deg(0.085), 4)
    0.0244
    """
    return float(np.rad2deg(np.arctan2(field_mg, HORIZONTAL_MG)))


def measure_budget(open_laboratory: OpenLaboratory) -> Budget:
    """Switch the error sources on one at a time and measure each, then all together."""
    with open_laboratory(UNITS["noise"]) as laboratory:
        noise = _noise(laboratory)
        swings = {"noise": _swung_by_pair(laboratory)}
    for source in SOURCES[1:]:
        with open_laboratory(UNITS[source]) as laboratory:
            swings[source] = _swung(laboratory, SWINGS[source])
    with open_laboratory(ALL) as laboratory:
        swings["all"] = _swung(laboratory, SWINGS["all"])
    field_mg = {
        "noise": noise["set"].field_mg,
        "linearity": _linearity_mg(open_laboratory),
        "hysteresis": _hysteresis_mg(open_laboratory),
        "repeatability": swings["repeatability"].field_rms_mg,
    }
    return Budget(field_mg=field_mg, swings=swings, noise=noise)


def _noise(laboratory: Laboratory) -> dict[str, Noise]:
    laboratory.measure(headings([45.0]))
    samples = laboratory.listen(NOISE_S)
    pairs_mg = (samples["set_mg"] - samples["reset_mg"]) / 2.0
    return {
        name: Noise(
            field_mg=float(np.sqrt(field_mg[:, :2].var(axis=0, ddof=1).mean())),
            heading_deg=float(compensated_heading_deg(None, field_mg).std(ddof=1)),
        )
        for name, field_mg in (("set", samples["set_mg"]), ("pair", pairs_mg))
    }


def _swung_by_pair(laboratory: Laboratory) -> BudgetSwing:
    """Return one turn of 24 headings whose readings are single pairs."""
    azimuths_deg, fields_mg = [], []
    for pose in turn(24):
        azimuth_deg = laboratory.measure([pose])["rig_azimuth_deg"][0]
        samples = laboratory.listen(0.05)
        fields_mg.append((samples["set_mg"] - samples["reset_mg"]) / 2.0)
        azimuths_deg.append(np.full(len(samples), azimuth_deg))
    azimuth_deg, field_mg = np.concatenate(azimuths_deg), np.concatenate(fields_mg)
    return BudgetSwing(
        azimuth_deg=azimuth_deg,
        error_deg=wrap_180_deg(compensated_heading_deg(None, field_mg) - azimuth_deg),
        clockwise=np.ones(len(azimuth_deg), dtype=bool),
        field_rms_mg=_field_rms_mg(field_mg, azimuth_deg),
    )


def _linearity_mg(open_laboratory: OpenLaboratory) -> float:
    """Return the largest distance from the line through the ends of the full scale."""
    unit = replace(UNITS["linearity"], horizontal_mg=FULL_SCALE_MG, range_mg=_RANGE_MG)
    with open_laboratory(unit) as laboratory:
        x_mg = _swept(laboratory, np.arccos(SWEEP_MG / FULL_SCALE_MG), -1)
    slope = (x_mg[-1] - x_mg[0]) / (2.0 * FULL_SCALE_MG)
    middle_mg = (x_mg[-1] + x_mg[0]) / 2.0
    return largest(x_mg - middle_mg - slope * SWEEP_MG)


def _hysteresis_mg(open_laboratory: OpenLaboratory) -> float:
    """Return the largest gap between rising and falling field within the full scale."""
    unit = replace(
        UNITS["hysteresis"],
        horizontal_mg=FULL_SCALE_MG,
        range_mg=_RANGE_MG,
        azimuth_acceleration_dps2=5.0,
    )
    azimuth_rad = np.arccos(SWEEP_MG[::4] / FULL_SCALE_MG)
    with open_laboratory(unit) as laboratory:
        rising_mg = _swept(laboratory, azimuth_rad, -1)
        falling_mg = _swept(laboratory, azimuth_rad[::-1], 1)[::-1]
    return largest(rising_mg - falling_mg)


def _swung(laboratory: Laboratory, times: int) -> BudgetSwing:
    """Return swings there and back, each with a run-up of one pose."""
    azimuths_deg = np.arange(0.0, 360.0, 15.0)
    parts, clockwise = [], []
    for _ in range(times):
        for side, run_up_deg in ((1, -15.0), (-1, 360.0)):
            laboratory.measure(headings([run_up_deg]))
            parts.append(laboratory.measure(headings(azimuths_deg[::side]), direction=side))
            clockwise.append(np.full(len(azimuths_deg), side > 0))
    readings = np.concatenate(parts)
    found_deg = compensated_heading_deg(None, readings["field_mg"])
    return BudgetSwing(
        azimuth_deg=readings["rig_azimuth_deg"],
        error_deg=error_deg(found_deg, readings),
        clockwise=np.concatenate(clockwise),
        field_rms_mg=_field_rms_mg(readings["field_mg"], readings["rig_azimuth_deg"]),
    )


def _field_rms_mg(field_mg: NDArray[np.float64], azimuth_deg: NDArray[np.float64]) -> float:
    azimuth_rad = np.deg2rad(azimuth_deg)
    exact_mg = HORIZONTAL_MG * np.column_stack([np.cos(azimuth_rad), -np.sin(azimuth_rad)])
    return rms(field_mg[:, :2] - exact_mg)


def _swept(
    laboratory: Laboratory, azimuth_rad: NDArray[np.float64], direction: int
) -> NDArray[np.float64]:
    """Return x at azimuths approached from one side, shape (n,)."""
    readings = laboratory.measure(headings(np.rad2deg(azimuth_rad)), direction=direction)
    return np.asarray(readings["field_mg"][:, 0], dtype=float)
