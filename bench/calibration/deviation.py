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

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.deviation_words import SENTENCES, error_words
from bench.calibration.fit import Cause
from bench.calibration.level_kernel import largest_azimuth_gap_deg
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

SMALLEST: Final = 8
NAMES: Final = ("A", "B", "C", "D", "E")
LARGEST_GAP_DEG: Final = 90.0
"""Largest gap between neighbouring headings."""
SMALLEST_SPREAD: Final = 0.01
"""Least mean square of any mix of the five terms: 0.5 of headings spread evenly, 0 of four."""
CAUSES: Final[tuple[Cause | None, ...]] = (
    None,
    Cause.TOO_FEW,
    Cause.NO_TURN,
    Cause.HARD_IRON_TOO_LARGE,
    Cause.NOT_CONVERGED,
)
"""What the numbers in `DeviationBatch.cause` mean."""
ITERATIONS: Final = 20
HALVINGS: Final = 12
RIDGE: Final = 1e-13
"""Share of the trace that keeps the equations of a unit that is refused anyway soluble."""
CONVERGED_RAD: Final = 1e-7
"""Largest last step; what is left of it is far below any standard error."""
LARGEST_HARD_IRON: Final = 1.0
"""B^2 + C^2 from which the horizontal field vanishes at some heading."""


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DeviationBatch:
    """Coefficients of deviation of units; units are the leading axes (...). 0 where refused.

    Attributes
    ----------
    coefficients_deg, sd_deg : ndarray, shape (..., 5)
        A to E and their standard errors, from the scatter of the residual.
    residual_rms_deg, third_deg, fourth_deg : ndarray, shape (...)
        As in `Deviation`.
    cause : ndarray of int8, shape (...)
        Index into `CAUSES`, 0 where accepted.
    """

    coefficients_deg: NDArray[np.float64]
    sd_deg: NDArray[np.float64]
    residual_rms_deg: NDArray[np.float64]
    third_deg: NDArray[np.float64]
    fourth_deg: NDArray[np.float64]
    cause: NDArray[np.int8]

    def unit(self, index: tuple[int, ...] = ()) -> Deviation:
        """Return the deviation of one unit, with its words."""
        cause = CAUSES[int(self.cause[index])]
        coefficients = tuple(float(value) for value in self.coefficients_deg[index])
        harmonics = [float(self.third_deg[index]), float(self.fourth_deg[index])]
        return Deviation(
            coefficients_deg=coefficients,
            sd_deg=tuple(float(value) for value in self.sd_deg[index]),
            residual_rms_deg=float(self.residual_rms_deg[index]),
            third_deg=harmonics[0],
            fourth_deg=harmonics[1],
            cause=cause,
            words=error_words(coefficients, harmonics) if cause is None else (SENTENCES[cause],),
        )


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
    magnetic_rad, deviation_rad = _one_unit(compass_deg, magnetic_deg)
    if magnetic_rad.shape[-1] < SMALLEST:
        return _none_of(()).unit()
    cause = _places_cause(magnetic_rad)
    columns, _ = _parts(magnetic_rad)
    solution = _steps(columns, deviation_rad)
    residual = deviation_rad - columns @ solution
    return _batch(magnetic_rad, solution, residual, columns, cause).unit()


