"""Deviation of a compass by heading: coefficients A to E, and which error they tell of.

deviation = magnetic - compass heading, east positive. For field errors X' = X + aX + bY + cZ + P,
Y' = Y + dX + eY + fZ + Q of a level compass it is exactly (Archibald Smith)

    tan(deviation) = (A + B sin z + C cos z + D sin 2z + E cos 2z)
                     / (1 + B cos z - C sin z + D cos 2z - E sin 2z)

with z the magnetic heading, A = (d - b)/2L, B = (P + cZ)/LH, C = (Q + fZ)/LH, D = (a - e)/2L,
E = (d + b)/2L, L = 1 + (a + e)/2. B and C are hard iron, D and E soft iron, A is the lubber line.
The linear series holds for small deviation only: a hard iron of 0.5 H invents a second harmonic
of 7.2 deg in it.

References
----------
.. [1] NGA, Handbook of Magnetic Compass Adjustment, articles 501 and following.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import Cause
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

SMALLEST: Final = 8
NAMES: Final = ("A", "B", "C", "D", "E")
ITERATIONS: Final = 20
LARGEST_HARD_IRON: Final = 1.0
"""B^2 + C^2 from which the horizontal field vanishes at some heading."""
SPOKEN_DEG: Final = 0.1
_MEANINGS: Final = (
    ("A", "constant error (lubber line, mounting azimuth or declination)"),
    ("BC", "hard iron, one cycle per turn"),
    ("DE", "soft iron or unequal gains, two cycles per turn"),
    ("34", "third and fourth harmonics: non-linearity or cross-axis effect of the sensor"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Coefficients of deviation.

    Attributes
    ----------
    coefficients_deg, sd_deg : tuple of 5 floats
        A, B, C, D, E and their standard errors; of the exact form times 180/pi.
    residual_rms_deg : float
    third_deg, fourth_deg : float
        Amplitudes of the third and fourth harmonics of what is left.
    cause : Cause or None
        Why there are no coefficients (then all are 0); `words` says it.
    words : tuple of str
        Which errors there are, the largest first.
    """

    coefficients_deg: tuple[float, ...]
    sd_deg: tuple[float, ...]
    residual_rms_deg: float
    third_deg: float
    fourth_deg: float
    cause: Cause | None
    words: tuple[str, ...]


def linear_deviation(compass_deg: ArrayLike, magnetic_deg: ArrayLike) -> Deviation:
    """Fit deviation = A + B sin z + C cos z + D sin 2z + E cos 2z, for small deviations [1]_.

    Parameters
    ----------
    compass_deg, magnetic_deg : array-like, shape (n,), n >= 8
        Headings read and true, level.

    Raises
    ------
    ValueError
        If shapes differ, or a value is not finite.
    """
    magnetic_rad, deviation_rad = _checked(compass_deg, magnetic_deg)
    if _sparse(magnetic_rad):
        return _refused(Cause.TOO_FEW, _TOO_FEW)
    columns = _series(magnetic_rad)
    solution = np.asarray(np.linalg.lstsq(columns, deviation_rad, rcond=None)[0], dtype=float)
    return _deviation(magnetic_rad, solution, deviation_rad - columns @ solution, columns)


def exact_deviation(compass_deg: ArrayLike, magnetic_deg: ArrayLike) -> Deviation:
    """Fit the exact form by least squares of the deviation's angle.

    Parameters
    ----------
    compass_deg, magnetic_deg : array-like, shape (n,), n >= 8
        Headings read and true, level, spread round the circle.

    Returns
    -------
    Deviation
        Refused with HARD_IRON_TOO_LARGE at B^2 + C^2 >= 1, TOO_FEW below 8 headings or with
        a gap over 90 deg.

    Raises
    ------
    ValueError
        If shapes differ, or a value is not finite.

    Examples
    --------
    >>> magnetic = np.arange(0.0, 360.0, 15.0)
    >>> compass = magnetic - exact_deviation_deg([1.0, 12.0, 8.0, 5.0, 1.5], magnetic)
    >>> deviation = exact_deviation(compass, magnetic)
    >>> [round(value, 6) for value in deviation.coefficients_deg]
    [1.0, 12.0, 8.0, 5.0, 1.5]
    >>> deviation.words[0]
    'hard iron, one cycle per turn: 14.42 deg'
    """
    magnetic_rad, deviation_rad = _checked(compass_deg, magnetic_deg)
    if _sparse(magnetic_rad):
        return _refused(Cause.TOO_FEW, _TOO_FEW)
    turned = magnetic_rad - deviation_rad
    twice = 2.0 * magnetic_rad - deviation_rad
    columns = np.column_stack(
        [np.cos(deviation_rad), np.sin(turned), np.cos(turned), np.sin(twice), np.cos(twice)]
    )
    solution = np.linalg.lstsq(columns, np.sin(deviation_rad), rcond=None)[0]
    for _ in range(ITERATIONS):
        residual, jacobian = _exact_residual(solution, magnetic_rad, deviation_rad)
        step = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        if float((residual - jacobian @ step) @ residual) > float(residual @ residual):
            break
        solution = solution + step
        if float(np.abs(step).max()) < 1e-12:
            break
    if not float(np.hypot(solution[1], solution[2])) < LARGEST_HARD_IRON:
        return _refused(Cause.HARD_IRON_TOO_LARGE, _TOO_STRONG)
    residual, jacobian = _exact_residual(solution, magnetic_rad, deviation_rad)
    return _deviation(magnetic_rad, solution, residual, jacobian)


