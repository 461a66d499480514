"""Konvalin's Figs. 3-5, heading at 50 deg of elevation, and his order of compensation.

Elevation is pitch. The orders and the wrong attitudes are those of
`bench.calibration.compensation`; all of them work on the same readings and the same fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import Order, compensated_heading_deg
from bench.calibration.fit import CalibrationData
from bench.calibration.min_max import fit_min_max
from bench.calibration.tilt import attitude_deg, ned_from_body
from bench.calibration.truth_aided import fit_truth_aided
from bench.pose import Attitude
from bench.reproduction.setup import Setup
from bench.reproduction.turns import calibration_data, error_deg, largest, turn
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import Fit
    from bench.reproduction.laboratory import OpenLaboratory

ELEVATION_DEG: Final = 50.0
HEADINGS_DEG: Final = (30.0, 90.0, 150.0, 270.0)
"""Headings held while the module is tilted."""
DIPS_DEG: Final = (0.0, 40.0, 60.0, 68.0)
"""Dips of the sites; the first has no vertical field, 68 is the paper's own Rapid City."""
SITE: Final = Setup()
"""Horizontal field 250 mG, dip 60 deg, nothing wrong with the module."""
IRON_MG: Final = (76.8, -51.2, -38.4)
"""Hard iron of 0.2 of the field (500 mG) along (0.6, -0.4, -0.3)."""
TILTS_DEG: Final = (-30.0, -15.0, 0.0, 15.0, 30.0)
MAP_HEADINGS: Final = 12
NAMED_TILTS_DEG: Final = ((25.0, -15.0), (30.0, 30.0))
"""Pitch and roll at which the errata name an error."""
BANK: Final = "bank"
"""Key of the attitude whose roll is the bank, the angle of the y axis to the horizon."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Elevation:
    """Headings read while the elevation rises, and over turns at its end.

    Attributes
    ----------
    pitch_deg : ndarray, shape (n,)
    raw_deg, levelled_deg : ndarray, shape (headings, n)
        Heading from x and y alone, and tilt-compensated, at the headings held.
    turn_deg : ndarray, shape (m,)
        Headings of the turns at 50 deg.
    turn_raw_deg, turn_levelled_deg : dict of float to ndarray, shape (m,)
        Headings read there by dip in degrees.
    """

    pitch_deg: NDArray[np.float64]
    raw_deg: NDArray[np.float64]
    levelled_deg: NDArray[np.float64]
    turn_deg: NDArray[np.float64]
    turn_raw_deg: dict[float, NDArray[np.float64]]
    turn_levelled_deg: dict[float, NDArray[np.float64]]


def measured_elevation(open_laboratory: OpenLaboratory) -> Elevation:
    """Tilt at the headings held, and turn at the end of the tilt on sites of several dips."""
    pitches = np.linspace(0.0, ELEVATION_DEG, 11)
    poses = [
        Attitude(azimuth_deg=heading, pitch_deg=float(pitch))
        for heading in HEADINGS_DEG
        for pitch in pitches
    ]
    with open_laboratory(SITE) as laboratory:
        risen = laboratory.measure(poses)
    raw, levelled = {}, {}
    for dip_deg in DIPS_DEG:
        with open_laboratory(replace(SITE, dip_deg=dip_deg)) as laboratory:
            turned = laboratory.measure(turn(36, ELEVATION_DEG))
        raw[dip_deg] = compensated_heading_deg(None, turned["field_mg"])
        levelled[dip_deg] = compensated_heading_deg(None, turned["field_mg"], turned["accel_g"])
    shape = (len(HEADINGS_DEG), len(pitches))
    return Elevation(
        pitch_deg=pitches,
        raw_deg=compensated_heading_deg(None, risen["field_mg"]).reshape(shape),
        levelled_deg=compensated_heading_deg(None, risen["field_mg"], risen["accel_g"]).reshape(
            shape
        ),
        turn_deg=turned["rig_azimuth_deg"],
        turn_raw_deg=raw,
        turn_levelled_deg=levelled,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OrderStudy:
    """Largest heading error in degrees over a turn, by order of compensation.

    Attributes
    ----------
    mapped_deg : dict of str to ndarray, shape (pitches, rolls)
        At all pairs of `TILTS_DEG`, by Order and `BANK`.
    named_deg : dict of str to tuple of float
        At `NAMED_TILTS_DEG`.
    own_tilt_deg : tuple of (float, float)
        Tilt first, with the offset found after tilt compensation in a turn at the first named
        tilt: error left at that tilt, and level.
    """

    mapped_deg: dict[str, NDArray[np.float64]]
    named_deg: dict[str, tuple[float, ...]]
    own_tilt_deg: tuple[float, float]


def measured_orders(
    open_laboratory: OpenLaboratory, tilts_deg: tuple[float, ...] = TILTS_DEG
) -> OrderStudy:
    """Compensate the same readings in each order, at a grid of attitudes and the named ones.

    `tilts_deg` must hold -30, 0 and 30.
    """
    setup = replace(SITE, hard_iron_mg=IRON_MG)
    with open_laboratory(setup) as laboratory:
        mapped = laboratory.measure(_grid(tilts_deg))
        named = [laboratory.measure(turn(36, *tilt)) for tilt in NAMED_TILTS_DEG]
    fit = fit_truth_aided(calibration_data(mapped[_calibrated(mapped)], setup))
    grid = mapped.reshape(len(tilts_deg), len(tilts_deg), MAP_HEADINGS)
    ways = (Order.BODY, Order.TILT_FIRST, Order.TILT_REVERSED, BANK)
    level = grid[tilts_deg.index(0.0), tilts_deg.index(0.0)]
    own = _fit_after_levelling(named[0])
    return OrderStudy(
        mapped_deg={
            str(way): np.array([[_worst_deg(cell, fit, way) for cell in row] for row in grid])
            for way in ways
        },
        named_deg={
            str(way): tuple(_worst_deg(readings, fit, way) for readings in named) for way in ways
        },
        own_tilt_deg=(
            _worst_deg(named[0], own, Order.TILT_FIRST),
            _worst_deg(level, own, Order.TILT_FIRST),
        ),
    )


def _grid(tilts_deg: tuple[float, ...]) -> list[Attitude]:
    """Return a turn at every pair of tilts, pitch outermost."""
    return [
        pose
        for pitch_deg in tilts_deg
        for roll_deg in tilts_deg
        for pose in turn(MAP_HEADINGS, pitch_deg, roll_deg)
    ]


def _calibrated(readings: NDArray[np.void]) -> NDArray[np.bool_]:
    """Return the rows that are fitted, shape (n,): level, and pitch or roll alone of 30 deg."""
    pitch_deg, roll_deg = np.abs(readings["rig_pitch_deg"]), np.abs(readings["rig_roll_deg"])
    low, high = np.minimum(pitch_deg, roll_deg), np.maximum(pitch_deg, roll_deg)
    return np.asarray((low < 1.0) & ((high < 1.0) | (high > 29.0)))


def _worst_deg(readings: NDArray[np.void], fit: Fit, way: str) -> float:
    field_mg, accel_g = readings["field_mg"], readings["accel_g"]
    if way == BANK:
        pitch_deg, roll_deg = attitude_deg(fit.corrected_g(accel_g))
        y_down = ned_from_body(0.0, pitch_deg, roll_deg)[..., 2, 1]
        bank_deg = np.rad2deg(np.arcsin(y_down))
        found = compensated_heading_deg(fit, field_mg, pitch_deg=pitch_deg, roll_deg=bank_deg)
    else:
        found = compensated_heading_deg(fit, field_mg, accel_g, order=Order(way))
    return largest(error_deg(found, readings))


def _fit_after_levelling(readings: NDArray[np.void]) -> Fit:
    """Return min-max of readings that are tilt-compensated first, as the paper orders it."""
    pitch_deg, roll_deg = attitude_deg(readings["accel_g"])
    back = ned_from_body(0.0, pitch_deg, roll_deg)
    levelled_mg = np.einsum("nij,nj->ni", back, readings["field_mg"])
    return fit_min_max(CalibrationData(field_mg=levelled_mg))


def changes_deg(headings_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the change of headings (headings, n) since their first in (-180, 180]."""
    return wrap_180_deg(headings_deg - headings_deg[:, :1])
