"""Heading from two magnetic axes: the third axis from the dip, the dip from known tilts.

In Cho & Park's symbols X and Y are the readings of x and y over the horizontal field, theta (th)
is pitch, phi (ph) roll, psi the *magnetic* azimuth and lambda (l) the extended dip angle: the dip
that the normalised readings have, which gains and the height of the axes are part of.

Their (26), l = arctan((X (sin th sin ph - cos ph tan psi) - Y cos th) / (sin th cos ph tan psi -
sin ph)), diverges at an azimuth of 90 and 270 deg. Multiplied by cos psi it is linear in (sin l,
cos l) and holds at every azimuth,

    sin(l) d = cos(l) n
    d = sin th cos ph sin psi - sin ph cos psi
    n = X (sin th sin ph cos psi - cos ph sin psi) - Y cos th cos psi,

so that all samples together give l = atan2(sum w n d, sum w d d). The size of d is the sine of the
tilt times the sine of psi's distance from the blind azimuth, where tan psi = tan ph / sin th: pure
pitch says nothing at 0 and 180 deg, pure roll nothing at 90 and 270. An azimuth error e makes an
error of the dip of e cos(l)^2 cos th cos ph / d.

References
----------
.. [1] S. Y. Cho and C. G. Park, "A Calibration Technique for a Two-Axis Magnetic Compass in
   Telematics Devices", ETRI Journal 27(3), 2005: Theorem 1 (10), Theorem 2 (24), Theorem 3 (26).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import Cause

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

CAUSES: Final = (None, Cause.TOO_FEW, Cause.TILT_TOO_SMALL, Cause.BLIND_AZIMUTH)
"""What the numbers in `ExtendedDip.cause` mean."""
SMALLEST: Final = 2
SMALLEST_TILT_DEG: Final = 5.0
"""Rows of less tilt say too little of the dip and are left out."""
BLIND: Final = 0.1
"""Sine of the distance from the blind azimuth, 5.7 deg, that at least one row must exceed."""
LARGEST: Final = 1e6
"""Readings over the horizontal field beyond it are held there, so that nothing overflows."""
PASSES: Final = 3
"""Solutions with weights from the one before; the weights depend on the dip but weakly."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExtendedDip:
    """Extended dip angles of units; 0 where a cause refuses.

    Attributes
    ----------
    dip_deg, dip_sd_deg : ndarray, shape (...)
        Angle and standard deviation from the noise that was given, not from the scatter.
    chi2_reduced : ndarray, shape (...)
        Of the whitened residuals: above 1 the readings scatter more than the noise given.
    residual_rms : ndarray, shape (...)
        RMS, in units of the horizontal field, of what the readings leave of the identity.
    by_x_deg, by_y_deg : ndarray, shape (..., n)
        Derivative of the angle by the normalised x and y of each row.
    rows : ndarray, shape (...)
        Rows that were tilted enough to count.
    cause : ndarray of int8, shape (...)
        Index into `CAUSES`, 0 where accepted.
    """

    dip_deg: NDArray[np.float64]
    dip_sd_deg: NDArray[np.float64]
    chi2_reduced: NDArray[np.float64]
    residual_rms: NDArray[np.float64]
    by_x_deg: NDArray[np.float64]
    by_y_deg: NDArray[np.float64]
    rows: NDArray[np.int64]
    cause: NDArray[np.int8]


def estimated_z_mg(
    field_mg: ArrayLike,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
    *,
    horizontal_mg: ArrayLike,
    dip_deg: ArrayLike,
) -> NDArray[np.float64]:
    """Return the field along body z, shape (...), that x, y, attitude and dip leave (Theorem 1).

    z = (H tan(lambda) + x sin(theta) - y cos(theta) sin(phi)) / (cos(theta) cos(phi)): the
    vertical field is known, so one axis of three follows from the others [1]_ (10), (16).

    Parameters
    ----------
    field_mg : array-like, shape (..., 2 or more)
        Corrected field; only x and y count.
    pitch_deg, roll_deg : array-like, shape (...)
        Below 90 deg.
    horizontal_mg, dip_deg : array-like, shape (...)
        Horizontal field in the unit of `field_mg`, and dip.

    Examples
    --------
    >>> z_mg = estimated_z_mg([250.0, 0.0], 0.0, 0.0, horizontal_mg=250.0, dip_deg=60.0)
    >>> round(float(z_mg), 3)
    433.013
    """
    field = np.asarray(field_mg, dtype=float)
    pitch_rad, roll_rad = np.deg2rad(pitch_deg), np.deg2rad(roll_deg)
    down_mg = np.asarray(horizontal_mg, dtype=float) * np.tan(np.deg2rad(dip_deg))
    level = field[..., 0] * np.sin(pitch_rad) - field[..., 1] * np.cos(pitch_rad) * np.sin(roll_rad)
    return np.asarray((down_mg + level) / (np.cos(pitch_rad) * np.cos(roll_rad)))


