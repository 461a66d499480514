"""What the bench does not know of the reference heading and of the field at the sensor.

Calibration and verification stand on the same rig, seat and field: none of these lines is
divided by the root of the number of poses, and each is one draw wherever it is one quantity.
Expanded uncertainties of the station's record are halved (k = 2).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from bench.uncertainty.contribution import Contribution, once_an_angle
from bench.uncertainty.seat_heading import heading_derivative

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.station import Station
    from bench.uncertainty.sensitivities import Sensitivities

COVERAGE_FACTOR: Final = 2.0
"""k of every expanded uncertainty, here and in the station's record."""
REFERENCE_FIELD: Final = "reference_mg"
"""Field of a READING that holds what the reference magnetometer read, if there is one."""
SQUARENESS: Final = ("azimuth_pitch_squareness", "pitch_roll_squareness")


def bench_contributions(
    readings: NDArray[np.void],
    by: Sensitivities,
    station: Station,
    baseline_mg: NDArray[np.float64] | None = None,
) -> tuple[Contribution, ...]:
    """Return the bench's lines of the budget; arguments as for `heading_budget`."""
    around, seat = station.surroundings, station.seat
    azimuth_deg = by.angles_deg[:, 0]

    def of(*imperfections: str) -> NDArray[np.float64]:
        return _of(by, seat.index_deg, imperfections)

    return (
        _line("encoder, one cycle", around.u_one_cycle_deg, "deg", _cycles(azimuth_deg, 1)),
        _line("encoder, two cycles", around.u_two_cycle_deg, "deg", _cycles(azimuth_deg, 2)),
        _line("encoder, fine", around.u_fine_deg, "deg", once_an_angle(1.0, azimuth_deg)),
        _line("pitch and roll encoders", station.u_rig_deg, "deg", of("pitch", "roll")),
        _line("squareness and wobble", around.u_squareness_deg, "deg", of(*SQUARENESS)),
        _line("base level", around.u_base_level_deg, "deg", of("base_north", "base_east")),
        _line("seat index", seat.u_index_deg, "deg", of("index")),
        _line("seat level", seat.u_level_deg, "deg", of("level_pitch", "level_roll")),
        _line("fixture iron", seat.u_iron_mg, "mG", by.seat_field[:, :2]),
        _line("fixture iron, down", seat.u_iron_down_mg, "mG", by.seat_field[:, 2:]),
        _line("field gradient", around.u_gradient_mg, "mG", _gradient(by)),
        _line("field azimuth", station.u_field_azimuth_deg, "deg", np.ones((len(readings), 1))),
        _drift(_seen_by_reference_mg(readings, baseline_mg), by, around.u_drift_mg),
    )


def _line(
    name: str,
    expanded: float,
    unit: str,
    sensitivities: NDArray[np.float64],
    *,
    source: Literal["A", "B"] = "B",
) -> Contribution:
    value = expanded / COVERAGE_FACTOR
    return Contribution(
        name=name,
        source=source,
        distribution="normal, U/2",
        group="bench",
        shared=True,
        value=value,
        unit=unit,
        columns_deg=sensitivities * value,
    )


def _cycles(azimuth_deg: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Return cosine and sine: two amplitudes of the same size make one size at every angle."""
    phase_rad = order * np.deg2rad(azimuth_deg)
    return np.stack([np.cos(phase_rad), np.sin(phase_rad)], axis=-1)


def _of(by: Sensitivities, index_deg: float, imperfections: tuple[str, ...]) -> NDArray[np.float64]:
    return np.stack(
        [heading_derivative(by.angles_deg, name, index_deg) for name in imperfections], axis=-1
    )


def _gradient(by: Sensitivities) -> NDArray[np.float64]:
    """Return the sensitivities, shape (n, 27), to a field that changes with the sensor's place.

    The sensor stands off the axes' crossing by a vector of the seat that turns with it, and each
    component of the field changes along it. Nothing is known of the direction: the covariance of
    the change at two attitudes is trace(R1^T R2)/3 of that at one, for each component.
    """
    n = len(by.rotation)
    place = by.rotation.reshape(n, 9) / math.sqrt(3.0)
    return (by.ned_field[:, :, None] * place[:, None, :]).reshape(n, 27)


def _drift(seen_mg: float, by: Sensitivities, u_drift_mg: float) -> Contribution:
    """Return the drift's line: the station's U, or what the reference saw if that is more."""
    expanded_mg = COVERAGE_FACTOR * seen_mg
    if expanded_mg > u_drift_mg:
        return _line("site field drift", expanded_mg, "mG", by.ned_field, source="A")
    return _line("site field drift", u_drift_mg, "mG", by.ned_field)


def _seen_by_reference_mg(
    readings: NDArray[np.void], baseline_mg: NDArray[np.float64] | None
) -> float:
    """Return the RMS change of the reference's readings, an axis; 0 without one.

    It counts from the run's start where that is known: a step between calibration and
    verification, too small to spoil a pose, is the same in all these readings.
    """
    if REFERENCE_FIELD not in (readings.dtype.names or ()):
        return 0.0
    field_mg = readings[REFERENCE_FIELD]
    field_mg = field_mg[np.isfinite(field_mg).all(axis=1)]
    if not len(field_mg):
        return 0.0
    start_mg = field_mg.mean(axis=0) if baseline_mg is None else baseline_mg
    return float(np.sqrt(np.mean((field_mg - start_mg) ** 2)))
