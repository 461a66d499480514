"""What a reversal cannot hold for known, each as a random effect with its derivative on all poses.

An effect that several poses share (an encoder's error that comes back with the angle, a unit that
sits a little turned for a whole mounting) is one column that all of them share: it is never
averaged over them. Each column is the change of the readings by one standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.prediction import DOWN
from bench.calibration.tilt import ned_from_body
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.reversal_model import Mounted, SeatRows, SeatState

CROSS_AXIS_PER_MG2: Final = 1.0 / 8000.0**2
"""(set - reset)/2 of an AMR bridge holds H/(1 - (Ha/Hk)^2), Hk = 8 G (HMC1021 data sheet)."""
CUBIC_PER_MG2: Final = 0.2 / 400.0**3
"""Linearity error of 0.05 % of 400 mG (Caruso, PLANS 2000, Table 1)."""
PLAY_MG: Final = 0.16
"""Half width of the hysteresis: 0.08 % of 400 mG on the way up and down (Caruso, Table 1)."""
WAY_POINTS: Final = 12
"""Points on the way from pose to pose at which the hysteresis is followed."""
ACCEL_QUADRATIC_PER_G: Final = 0.0005
ACCEL_CUBIC_PER_G2: Final = 0.00025
"""Together 0.2 % of 2 g at the end of scale."""
GAIN_CHANGE: Final = 0.0005
"""Change of the sensitivity from one mounting to the next: -0.3 %/C times 0.15 C."""
ACCEL_CHANGE_G: Final = 0.0006
"""Change of the accelerometer's zero from one mounting to the next: 2 mg/C and wander."""
SAME_ANGLE_DEG: Final = 0.05
"""Angles of an axis that lie nearer are one place of its encoder."""
GROUPS: Final = ("encoder", "squareness", "seating", "field", "sensor")


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchDoubts:
    """Standard uncertainties of a station that a reversal has to live with.

    `one_cycle_deg`, `two_cycle_deg` and `fine_deg` are parts of each encoder's error;
    `seating_deg` is how far a unit that is put in again turns about each axis; `drift_mg` the
    change of the field from one mounting to the next; `gradient_mg` its difference between the
    axes' crossing and the sensor; `strength` the relative one of the station's field strength.
    """

    one_cycle_deg: float = 0.0115
    two_cycle_deg: float = 0.0115
    fine_deg: float = 0.0115
    squareness_deg: float = 0.01
    seating_deg: float = 0.01
    drift_mg: float = 0.05
    gradient_mg: float = 0.025
    strength: float = 0.002


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Effects:
    """Columns of all effects, shape (6 n, e), and the group of each."""

    columns: NDArray[np.float64]
    groups: tuple[str, ...]

    def of(self, group: str) -> NDArray[np.float64]:
        """Return the columns of one group, shape (6 n, g)."""
        return self.columns[:, [own == group for own in self.groups]]


def effects(state: SeatState, rows: SeatRows, data: Mounted, doubts: BenchDoubts) -> Effects:
    """Return every effect at a state of the model."""
    parts = {
        "encoder": _encoders(rows, data, doubts),
        "squareness": _squareness(rows, data, doubts),
        "seating": _seating(state, rows, data, doubts),
        "field": _field(state, rows, data, doubts),
        "sensor": [*_sensor(rows, data), *_hysteresis(state, rows, data)],
    }
    columns = [column for group in GROUPS for column in parts[group]]
    groups = tuple(group for group in GROUPS for _ in parts[group])
    stacked = np.array(columns).reshape(len(columns), data.raw.size)
    return Effects(columns=stacked.T, groups=groups)


def seating_axes(effect: Effects, mountings: int) -> NDArray[np.intp]:
    """Return the columns, shape (mountings, 3), of each mounting's turn about its three axes."""
    first = effect.groups.index("seating")
    return first + np.arange(3 * mountings).reshape(mountings, 3)


