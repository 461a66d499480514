"""What the bench holds for true at a pose: the station's field seen from the rig's attitude."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from bench.acceptance.seat import has_iron, seat_angles_deg, seat_attitude
from bench.calibration.fit import (
    POSE_ACCEL_SD_G,
    POSE_FIELD_SD_MG,
    POSE_RIG_SD_DEG,
    CalibrationData,
)
from bench.calibration.fixture import SQUARE
from bench.calibration.ranking import LEVEL_DEG
from bench.calibration.tilt import heading_deg
from bench.samples import MOVING
from protocols.angles import wrap_180_deg, wrap_360_deg
from protocols.compass import FLAG_NO_ACCELERATION, FLAG_REPLAY_ENDED, FLAG_SYNTHESISED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fixture import SeatPosition


class SiteField(Protocol):
    """The part of a station's record that headings are judged against.

    `field_azimuth_deg` is the azimuth of magnetic north counted clockwise from the rig's
    zero: magnetic heading = rig azimuth - field azimuth.
    """

    @property
    def horizontal_mg(self) -> float:
        """Horizontal field."""
        ...

    @property
    def dip_deg(self) -> float:
        """Dip, positive down."""
        ...

    @property
    def field_azimuth_deg(self) -> float:
        """Azimuth of magnetic north against the rig's zero, clockwise."""
        ...

    @property
    def seat(self) -> SeatPosition:
        """The seat that holds the unit."""
        ...


def field_rig_mg(site: SiteField) -> NDArray[np.float64]:
    """Return the station's field, shape (3,), in NED of the rig's frame (north = rig zero)."""
    azimuth_rad = math.radians(site.field_azimuth_deg)
    return np.array(
        [
            site.horizontal_mg * math.cos(azimuth_rad),
            site.horizontal_mg * math.sin(azimuth_rad),
            site.horizontal_mg * math.tan(math.radians(site.dip_deg)),
        ]
    )


def total_field_mg(site: SiteField) -> float:
    """Return the strength of the station's field."""
    return site.horizontal_mg / math.cos(math.radians(site.dip_deg))


def reference_heading_deg(readings: NDArray[np.void], site: SiteField) -> NDArray[np.float64]:
    """Return the magnetic heading, shape (n,), that a perfect module would send at each pose.

    It points as the seat does and also feels the fixture's iron, as the unit under test.
    """
    azimuth_deg, pitch_deg, roll_deg = seat_angles_deg(readings, site.seat)
    if not has_iron(site.seat):
        return wrap_360_deg(azimuth_deg - site.field_azimuth_deg)
    return heading_deg(expected_field_mg(readings, site), pitch_deg, roll_deg)


def heading_error_deg(
    heading_deg: NDArray[np.float64], readings: NDArray[np.void], site: SiteField
) -> NDArray[np.float64]:
    """Return heading minus the reference heading of the same poses, in (-180, 180]."""
    return wrap_180_deg(heading_deg - reference_heading_deg(readings, site))


def expected_field_mg(readings: NDArray[np.void], site: SiteField) -> NDArray[np.float64]:
    """Return the field in the unit's frame at each pose, shape (n, 3): station and fixture."""
    attitude = seat_attitude(readings, site.seat)
    seen_mg: NDArray[np.float64] = np.swapaxes(attitude, 1, 2) @ field_rig_mg(site)
    if has_iron(site.seat):
        seen_mg = seen_mg + np.array(site.seat.iron_mg)
    return seen_mg


def expected_force_g(
    readings: NDArray[np.void], seat: SeatPosition = SQUARE
) -> NDArray[np.float64]:
    """Return the specific force in the unit's frame at each pose, (n, 3); level (0, 0, -1)."""
    force_g: NDArray[np.float64] = -seat_attitude(readings, seat)[:, 2, :]
    return force_g


def expected_strength_mg(readings: NDArray[np.void], site: SiteField) -> float:
    """Return the mean strength of the field that a perfect module reads at the poses."""
    if not has_iron(site.seat):
        return total_field_mg(site)
    return float(np.mean(np.linalg.norm(expected_field_mg(readings, site), axis=1)))


def is_level(readings: NDArray[np.void]) -> NDArray[np.bool_]:
    """Return, shape (n,), which poses are level within `LEVEL_DEG`."""
    pitch_deg = np.abs(readings["rig_pitch_deg"])
    roll_deg = np.abs(readings["rig_roll_deg"])
    level: NDArray[np.bool_] = (pitch_deg < LEVEL_DEG) & (roll_deg < LEVEL_DEG)
    return level


def calibration_data(
    readings: NDArray[np.void],
    site: SiteField,
    *,
    field_sd_mg: float = POSE_FIELD_SD_MG,
    accel_sd_g: float = POSE_ACCEL_SD_G,
    rig_sd_deg: float = POSE_RIG_SD_DEG,
    with_acceleration: bool = True,
    paired: bool = True,
    in_seat: bool = True,
) -> CalibrationData:
    """Return what the fits take, from one READING a pose.

    `paired` is False where set and reset readings were made from one recorded value. The angles
    are those of the seat, or with `in_seat` False the rig's own, as if the seat were square and
    without iron.
    The run's fit step and `judge` both call it, so that they fit the same numbers.
    The encoder's error is the same whenever an angle comes back: the coefficients take up a
    part of it, so that chi2_reduced of good units is 0.4 to 0.8. The noise counts as known: a
    fit whose residuals it cannot explain is refused.
    """
    seat = site.seat if in_seat else SQUARE
    azimuth_deg, pitch_deg, roll_deg = seat_angles_deg(readings, seat)
    return CalibrationData(
        field_mg=np.array(readings["field_mg"], dtype=float),
        accel_g=np.array(readings["accel_g"], dtype=float) if with_acceleration else None,
        azimuth_deg=azimuth_deg,
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
        field_sd_mg=field_sd_mg,
        accel_sd_g=accel_sd_g,
        rig_sd_deg=rig_sd_deg,
        noise_known=True,
        offset_mg=np.array(readings["offset_mg"], dtype=float) if paired else None,
        station_field_mg=field_rig_mg(site),
        fixture_mg=np.array(seat.iron_mg, dtype=float) if has_iron(seat) else None,
    )


def recording_data(samples: NDArray[np.void]) -> CalibrationData:
    """Return what the fits take from the samples of a recording without a rig, one row a sample.

    Rows without set and reset reading, outside the dwell, or after the recording's end are
    left out; so is the acceleration where the module flags that it has none, and the offset
    of the pairs where it flags that they were made from one recorded value.
    """
    paired = samples["complete"] & 0b0011 == 0b0011
    ended = samples["flags"] & FLAG_REPLAY_ENDED != 0
    rows = samples[paired & ~ended & (samples["position"] != MOVING)]
    missing = np.any(rows["flags"] & FLAG_NO_ACCELERATION != 0)
    accelerated = not missing and bool(np.isfinite(rows["accel_g"]).all())
    synthesised = np.any(rows["flags"] & FLAG_SYNTHESISED != 0)
    return CalibrationData(
        field_mg=np.array((rows["set_mg"] - rows["reset_mg"]) / 2.0),
        accel_g=np.array(rows["accel_g"]) if accelerated else None,
        offset_mg=None if synthesised else np.array((rows["set_mg"] + rows["reset_mg"]) / 2.0),
    )
