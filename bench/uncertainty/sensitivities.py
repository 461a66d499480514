"""Derivatives of the module's heading at each pose, by what reaches its sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.fit import Fit
from bench.uncertainty.seat_heading import ned_from_seat
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

_STEP_MG: Final = 0.05
_STEP_G: Final = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivities:
    """Derivatives of the heading at n poses.

    Attributes
    ----------
    angles_deg : ndarray, shape (n, 3)
        Azimuth, pitch and roll of the rig.
    rotation : ndarray, shape (n, 3, 3)
        ned_from_seat of the rig's angles.
    raw_field, raw_force : ndarray, shape (n, 3)
        By the raw reading of each axis, deg/mG and deg/g: what the sensor itself adds.
    seat_field, ned_field : ndarray, shape (n, 3)
        By a field that comes to the site's, deg/mG, in the frame of the seat and in NED.
    raw_turn : ndarray, shape (n, 3)
        Change of each raw reading with the azimuth, mG/deg: which way a turn approaches it.
    """

    angles_deg: NDArray[np.float64]
    rotation: NDArray[np.float64]
    raw_field: NDArray[np.float64]
    raw_force: NDArray[np.float64]
    seat_field: NDArray[np.float64]
    ned_field: NDArray[np.float64]
    raw_turn: NDArray[np.float64]


def heading_sensitivities(
    readings: NDArray[np.void], fit: Fit, index_deg: float = 0.0
) -> Sensitivities:
    """Return the derivatives at poses, by central differences of the unit's own heading formula.

    Parameters
    ----------
    readings : ndarray of READING, shape (n,)
    fit : Fit
        The coefficients that the module uses; of a fit for two axes its formula is taken.
    index_deg : float
        Turn of the seat, as the station's record has it.
    """
    field_mg = fit.corrected_mg(readings["field_mg"])
    force_g = fit.corrected_g(readings["accel_g"])
    by_field, by_force = _by_corrected(_corrected_formula(fit), field_mg, force_g)
    angles_deg = np.stack(
        [readings[f"rig_{name}_deg"] for name in ("azimuth", "pitch", "roll")], axis=-1
    )
    rotation = ned_from_seat(angles_deg, index_deg)
    matrix = _matrix(fit.matrix)
    turn = np.cross(field_mg, rotation[:, 2, :]) @ np.linalg.pinv(matrix).T
    return Sensitivities(
        angles_deg=angles_deg,
        rotation=rotation,
        raw_field=by_field @ matrix,
        raw_force=by_force @ _matrix(fit.accel_matrix),
        seat_field=by_field,
        ned_field=np.einsum("nij,nj->ni", rotation, by_field),
        raw_turn=np.deg2rad(turn),
    )


def _corrected_formula(fit: Fit) -> Fit:
    """Return a fit with the same heading formula for readings that are corrected already."""
    return Fit(
        method=fit.method,
        offset_mg=np.zeros(3),
        matrix=np.eye(3),
        accel_offset_g=np.zeros(3),
        accel_matrix=np.eye(3),
        extended_dip_deg=fit.extended_dip_deg,
        extra=fit.extra,
    )


def _by_corrected(
    formula: Fit, field_mg: NDArray[np.float64], force_g: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the heading's derivatives, each (n, 3), by corrected field and corrected force."""
    found = []
    for which, step in ((0, _STEP_MG), (1, _STEP_G)):
        shifts = np.concatenate([np.eye(3), -np.eye(3)])[:, None, :] * step
        vectors = [field_mg[None], force_g[None]]
        vectors[which] = vectors[which] + shifts
        field, force = np.broadcast_arrays(*vectors)
        heading_deg = compensated_heading_deg(formula, np.array(field), np.array(force))
        found.append(wrap_180_deg(heading_deg[:3] - heading_deg[3:]).T / (2.0 * step))
    return found[0], found[1]


def _matrix(matrix: NDArray[np.float64] | None) -> NDArray[np.float64]:
    return np.eye(3) if matrix is None else matrix