def checking_z_mg(
    raw_mg: NDArray[np.float64],
    estimated_mg: NDArray[np.float64],
    rows: NDArray[np.bool_] | slice = slice(None),
) -> NDArray[np.float64]:
    """Return z of an uncalibrated checking axis, shape (n,), at the estimate's offset and gain.

    Both are taken out by least squares over `rows`.

    Parameters
    ----------
    raw_mg, estimated_mg : ndarray, shape (n,)
        The axis's readings, and the estimates of `estimated_z_mg`.
    """
    design = np.column_stack([raw_mg, np.ones(len(raw_mg))])
    return np.asarray(design @ np.linalg.lstsq(design[rows], estimated_mg[rows], rcond=None)[0])


def extended_dip_batch(
    x: ArrayLike,
    y: ArrayLike,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
    azimuth_deg: ArrayLike,
    *,
    field_sd: ArrayLike = 0.0014,
    azimuth_sd_deg: float = 0.02,
    tilt_sd_deg: float = 0.02,
    smallest: int = SMALLEST,
) -> ExtendedDip:
    """Return the extended dip angle of each unit by weighted least squares (Theorem 3).

    The weights come from the noise of each row, carried through its residual, so that rows of
    little tilt or near the blind azimuth count little; the paper's cut at 30 deg is not needed.

    Parameters
    ----------
    x, y : array-like, shape (..., n)
        Readings over the horizontal field: level, x = cos(azimuth), y = -sin(azimuth).
    pitch_deg, roll_deg, azimuth_deg : array-like, broadcast to (..., n)
        Attitude; azimuth from *magnetic* north: with a declination of 9 deg left in, 48.72 deg
        become 53.4 or 43.0 at an azimuth of 65, pitch 35, roll -15.
    field_sd : array-like, shape (...)
        Noise of x and y over the horizontal field; default 0.35 mG of 250.
    azimuth_sd_deg, tilt_sd_deg : float
        Of each row, independent. An error that all rows share is not in the result.
    smallest : int
        Rows needed; 1 gives the paper's value of a single sample.

    Returns
    -------
    ExtendedDip
        Refused with TOO_FEW, TILT_TOO_SMALL (no row tilted by 5 deg) or BLIND_AZIMUTH.

    Raises
    ------
    ValueError
        If a value is not finite.

    Examples
    --------
    >>> psi = np.deg2rad(45.0)  # pitch 30 deg at an azimuth of 45 deg, dip 60 deg
    >>> x = np.cos(psi) * np.cos(np.pi / 6) - np.sin(np.pi / 6) * np.tan(np.pi / 3)
    >>> found = extended_dip_batch([x, x], [-np.sin(psi)] * 2, 30.0, 0.0, 45.0)
    >>> round(float(found.dip_deg), 9)
    60.0
    """
    X, Y, th, ph, psi = np.broadcast_arrays(
        *(np.asarray(value, dtype=float) for value in (x, y)),
        *(np.deg2rad(np.asarray(a, float)) for a in (pitch_deg, roll_deg, azimuth_deg)),
    )
    if not all(np.isfinite(values).all() for values in (X, Y, th, ph, psi)):
        message = "readings and angles must be finite; instead received a value that is not"
        raise ValueError(message)
    X, Y = np.clip(X, -LARGEST, LARGEST), np.clip(Y, -LARGEST, LARGEST)
    d, n = _identity(X, Y, th, ph, psi)
    tilt = np.sqrt(np.maximum(1.0 - (np.cos(th) * np.cos(ph)) ** 2, 0.0))
    used = tilt >= np.sin(np.deg2rad(SMALLEST_TILT_DEG))
    cause = _cause(d, tilt, used, smallest)
    sds = np.asarray(field_sd, float)[..., None], *np.deg2rad([azimuth_sd_deg, tilt_sd_deg])
    weight = np.where(used, 1.0, 0.0)
    for _ in range(PASSES):
        dd = (weight * d * d).sum(axis=-1)
        dip = np.arctan2((weight * n * d).sum(axis=-1), np.where(dd > 0.0, dd, 1.0))
        by_x, by_y, variance = _spread(dip[..., None], X, Y, th, ph, psi, sds)
        weight = np.where(used, 1.0 / np.maximum(variance, 1e-18), 0.0)
    sin_l, cos_l = np.sin(dip)[..., None], np.cos(dip)[..., None]
    residual, slope = sin_l * d - cos_l * n, cos_l * d + sin_l * n
    return _dip(dip, residual, slope, weight, (by_x, by_y), used, cause)