def exact_deviation(compass_deg: ArrayLike, magnetic_deg: ArrayLike) -> Deviation:
    """Fit the exact form by least squares of the deviation's angle.

    Parameters
    ----------
    compass_deg, magnetic_deg : array-like, shape (n,), n >= 8
        Headings read and true, level, spread round the circle.

    Returns
    -------
    Deviation
        Refused with HARD_IRON_TOO_LARGE at B^2 + C^2 >= 1, TOO_FEW below 8 headings or where they
        stand at so few places that the five coefficients cannot be told apart, NO_TURN with a gap
        over 90 deg, NOT_CONVERGED.

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
    _one_unit(compass_deg, magnetic_deg)
    return exact_deviation_batch(compass_deg, magnetic_deg).unit()


def exact_deviation_batch(compass_deg: ArrayLike, magnetic_deg: ArrayLike) -> DeviationBatch:
    """Fit the exact form to the swings of many units at once, without a loop over them.

    Gauss-Newton from the form's linear solution; a step that does not lessen the sum of squares is
    halved, so that the sum never grows.

    Parameters
    ----------
    compass_deg : array-like, shape (..., n)
        Headings read, level.
    magnetic_deg : array-like, broadcast to (..., n)
        True magnetic headings.

    Raises
    ------
    ValueError
        If shapes do not match, or a value is not finite.

    Examples
    --------
    >>> magnetic = np.arange(0.0, 360.0, 15.0)
    >>> swings = magnetic - np.array([[1.0], [2.0], [3.0]])  # three units
    >>> exact_deviation_batch(swings, magnetic).coefficients_deg[:, 0].round(2).tolist()
    [1.0, 2.0, 3.0]
    """
    magnetic_rad, deviation_rad = _checked(compass_deg, magnetic_deg)
    if magnetic_rad.shape[-1] < SMALLEST:
        return _none_of(magnetic_rad.shape[:-1])
    cause = _places_cause(magnetic_rad)
    turned, twice = magnetic_rad - deviation_rad, 2.0 * magnetic_rad - deviation_rad
    columns = np.stack(
        [np.cos(deviation_rad), np.sin(turned), np.cos(turned), np.sin(twice), np.cos(twice)],
        axis=-1,
    )
    start = _steps(columns, np.sin(deviation_rad))
    solution, last = _descended(start, magnetic_rad, deviation_rad)
    iron = np.hypot(solution[..., 1], solution[..., 2])
    codes = ((cause != 0, cause), (~(iron < LARGEST_HARD_IRON), 3), (last > CONVERGED_RAD, 4))
    found = np.select([holds for holds, _ in codes], [code for _, code in codes], 0)
    residual, jacobian = _exact_residual(solution, magnetic_rad, deviation_rad)
    return _batch(magnetic_rad, solution, residual, jacobian, found.astype(np.int8))


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


def _one_unit(
    compass_deg: ArrayLike, magnetic_deg: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    shapes = np.shape(compass_deg), np.shape(magnetic_deg)
    if shapes[0] != shapes[1] or len(shapes[0]) != 1:
        message = (
            "compass_deg and magnetic_deg must be of one shape (n,); instead received "
            f"{shapes[0]} and {shapes[1]}"
        )
        raise ValueError(message)
    return _checked(compass_deg, magnetic_deg)


def _checked(
    compass_deg: ArrayLike, magnetic_deg: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return magnetic headings and deviations in radians, both of shape (..., n)."""
    compass, magnetic = np.asarray(compass_deg, dtype=float), np.asarray(magnetic_deg, dtype=float)
    try:
        shape = np.broadcast_shapes(compass.shape, magnetic.shape)
    except ValueError:
        shape = ()
    if not shape:
        message = (
            "compass_deg and magnetic_deg must have shapes that match in n; instead received "
            f"{compass.shape} and {magnetic.shape}"
        )
        raise ValueError(message)
    if not (np.isfinite(compass).all() and np.isfinite(magnetic).all()):
        message = "headings must be finite; instead received a value that is not"
        raise ValueError(message)
    deviation_deg = wrap_180_deg(magnetic - compass)
    return np.deg2rad(np.broadcast_to(magnetic, shape)), np.deg2rad(deviation_deg)


def _places_cause(magnetic_rad: NDArray[np.float64]) -> NDArray[np.int8]:
    """Return, shape (...), 2 where the headings leave a gap, 1 where they are too few places."""
    gap_deg = largest_azimuth_gap_deg(np.rad2deg(magnetic_rad))
    series, _ = _parts(magnetic_rad)
    moments = np.swapaxes(series, -1, -2) @ series / magnetic_rad.shape[-1]
    spread = np.linalg.eigvalsh(moments)[..., 0]
    codes = np.select([gap_deg > LARGEST_GAP_DEG + 1e-4, spread < SMALLEST_SPREAD], [2, 1], 0)
    return codes.astype(np.int8)