def exact_deviation_deg(
    coefficients_deg: ArrayLike, magnetic_deg: ArrayLike
) -> NDArray[np.float64]:
    """Return the deviation in degrees of the exact form at magnetic headings, shape (n,).

    >>> exact_deviation_deg([0.0, 12.0, 0.0, 0.0, 0.0], [90.0]).round(3).tolist()
    [11.829]
    """
    solution = np.deg2rad(np.asarray(coefficients_deg, dtype=float))
    series, quadrature = _parts(np.deg2rad(np.asarray(magnetic_deg, dtype=float)))
    deviation_rad = np.arctan2(series @ solution, 1.0 + quadrature @ solution)
    return np.asarray(np.rad2deg(deviation_rad), dtype=float)


_TOO_FEW: Final = "at least 8 headings round the circle are needed"
_TOO_STRONG: Final = "hard iron reverses the horizontal field: degauss, or look for a magnet"


def _checked(
    compass_deg: ArrayLike, magnetic_deg: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    compass = np.asarray(compass_deg, dtype=float)
    magnetic = np.asarray(magnetic_deg, dtype=float)
    if compass.shape != magnetic.shape or compass.ndim != 1:
        message = (
            "compass_deg and magnetic_deg must be of one shape (n,); instead received "
            f"{compass.shape} and {magnetic.shape}"
        )
        raise ValueError(message)
    if not (np.isfinite(compass).all() and np.isfinite(magnetic).all()):
        message = "headings must be finite; instead received a value that is not"
        raise ValueError(message)
    return np.deg2rad(magnetic), np.deg2rad(wrap_180_deg(magnetic - compass))


def _sparse(magnetic_rad: NDArray[np.float64]) -> bool:
    if len(magnetic_rad) < SMALLEST:
        return True
    turned = np.sort(np.mod(magnetic_rad, 2.0 * np.pi))
    gaps = np.diff(turned, append=turned[0] + 2.0 * np.pi)
    return bool(gaps.max() > np.pi / 2.0 + 1e-6)


def _parts(magnetic_rad: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    one, two = magnetic_rad, 2.0 * magnetic_rad
    unit, nil = np.ones_like(one), np.zeros_like(one)
    series = np.column_stack([unit, np.sin(one), np.cos(one), np.sin(two), np.cos(two)])
    quadrature = np.column_stack([nil, np.cos(one), -np.sin(one), np.cos(two), -np.sin(two)])
    return series, quadrature


def _series(magnetic_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    return _parts(magnetic_rad)[0]


def _exact_residual(
    solution: NDArray[np.float64],
    magnetic_rad: NDArray[np.float64],
    deviation_rad: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    series, quadrature = _parts(magnetic_rad)
    sine, cosine = series @ solution, 1.0 + quadrature @ solution
    model = np.arctan2(sine, cosine)
    residual = np.arctan2(np.sin(deviation_rad - model), np.cos(deviation_rad - model))
    square = np.maximum(sine**2 + cosine**2, 1e-12)
    jacobian = (cosine[:, None] * series - sine[:, None] * quadrature) / square[:, None]
    return residual, jacobian


def _deviation(
    magnetic_rad: NDArray[np.float64],
    solution: NDArray[np.float64],
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> Deviation:
    dof = max(len(residual) - 5, 1)
    variance = float(residual @ residual) / dof
    sd = np.sqrt(variance * np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
    amplitudes = [_amplitude_deg(magnetic_rad, residual, order) for order in (3, 4)]
    coefficients = tuple(float(value) for value in np.rad2deg(solution))
    return Deviation(
        coefficients_deg=coefficients,
        sd_deg=tuple(float(value) for value in np.rad2deg(sd)),
        residual_rms_deg=float(np.rad2deg(np.sqrt((residual**2).mean()))),
        third_deg=amplitudes[0],
        fourth_deg=amplitudes[1],
        cause=None,
        words=_words(coefficients, amplitudes),
    )


def _amplitude_deg(
    magnetic_rad: NDArray[np.float64], residual: NDArray[np.float64], order: int
) -> float:
    wave = np.exp(-1j * order * magnetic_rad)
    return float(np.rad2deg(2.0 * abs((residual * wave).mean())))


def _words(coefficients_deg: tuple[float, ...], harmonics_deg: list[float]) -> tuple[str, ...]:
    a, b, c, d, e = coefficients_deg
    sizes = (abs(a), math.hypot(b, c), math.hypot(d, e), math.hypot(*harmonics_deg))
    spoken = sorted(
        ((size, meaning) for size, (_, meaning) in zip(sizes, _MEANINGS, strict=True)),
        reverse=True,
    )
    words = tuple(f"{meaning}: {size:.2f} deg" for size, meaning in spoken if size >= SPOKEN_DEG)
    return words or (f"no error of {SPOKEN_DEG:.1f} deg or more",)


def _refused(cause: Cause, sentence: str) -> Deviation:
    zero = (0.0,) * 5
    return Deviation(
        coefficients_deg=zero,
        sd_deg=zero,
        residual_rms_deg=0.0,
        third_deg=0.0,
        fourth_deg=0.0,
        cause=cause,
        words=(sentence,),
    )
