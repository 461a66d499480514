"""Normalisation and extended dip angle of many units of two axes, with their covariance.

By the half-ranges of a level turn as Cho & Park (27)-(28), or by the affine map from its known
azimuths; then Theorem 3 on the tilted readings. The dip's uncertainty holds that of the turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.affine_turn import affine_slopes, affine_turn_batch
from bench.calibration.level_kernel import LARGEST_MG
from bench.calibration.level_turn import amplitude_slopes
from bench.calibration.min_max import min_max_batch
from bench.calibration.two_axis import ExtendedDip, extended_dip_batch

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bench.calibration.level_kernel import LevelFits


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwoAxisFits:
    """Normalisation and extended dip angle of many units; units are the leading axes (...).

    Attributes
    ----------
    turn : LevelFits
        Normalisation of x and y, with its own cause.
    dip : ExtendedDip
        With its own cause; of a unit whose turn was refused it means nothing.
    covariance : ndarray, shape (..., p + 1, p + 1)
        Of the turn's parameters, then the extended dip angle in degrees.
    slopes : ndarray, shape (..., p, 2, 2)
        Derivative of the turn's matrix by its parameters.
    cause : ndarray of int8, shape (...)
        0 accepted, 1 the turn was refused, 2 the dip was.
    """

    turn: LevelFits
    dip: ExtendedDip
    covariance: NDArray[np.float64]
    slopes: NDArray[np.float64]
    cause: NDArray[np.int8]


def two_axis_batch(
    turn_mg: ArrayLike,
    turn_azimuth_deg: ArrayLike | None,
    tilted_mg: ArrayLike,
    azimuth_deg: ArrayLike,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
    *,
    horizontal_mg: ArrayLike | None = None,
    field_sd_mg: float = 0.5,
    rig_sd_deg: float = 0.02,
) -> TwoAxisFits:
    """Return normalisation and extended dip angle of each unit.

    Parameters
    ----------
    turn_mg : array-like, shape (..., n, 2)
        Level readings.
    turn_azimuth_deg : array-like, broadcast to (..., n), or None
        Magnetic azimuths for the affine map; None takes the half-ranges.
    tilted_mg : array-like, shape (..., m, 2)
        Tilted readings.
    azimuth_deg, pitch_deg, roll_deg : array-like, broadcast to (..., m)
        Their attitudes; magnetic azimuth.
    horizontal_mg : array-like, shape (...), optional
        Horizontal field that the corrected readings shall have.
    field_sd_mg, rig_sd_deg : float
        Of one reading an axis, and of each angle.
    """
    turn, slopes = _normalised(turn_mg, turn_azimuth_deg, horizontal_mg, field_sd_mg, rig_sd_deg)
    raw_mg = np.clip(np.asarray(tilted_mg, dtype=float), -LARGEST_MG, LARGEST_MG)
    unit = turn.corrected_mg(raw_mg) / turn.horizontal_mg[..., None, None]
    dip = extended_dip_batch(
        unit[..., 0],
        unit[..., 1],
        pitch_deg,
        roll_deg,
        azimuth_deg,
        field_sd=field_sd_mg / turn.horizontal_mg,
        azimuth_sd_deg=rig_sd_deg,
        tilt_sd_deg=rig_sd_deg,
    )
    cause = np.where(turn.cause != 0, 1, np.where(dip.cause != 0, 2, 0)).astype(np.int8)
    covariance = _covariance(turn, slopes, dip, raw_mg)
    return TwoAxisFits(turn=turn, dip=dip, covariance=covariance, slopes=slopes, cause=cause)


def _normalised(
    turn_mg: ArrayLike,
    azimuth_deg: ArrayLike | None,
    horizontal_mg: ArrayLike | None,
    field_sd_mg: float,
    azimuth_sd_deg: float,
) -> tuple[LevelFits, NDArray[np.float64]]:
    """Return offset and matrix of the turn, and the matrix's derivative by their parameters."""
    if azimuth_deg is None:
        extremes = min_max_batch(turn_mg, field_sd_mg, horizontal_mg=horizontal_mg)
        return extremes, amplitude_slopes(extremes.matrix, extremes.amplitude_mg)
    turn = affine_turn_batch(
        turn_mg,
        azimuth_deg,
        horizontal_mg=horizontal_mg,
        field_sd_mg=field_sd_mg,
        azimuth_sd_deg=azimuth_sd_deg,
    )
    return turn, affine_slopes(turn.matrix)


def _covariance(
    turn: LevelFits,
    slopes: NDArray[np.float64],
    dip: ExtendedDip,
    raw_mg: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the covariance of the turn's parameters and of the dip, which depends on them."""
    centred = raw_mg - turn.offset_mg[..., None, :]
    by_corrected = np.stack([dip.by_x_deg, dip.by_y_deg], axis=-1)
    by_corrected = by_corrected / turn.horizontal_mg[..., None, None]
    by_parameter = np.einsum("...mi,...pij,...mj->...p", by_corrected, slopes, centred)
    by_parameter[..., :2] -= np.einsum("...mi,...ij->...j", by_corrected, turn.matrix)
    shared = np.einsum("...pq,...q->...p", turn.covariance, by_parameter)
    variance = dip.dip_sd_deg**2 * np.maximum(dip.chi2_reduced, 1.0)
    variance = variance + np.einsum("...p,...p->...", by_parameter, shared)
    upper = np.concatenate([turn.covariance, shared[..., None]], axis=-1)
    lower = np.concatenate([shared, variance[..., None]], axis=-1)[..., None, :]
    return np.concatenate([upper, lower], axis=-2)