def _turned(rows: SeatRows, axes_inner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the readings' changes, (n, 6), by a turn of the inner axis about axes (n, 3), rad."""
    field = np.cross(rows.field_inner_mg, axes_inner)
    force = np.cross(rows.force_inner_g, axes_inner)
    return np.hstack(
        [
            np.einsum("nij,nj->ni", rows.to_field, field),
            np.einsum("nij,nj->ni", rows.to_force, force),
        ]
    )


def _encoders(rows: SeatRows, data: Mounted, doubts: BenchDoubts) -> list[NDArray[np.float64]]:
    """Return the harmonics of each encoder, and one fine error for each angle that it shows."""
    found = []
    for axis in range(3):
        angle_deg = data.angles_deg[:, axis]
        turn = _turned(rows, data.poses.axes_body[:, axis]) * np.deg2rad(1.0)
        for order, size_deg in ((1, doubts.one_cycle_deg), (2, doubts.two_cycle_deg)):
            phase_rad = np.deg2rad(order * angle_deg)
            waves = (np.cos(phase_rad), np.sin(phase_rad))
            found += [turn * (size_deg * wave)[:, None] for wave in waves]
        found += [turn * (doubts.fine_deg * at)[:, None] for at in _places(angle_deg).astype(float)]
    return found


def _places(angle_deg: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return, shape (places, n), which poses share one place of an encoder."""
    places: list[NDArray[np.bool_]] = []
    left = np.ones(len(angle_deg), dtype=bool)
    while left.any():
        first = angle_deg[int(np.argmax(left))]
        at = left & (np.abs(wrap_180_deg(angle_deg - first)) < SAME_ANGLE_DEG)
        places.append(at)
        left &= ~at
    return np.array(places)


def _squareness(rows: SeatRows, data: Mounted, doubts: BenchDoubts) -> list[NDArray[np.float64]]:
    """Return the skews of pitch and roll axis, and the tilt that turns with the azimuth."""
    pitch_rad, roll_rad = np.deg2rad(data.angles_deg[:, 1]), np.deg2rad(data.angles_deg[:, 2])
    sp, cp, sr, cr = np.sin(pitch_rad), np.cos(pitch_rad), np.sin(roll_rad), np.cos(roll_rad)
    none, one = np.zeros_like(sp), np.ones_like(sp)
    # the azimuth stage's forward axis, then the pitch stage's forward and down, seen from within
    outer = np.stack([cp, sp * sr, sp * cr], axis=1)
    forward = np.stack([one, none, none], axis=1)
    down = np.stack([none, sr, cr], axis=1)
    size_rad = np.deg2rad(doubts.squareness_deg)
    axes = (outer - forward, down - DOWN, outer)
    return [_turned(rows, axis) * size_rad for axis in axes]


def _seating(
    state: SeatState, rows: SeatRows, data: Mounted, doubts: BenchDoubts
) -> list[NDArray[np.float64]]:
    """Return the turns of the unit in the seat, three for each mounting."""
    size_rad = np.deg2rad(doubts.seating_deg)
    found = []
    for number in range(len(data.names)):
        here = (data.mounting == number)[:, None] * size_rad
        for axis in np.eye(3):
            field = np.cross(rows.field_unit_mg, axis) @ state.gain.T
            force = np.cross(rows.force_unit_g, axis) @ state.accel_gain.T
            found.append(np.hstack([field, force]) * here)
    return found


def _field(
    state: SeatState, rows: SeatRows, data: Mounted, doubts: BenchDoubts
) -> list[NDArray[np.float64]]:
    """Return the field's change from mounting to mounting, and its gradient at the sensor.

    A gradient G and the sensor's place r in the unit change the field there by C^T G C Q r: five
    numbers of a symmetric matrix without trace times three. All together have the size asked for.
    """
    still = np.zeros((len(data.raw), 3))
    found = []
    for number in range(len(data.names)):
        here = (data.mounting == number)[:, None] * doubts.drift_mg
        for axis in np.eye(3):
            change = np.einsum("nij,nj->ni", rows.to_field, data.poses.turned(axis))
            found.append(np.hstack([change * here, still]))
    inner_from_unit = state.inner_from_seat @ np.swapaxes(data.unit_from_seat, 1, 2)
    body, rig = data.poses.body_from_rig, np.swapaxes(data.poses.body_from_rig, 1, 2)
    changes = [
        np.einsum("nij,nj->ni", body @ gradient @ rig, inner_from_unit @ place)
        for gradient, place in product(_gradients(), np.eye(3))
    ]
    size = np.sqrt(sum(float((change**2).mean()) for change in changes))
    for change in changes:
        seen = np.einsum("nij,nj->ni", rows.to_field, change)
        found.append(np.hstack([seen * (doubts.gradient_mg / size), still]))
    return found


def _gradients() -> list[NDArray[np.float64]]:
    """Return the five symmetric matrices without trace, each of length 1."""
    found = []
    for first, second in ((0, 1), (0, 2), (1, 2)):
        matrix = np.zeros((3, 3))
        matrix[first, second] = matrix[second, first] = np.sqrt(0.5)
        found.append(matrix)
    found.append(np.diag([1.0, -1.0, 0.0]) / np.sqrt(2.0))
    found.append(np.diag([1.0, 1.0, -2.0]) / np.sqrt(6.0))
    return found


def _sensor(rows: SeatRows, data: Mounted) -> list[NDArray[np.float64]]:
    """Return what a linear sensor is not: cross-axis and bent characteristics, and slow change."""
    field, force = rows.modelled[:, :3], rows.modelled[:, 3:]
    found = []
    for axis in range(3):
        along = field[:, axis]
        found += [
            _alone(axis, CROSS_AXIS_PER_MG2 * along * field[:, across] ** 2)
            for across in range(3)
            if across != axis
        ]
        found.append(_alone(axis, CUBIC_PER_MG2 * along**3))
        pull = force[:, axis]
        found.append(_alone(3 + axis, ACCEL_QUADRATIC_PER_G * pull**2))
        found.append(_alone(3 + axis, ACCEL_CUBIC_PER_G2 * pull**3))
    for number in range(len(data.names)):
        here = (data.mounting == number).astype(float)
        gain = np.zeros((len(here), 6))
        gain[:, :3] = field * (GAIN_CHANGE * here)[:, None]
        found.append(gain)
        found += [_alone(3 + axis, ACCEL_CHANGE_G * here) for axis in range(3)]
    return found


def _hysteresis(state: SeatState, rows: SeatRows, data: Mounted) -> list[NDArray[np.float64]]:
    """Return what a play between field and reading leaves at each pose, one column an axis.

    The play follows the way from pose to pose; a mounting begins level at the rig's zero.
    """
    field_rig = data.poses.body_from_rig[0].T @ rows.field_inner_mg[0]
    angles_deg = _way(data)
    inner_from_rig = np.swapaxes(ned_from_body(*np.moveaxis(angles_deg, -1, 0)), -1, -2)
    unit_from_inner = data.unit_from_seat @ state.inner_from_seat.T
    seen = np.einsum("nij,npj->npi", state.gain @ unit_from_inner, inner_from_rig @ field_rig)
    left = np.empty((len(data.raw), 3))
    lagging = seen[0, 0]
    for pose, way in enumerate(seen):
        if pose and data.mounting[pose] != data.mounting[pose - 1]:
            lagging = way[0]
        for along in way:
            lagging = np.clip(lagging, along - PLAY_MG, along + PLAY_MG)
        left[pose] = lagging - way[-1]
    return [_alone(axis, left[:, axis]) for axis in range(3)]


def _way(data: Mounted) -> NDArray[np.float64]:
    """Return the rig's angles, shape (n, points, 3), on the shortest way to each pose."""
    begin = np.vstack([np.zeros(3), data.angles_deg[:-1]])
    first = np.append(True, data.mounting[1:] != data.mounting[:-1])
    begin[first] = 0.0
    change = data.angles_deg - begin
    change[:, 0] = wrap_180_deg(change[:, 0])
    share = np.arange(1, WAY_POINTS + 1) / WAY_POINTS
    return np.asarray(begin[:, None] + share[:, None] * change[:, None])


def _alone(equation: int, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return readings' changes, shape (n, 6), of one axis of one sensor."""
    change = np.zeros((len(values), 6))
    change[:, equation] = values
    return change