def _dip(
    dip: NDArray[np.float64],
    residual: NDArray[np.float64],
    slope: NDArray[np.float64],
    weight: NDArray[np.float64],
    by_field: tuple[NDArray[np.float64], NDArray[np.float64]],
    used: NDArray[np.bool_],
    cause: NDArray[np.int8],
) -> ExtendedDip:
    """Return the result from the residual, its derivative by the dip, and by x and y."""
    information = np.maximum((weight * slope**2).sum(axis=-1), 1e-30)
    by_residual_deg = -np.rad2deg(weight * slope / information[..., None])
    rows = used.sum(axis=-1)
    accepted = cause == 0
    every = accepted[..., None]
    chi2 = (weight * residual**2).sum(axis=-1) / np.maximum(rows - 1, 1)
    square = np.where(used, residual**2, 0.0).sum(axis=-1) / np.maximum(rows, 1)
    return ExtendedDip(
        dip_deg=np.where(accepted, np.rad2deg(dip), 0.0),
        dip_sd_deg=np.where(accepted, np.rad2deg(np.sqrt(1.0 / information)), 0.0),
        chi2_reduced=np.where(accepted, chi2, 0.0),
        residual_rms=np.where(accepted, np.sqrt(square), 0.0),
        by_x_deg=np.where(every, by_residual_deg * by_field[0], 0.0),
        by_y_deg=np.where(every, by_residual_deg * by_field[1], 0.0),
        rows=rows,
        cause=cause,
    )


def _identity(
    X: NDArray[np.float64],
    Y: NDArray[np.float64],
    th: NDArray[np.float64],
    ph: NDArray[np.float64],
    psi: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return d and n of sin(l) d = cos(l) n."""
    d = np.sin(th) * np.cos(ph) * np.sin(psi) - np.sin(ph) * np.cos(psi)
    by_x = np.sin(th) * np.sin(ph) * np.cos(psi) - np.cos(ph) * np.sin(psi)
    return d, X * by_x - Y * np.cos(th) * np.cos(psi)


def _cause(
    d: NDArray[np.float64], tilt: NDArray[np.float64], used: NDArray[np.bool_], smallest: int
) -> NDArray[np.int8]:
    shown = np.where(used, np.abs(d), 0.0).max(axis=-1, initial=0.0)
    most = np.where(used, tilt, 0.0).max(axis=-1, initial=0.0)
    too_few = np.full(shown.shape, d.shape[-1] < smallest)
    conditions = (too_few, used.sum(axis=-1) < smallest, shown < BLIND * most)
    return np.asarray(np.select(conditions, (1, 2, 3), 0), dtype=np.int8)


def _spread(
    dip: NDArray[np.float64],
    X: NDArray[np.float64],
    Y: NDArray[np.float64],
    th: NDArray[np.float64],
    ph: NDArray[np.float64],
    psi: NDArray[np.float64],
    sds: tuple[NDArray[np.float64], float, float],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the residual's derivatives by X and Y, and its variance, each (..., n)."""
    sin_l, cos_l = np.sin(dip), np.cos(dip)
    sth, cth, sph, cph = np.sin(th), np.cos(th), np.sin(ph), np.cos(ph)
    spsi, cpsi = np.sin(psi), np.cos(psi)
    by_x = -cos_l * (sth * sph * cpsi - cph * spsi)
    by_y = cos_l * cth * cpsi
    by_psi = sin_l * (sth * cph * cpsi + sph * spsi) + cos_l * (
        X * (sth * sph * spsi + cph * cpsi) - Y * cth * spsi
    )
    by_th = sin_l * cth * cph * spsi - cos_l * (X * cth * sph * cpsi + Y * sth * cpsi)
    by_ph = -sin_l * (sth * sph * spsi + cph * cpsi) - cos_l * X * (sth * cph * cpsi + sph * spsi)
    field_sd, azimuth_sd_rad, tilt_sd_rad = sds
    variance = (
        field_sd**2 * (by_x**2 + by_y**2)
        + azimuth_sd_rad**2 * by_psi**2
        + tilt_sd_rad**2 * (by_th**2 + by_ph**2)
    )
    return by_x, by_y, variance