def _parts(magnetic_rad: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the columns of numerator and denominator, each (..., n, 5)."""
    s1, c1 = np.sin(magnetic_rad), np.cos(magnetic_rad)
    s2, c2 = np.sin(2.0 * magnetic_rad), np.cos(2.0 * magnetic_rad)
    unit, nil = np.ones_like(s1), np.zeros_like(s1)
    series = np.stack([unit, s1, c1, s2, c2], axis=-1)
    quadrature = np.stack([nil, c1, -s1, c2, -s2], axis=-1)
    return series, quadrature


def _steps(columns: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the least squares solution of each unit, shape (..., 5)."""
    normal = np.swapaxes(columns, -1, -2) @ columns
    right = np.einsum("...nk,...n->...k", columns, values)
    solution: NDArray[np.float64] = np.linalg.solve(_never_singular(normal), right[..., None])
    return solution[..., 0]


def _never_singular(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    trace = np.einsum("...kk->...", normal)[..., None, None]
    return np.asarray(normal + RIDGE * trace * np.eye(normal.shape[-1]))


def _descended(
    solution: NDArray[np.float64],
    magnetic_rad: NDArray[np.float64],
    deviation_rad: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return solutions, shape (..., 5), and the size of each unit's last step, shape (...)."""
    residual, jacobian = _exact_residual(solution, magnetic_rad, deviation_rad)
    for _ in range(ITERATIONS):
        step = _steps(jacobian, residual)
        square = (residual**2).sum(axis=-1)
        share = np.ones(square.shape)
        for _ in range(HALVINGS):
            trial, _ = _exact_residual(
                solution + share[..., None] * step, magnetic_rad, deviation_rad
            )
            worse = (trial**2).sum(axis=-1) > square
            if not worse.any():
                break
            share = np.where(worse, share / 2.0, share)
        share = np.where(worse, 0.0, share)
        solution = solution + share[..., None] * step
        residual, jacobian = _exact_residual(solution, magnetic_rad, deviation_rad)
        last = np.abs(step).max(axis=-1)
        if float(last.max(initial=0.0)) < CONVERGED_RAD:
            break
    return solution, last


def _exact_residual(
    solution: NDArray[np.float64],
    magnetic_rad: NDArray[np.float64],
    deviation_rad: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    series, quadrature = _parts(magnetic_rad)
    sine = np.einsum("...nk,...k->...n", series, solution)
    cosine = 1.0 + np.einsum("...nk,...k->...n", quadrature, solution)
    turned = deviation_rad - np.arctan2(sine, cosine)
    residual = np.arctan2(np.sin(turned), np.cos(turned))
    square = np.maximum(sine**2 + cosine**2, 1e-12)[..., None]
    jacobian = (cosine[..., None] * series - sine[..., None] * quadrature) / square
    return residual, jacobian


def _none_of(units: tuple[int, ...]) -> DeviationBatch:
    """Return units that were all refused with TOO_FEW."""
    nil, five = np.zeros(units), np.zeros((*units, 5))
    return DeviationBatch(
        coefficients_deg=five,
        sd_deg=five,
        residual_rms_deg=nil,
        third_deg=nil,
        fourth_deg=nil,
        cause=np.ones(units, dtype=np.int8),
    )


def _batch(
    magnetic_rad: NDArray[np.float64],
    solution: NDArray[np.float64],
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    cause: NDArray[np.int8],
) -> DeviationBatch:
    count = residual.shape[-1]
    variance = (residual**2).sum(axis=-1) / max(count - 5, 1)
    inverse = np.linalg.inv(_never_singular(np.swapaxes(jacobian, -1, -2) @ jacobian))
    diagonal = np.maximum(np.einsum("...kk->...k", inverse), 0.0)
    accepted = cause == 0

    def kept(values: NDArray[np.float64]) -> NDArray[np.float64]:
        mask = accepted if values.shape == accepted.shape else accepted[..., None]
        return np.where(mask, np.rad2deg(values), 0.0)

    third, fourth = (_amplitude(magnetic_rad, residual, order) for order in (3, 4))
    return DeviationBatch(
        coefficients_deg=kept(solution),
        sd_deg=kept(np.sqrt(variance[..., None] * diagonal)),
        residual_rms_deg=kept(np.sqrt((residual**2).mean(axis=-1))),
        third_deg=kept(third),
        fourth_deg=kept(fourth),
        cause=cause,
    )


def _amplitude(
    magnetic_rad: NDArray[np.float64], residual: NDArray[np.float64], order: int
) -> NDArray[np.float64]:
    """Return the amplitude of one harmonic by least squares, which 8 headings do not double."""
    angle_rad = order * magnetic_rad
    wave = _steps(np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1), residual)
    return np.asarray(np.hypot(wave[..., 0], wave[..., 1]))
