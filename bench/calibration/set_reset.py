"""What set and reset readings say of field, bridge offset, cross-axis term and straps.

A bridge reads set = S H/(1 + C/Hk) + b and reset = -S H/(1 - C/Hk) + b, with C the field along
the film's other axis. Half the difference is the field; half the sum is **not** the offset: it
carries -H C/Hk, up to 2.5 mG (0.7 deg) that turns with the heading, and averaging over headings
does not remove it where there is hard iron. So it is regressed on 1 and H C.

References
----------
.. [1] M. J. Caruso, PLANS 2000, equations (5)-(7).
.. [2] J. Skula, "New Method for Magnetometer Offset Compensation", 2010, equation (1).
.. [3] P. Ripka et al., Sensors and Actuators A 2006: cross-axis term of AMR bridges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

CROSS_AXIS: Final = (1, 0, 0)
"""Index of the axis whose field acts across each bridge: y on x, x on y, x on z."""
SMALLEST: Final = 4
NOT_FLIPPING: Final = 0.2
"""Range of the half difference against that of the half sum below which a strap is dead."""
MG_PER_G: Final = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SetResetCheck:
    """Result of the set/reset check; every array has shape (3,), for x, y, z.

    Attributes
    ----------
    bridge_offset_mg, bridge_offset_sd_mg : ndarray
        Offset of the bridge without the cross-axis term.
    hk_g, hk_sd_g : ndarray
        Film anisotropy field; where `hk_observed` is False a lower bound (two standard
        deviations), and its standard deviation is 0.
    hk_observed : ndarray of bool
        Whether the cross-axis term stands out from the noise.
    amplitude_mg : ndarray
        Largest |set - reset|/2.
    symmetry, symmetry_sd : ndarray
        Gain after set over gain after reset: 1 for a sound strap, 0 where the reading does
        not flip at all.
    residual_rms_mg : ndarray
        RMS of the half sum that the regression leaves.
    """

    bridge_offset_mg: NDArray[np.float64]
    bridge_offset_sd_mg: NDArray[np.float64]
    hk_g: NDArray[np.float64]
    hk_sd_g: NDArray[np.float64]
    hk_observed: NDArray[np.bool_]
    amplitude_mg: NDArray[np.float64]
    symmetry: NDArray[np.float64]
    symmetry_sd: NDArray[np.float64]
    residual_rms_mg: NDArray[np.float64]


def field_and_offset_mg(
    set_mg: NDArray[np.float64], reset_mg: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return ((set - reset)/2, (set + reset)/2), each of the readings' shape [1]_ [2]_.

    >>> field, offset = field_and_offset_mg(np.array([130.0]), np.array([-70.0]))
    >>> field.item(), offset.item()
    (100.0, 30.0)
    """
    return (set_mg - reset_mg) / 2.0, (set_mg + reset_mg) / 2.0


def check_set_reset(set_mg: NDArray[np.float64], reset_mg: NDArray[np.float64]) -> SetResetCheck:
    """Estimate bridge offset, Hk and strap symmetry of each axis.

    Parameters
    ----------
    set_mg, reset_mg : ndarray, shape (n, 3), n >= 4
        Readings at several headings (24 of a level turn, or all poses).

    Raises
    ------
    ValueError
        If there are fewer than 4 readings, shapes differ, or a value is not finite.
    """
    set_mg, reset_mg = np.asarray(set_mg, dtype=float), np.asarray(reset_mg, dtype=float)
    if set_mg.shape != reset_mg.shape or set_mg.ndim != 2 or len(set_mg) < SMALLEST:
        message = (
            f"set_mg and reset_mg must be of one shape (n, 3) with n >= {SMALLEST}; instead "
            f"received {set_mg.shape} and {reset_mg.shape}"
        )
        raise ValueError(message)
    if not (np.isfinite(set_mg).all() and np.isfinite(reset_mg).all()):
        message = "set_mg and reset_mg must be finite; instead received a value that is not"
        raise ValueError(message)
    field_mg, offset_mg = field_and_offset_mg(set_mg, reset_mg)
    axes = [
        _axis(field_mg[:, axis], field_mg[:, CROSS_AXIS[axis]], offset_mg[:, axis])
        for axis in range(3)
    ]
    columns = np.array(axes).T
    return SetResetCheck(
        bridge_offset_mg=columns[0],
        bridge_offset_sd_mg=columns[1],
        hk_g=columns[2],
        hk_sd_g=columns[3],
        hk_observed=columns[4] > 0.0,
        amplitude_mg=np.abs(field_mg).max(axis=0),
        symmetry=columns[5],
        symmetry_sd=columns[6],
        residual_rms_mg=columns[7],
    )


def _axis(
    along_mg: NDArray[np.float64], across_mg: NDArray[np.float64], sum_mg: NDArray[np.float64]
) -> tuple[float, ...]:
    if np.ptp(along_mg) < NOT_FLIPPING * max(np.ptp(sum_mg), np.abs(sum_mg).max() * 0.01):
        return _not_flipping(along_mg, across_mg, sum_mg)
    product = along_mg * across_mg / MG_PER_G
    with_gain = len(along_mg) >= 6 and np.ptp(along_mg) > 0.1 * np.abs(along_mg).max()
    centred = along_mg - along_mg.mean()
    columns = [np.ones_like(along_mg), product, *([centred] if with_gain else [])]
    solution, sd, rms = _regressed(np.column_stack(columns), sum_mg)
    ratio, ratio_sd = (float(solution[2]), float(sd[2])) if with_gain else (0.0, 1.0)
    ratio_bounded = float(np.clip(ratio, -0.999, 0.999))
    offset = float(solution[0]) - ratio * float(along_mg.mean())
    hk_g, hk_sd_g, hk_observed = _hk_g(float(solution[1]), float(sd[1]))
    symmetry = (1.0 + ratio_bounded) / (1.0 - ratio_bounded)
    return (offset, float(sd[0]), hk_g, hk_sd_g, hk_observed, symmetry, 2.0 * ratio_sd, rms)


def _not_flipping(
    along_mg: NDArray[np.float64], across_mg: NDArray[np.float64], sum_mg: NDArray[np.float64]
) -> tuple[float, ...]:
    """Return an axis whose field hardly changes: steady field, or a strap that does not flip."""
    product = along_mg * across_mg / MG_PER_G
    steady = np.abs(along_mg).max() > NOT_FLIPPING * np.abs(sum_mg).max()
    columns = np.column_stack([np.ones_like(along_mg), product])
    solution, sd, rms = _regressed(columns, sum_mg)
    hk_g, hk_sd_g, hk_observed = _hk_g(float(solution[1]), float(sd[1]))
    symmetry = 1.0 if steady else 0.0
    return (float(solution[0]), float(sd[0]), hk_g, hk_sd_g, hk_observed, symmetry, 1.0, rms)


def _regressed(
    columns: NDArray[np.float64], values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    inverse = np.linalg.pinv(columns / scale, rcond=1e-8)
    solution = inverse @ values
    residual = values - columns / scale @ solution
    variance = float(residual @ residual) / max(len(values) - columns.shape[1], 1)
    sd = np.sqrt(variance * (inverse**2).sum(axis=1)) / scale
    return solution / scale, sd, float(np.sqrt((residual**2).mean()))


def _hk_g(slope: float, sd: float) -> tuple[float, float, float]:
    if abs(slope) > 2.0 * sd and abs(slope) > 1e-9:
        return 1.0 / abs(slope), sd / slope**2, 1.0
    return 1.0 / max(abs(slope) + 2.0 * sd, 1e-3), 0.0, 0.0
