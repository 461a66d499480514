"""Verifications of many units on the full sensor model: measured, own and true heading errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from many_benches import site_field_mg
from many_fits import STATION, Calibrated, calibrated
from many_units import (
    SAMPLES_PER_S,
    Change,
    Lot,
    Readings,
    Way,
    perfect_readings,
    read,
    way_of,
)

from bench.acceptance.site import heading_error_deg
from bench.calibration.tilt import tilt_compensated_heading_deg
from bench.pose import Attitude
from bench.procedure_loader import load_procedure
from bench.samples import READING
from bench.steps.adaptive_poses import AdaptivePoses
from bench.steps.poses import Poses
from bench.steps.sweep import Sweep
from bench.steps.verify import Verify
from devices.accelerometer import NOISE_G
from devices.unit import NOISE_MG
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.steps.step import PlannedPose

HOME: Final = Attitude(azimuth_deg=0.0)
HORIZONTAL_MG: Final = STATION.horizontal_mg


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verifications:
    """Verification of the units of a lot at m poses; arrays of shape (units, m), in deg.

    Attributes
    ----------
    readings : list of ndarray of READING, shape (m,)
        What the bench reads, by unit.
    error_deg : ndarray
        Heading of the unit less the bench's reference heading.
    own_deg : ndarray
        The unit's own error: coefficients on noiseless readings at the true attitude, in the site's
        undisturbed field, against the true heading. What a certificate states.
    shown_deg : ndarray
        The error that the unit showed against the true heading in the field that was there. What
        a decision is about.
    calibrated : Calibrated
    """

    readings: list[NDArray[np.void]]
    error_deg: NDArray[np.float64]
    own_deg: NDArray[np.float64]
    shown_deg: NDArray[np.float64]
    calibrated: Calibrated


def poses_of(procedure: str, *, verifying: bool = False) -> list[PlannedPose]:
    """Return the calibration poses of a shipped procedure, or its verification poses."""
    kinds = (Verify,) if verifying else (Sweep, Poses, AdaptivePoses)
    steps = load_procedure(procedure).walk()
    return [pose for step in steps if isinstance(step, kinds) for pose in step.poses()]


def verifications_of(
    lot: Lot, seed: int, procedure: str, spoiled_deg: NDArray[np.float64] | None = None
) -> Verifications:
    """Calibrate, write and verify a lot.

    Parameters
    ----------
    spoiled_deg : ndarray, shape (units,), optional
        Heading error of units that changed after the write: in part by hard iron, in part by a
        magnetometer that turned in its housing. Their own error is then not known here.
    """
    calibrating = poses_of(procedure)
    way = way_of([*calibrating, *poses_of(procedure, verifying=True)], HOME)
    count = len(calibrating)
    change = None
    if spoiled_deg is not None:
        change = _change(np.random.default_rng((seed, 1)), spoiled_deg, count)
    readings = read(lot, way, np.random.default_rng(seed), change)
    calibration = calibrated(way.shown_deg[:, -1], readings, count)
    last = _last(readings, count)
    heading_deg = calibration.heading_deg(last.field_mg, last.force_g)
    rows = [_rows(way, last, heading_deg, count, unit) for unit in range(len(heading_deg))]
    turned_deg = np.rad2deg(np.arctan2(last.axes[..., 1, 0], last.axes[..., 0, 0]))
    azimuth_deg = np.rad2deg(np.arctan2(*site_field_mg(lot.benches).T[1::-1]))
    own_deg = np.full(heading_deg.shape, np.nan)
    if change is None:
        unit_deg = calibration.heading_deg(*perfect_readings(lot, last))
        own_deg = wrap_180_deg(unit_deg - turned_deg + azimuth_deg[:, None])
    return Verifications(
        readings=rows,
        error_deg=np.array([heading_error_deg(one["heading_deg"], one, STATION) for one in rows]),
        own_deg=own_deg,
        shown_deg=wrap_180_deg(heading_deg - _there_deg(lot, last)),
        calibrated=calibration,
    )


def _change(rng: np.random.Generator, spoiled_deg: NDArray[np.float64], first: int) -> Change:
    """Return hard iron and turn that make heading errors up to a size, in random proportion."""
    units = len(spoiled_deg)
    towards_rad = rng.uniform(0.0, 2.0 * np.pi, units)
    upright = 0.5 * rng.standard_normal(units)
    share = rng.random(units)
    size_mg = HORIZONTAL_MG * np.deg2rad(share * spoiled_deg)
    direction = np.stack([np.cos(towards_rad), np.sin(towards_rad), upright], axis=1)
    return Change(
        first=first,
        iron_mg=size_mg[:, None] * direction,
        turn_deg=(1.0 - share) * spoiled_deg * rng.choice([-1.0, 1.0], units),
    )


def _last(readings: Readings, count: int) -> Readings:
    """Return the readings from a pose on."""
    return Readings(
        **{name: getattr(readings, name)[:, count:] for name in Readings.__dataclass_fields__}
    )


def _there_deg(lot: Lot, readings: Readings) -> NDArray[np.float64]:
    """Return the heading of a perfect module in the field that was there, its iron included."""
    field_mg = np.einsum("unji,unj->uni", readings.axes, readings.there_mg)
    field_mg = field_mg + lot.benches.iron_mg[:, None]
    return np.asarray(tilt_compensated_heading_deg(field_mg, -readings.axes[:, :, 2]))


def _rows(
    way: Way, readings: Readings, heading_deg: NDArray[np.float64], first: int, unit: int
) -> NDArray[np.void]:
    rows = np.zeros(heading_deg.shape[1], dtype=READING)
    rows["position"] = first + np.arange(len(rows))
    rows["count"] = np.round(SAMPLES_PER_S * way.dwell_s[first:])
    rows["t_s"] = way.seconds[first:]
    shown_deg = way.shown_deg[first:, -1]
    rows["rig_azimuth_deg"] = np.mod(shown_deg[:, 0], 360.0)
    rows["rig_pitch_deg"], rows["rig_roll_deg"] = shown_deg[:, 1], shown_deg[:, 2]
    rows["field_mg"], rows["accel_g"] = readings.field_mg[unit], readings.force_g[unit]
    rows["noise_mg"], rows["accel_sd_g"] = NOISE_MG, NOISE_G
    rows["heading_deg"] = heading_deg[unit]
    rows["temperature_c"] = readings.temperature_c[unit]
    rows["reference_mg"] = np.nan
    return rows
