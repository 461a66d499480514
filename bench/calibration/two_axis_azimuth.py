"""Whether the azimuths that x and y were aligned to are magnetic: from their tilts.

A level turn cannot tell an azimuth error e that all readings share from a sensor that is turned
about z: an alignment to those azimuths turns x and y by e, and every level heading agrees. Tilted
it shows, because the vertical field stays in the plane of the tilt whatever the azimuth is, and
the aligned axes turn it with the rest: at a pitch of 30 deg and dip 60 by 0.87 of the horizontal
field times e.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

SMALLEST_INFORMATION: Final = 1e-6
"""Sum of squares of what e of 1 rad moves, beside the nuisances, below which it is not seen."""


def azimuth_error_batch(
    x: ArrayLike,
    y: ArrayLike,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
    azimuth_deg: ArrayLike,
    *,
    dip_deg: ArrayLike,
    field_sd: ArrayLike = 0.0014,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return by how much true magnetic azimuths exceed those given, and its standard deviation.

    Least squares on both axes of the tilted rows, to first order in e, with a change of the dip
    and the shares of the body's vertical field that x and y see as nuisances.

    Parameters
    ----------
    x, y : array-like, shape (..., n)
        Readings over the horizontal field, of axes aligned to `azimuth_deg` on a level turn.
    pitch_deg, roll_deg, azimuth_deg : array-like, broadcast to (..., n)
        Attitude of the tilted rows, and magnetic azimuth as it is believed to be.
    dip_deg : array-like, shape (...)
        Extended dip angle.
    field_sd : array-like, shape (...)
        Standard deviation of x and y over the horizontal field.

    Returns
    -------
    error_deg, sd_deg : ndarray, shape (...)
        0 and infinity where the tilts do not show it.

    Raises
    ------
    ValueError
        If a value is not finite.

    Examples
    --------
    >>> pitch_rad, psi = np.deg2rad(30.0), np.deg2rad([1.0, 91.0, 181.0, 271.0])  # truly
    >>> x = np.cos(psi) * np.cos(pitch_rad) - np.tan(np.pi / 3) * np.sin(pitch_rad)
    >>> y, e = -np.sin(psi), np.deg2rad(1.0)
    >>> aligned = x * np.cos(e) - y * np.sin(e), x * np.sin(e) + y * np.cos(e)
    >>> found = azimuth_error_batch(*aligned, 30.0, 0.0, [0.0, 90.0, 180.0, 270.0], dip_deg=60.0)
    >>> round(float(found[0]), 2)
    1.0
    """
    X, Y, th, ph, psi = np.broadcast_arrays(
        *(np.asarray(value, dtype=float) for value in (x, y)),
        *(np.deg2rad(np.asarray(a, float)) for a in (pitch_deg, roll_deg, azimuth_deg)),
    )
    if not all(np.isfinite(values).all() for values in (X, Y, th, ph, psi)):
        message = "readings and angles must be finite; instead received a value that is not"
        raise ValueError(message)
    lam = np.deg2rad(np.asarray(dip_deg, dtype=float))[..., None]
    sth, cth, sph, cph = np.sin(th), np.cos(th), np.sin(ph), np.cos(ph)
    spsi, cpsi, down = np.sin(psi), np.cos(psi), np.tan(lam)
    bx = cpsi * cth - down * sth
    by = cpsi * sth * sph - spsi * cph + down * cth * sph
    risen = cpsi * sth * cph + spsi * sph + down * (cth * cph - 1.0)
    none = np.zeros_like(bx)
    by_error = np.concatenate([-by - spsi * cth, bx - spsi * sth * sph - cpsi * cph], axis=-1)
    by_dip = np.concatenate([-sth, cth * sph], axis=-1)
    by_shares = (np.concatenate(pair, axis=-1) for pair in ((risen, none), (none, risen)))
    others = np.stack([by_dip, *by_shares], axis=-1)
    left = np.concatenate([X - bx, Y - by], axis=-1)
    alone = by_error - np.einsum(
        "...nk,...k->...n", others, np.einsum("...kn,...n->...k", np.linalg.pinv(others), by_error)
    )
    information = (alone**2).sum(axis=-1)
    seen = information > SMALLEST_INFORMATION
    safe = np.where(seen, information, 1.0)
    error_deg = np.where(seen, np.rad2deg((alone * left).sum(axis=-1) / safe), 0.0)
    sd_deg = np.where(seen, np.rad2deg(np.asarray(field_sd, float) / np.sqrt(safe)), np.inf)
    return error_deg, sd_deg
