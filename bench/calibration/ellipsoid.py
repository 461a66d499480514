"""Magnetometer alone: offset and symmetric matrix that put the readings on a sphere.

Start: Taubin's algebraic ellipsoid (one generalised eigenvalue problem), which is nearly
unbiased in noise. End: Levenberg-Marquardt on the Sampson distance, the first-order maximum
likelihood, with the gradient weight differentiated too; a radial cost instead is biased by
noise and has a spurious minimum where the ellipsoid becomes a plane.

The rotation between sensor and body is unobservable: the predicted heading error is that of
offset and symmetric matrix only, without rotation.

References
----------
.. [1] G. Taubin, IEEE Trans. Pattern Analysis 13(11), 1991.
.. [2] P. D. Sampson, Computer Graphics and Image Processing 18, 1982.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.coverage import sphere_coverage
from bench.calibration.fit import CalibrationData, Cause, Fit, refusal
from bench.calibration.prediction import heading_grid, predicted_heading_deg
from bench.calibration.saturation import STOPPED, saturated_axis
from bench.calibration.tilt import attitude_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

METHOD: Final = "ellipsoid"
SMALLEST: Final = 9
FLAT: Final = 0.03
"""Smallest to largest extent of the readings below which they lie in a plane."""
LARGEST_AXIS_RATIO: Final = 5.0
LARGEST_RESIDUAL: Final = 0.10
LARGEST_PREDICTED_DEG: Final = 3.0
DISTURBED_COVERAGE: Final = 0.6
"""Readings all round that still fit no ellipsoid were not of one field."""
DISTURBED_SPREAD: Final = 0.25
SECOND_QUADRIC: Final = 9.0
"""Mean square distance of the second best quadric over that of the best, below which the noise
picks between them: two rings of one axis lie on a whole family of ellipsoids. Poses that tilt in
pitch and in roll have thousands."""
SMALLEST_SECOND: Final = 1e-8
"""The same in squares of the readings' extent, for readings without noise."""
PARAMETERS: Final = (
    *(f"matrix_{element}" for element in ("xx", "yy", "zz", "xy", "xz", "yz")),
    *(f"offset_{axis}_mg" for axis in "xyz"),
)
_ROWS: Final = np.array([0, 1, 2, 0, 0, 1])
_COLUMNS: Final = np.array([0, 1, 2, 1, 2, 2])


def fit_ellipsoid(data: CalibrationData) -> Fit:
    """Fit offset and symmetric matrix (9 parameters) to readings in many directions.

    Parameters
    ----------
    data : CalibrationData
        Only `field_mg` is needed; the sphere's radius is the station's field strength, or
        without one that of a matrix with determinant one. With `accel_g` the mean dip is given.

    Returns
    -------
    Fit
        Refused with TOO_FEW, TILT_TOO_SMALL (readings in a plane), SATURATED, FIELD_DISTURBED,
        DEGENERATE (no ellipsoid),
        NOT_OBSERVABLE (predicted error too large), NOT_CONVERGED or RESIDUAL_TOO_LARGE. Never
        a hyperboloid.
    """
    if len(data) < SMALLEST:
        message = f"an ellipsoid needs at least {SMALLEST} readings; instead received {len(data)}"
        return refusal(METHOD, Cause.TOO_FEW, message, data)
    centre = data.field_mg.mean(axis=0)
    unit = data.field_mg - centre
    scale = float(np.sqrt((unit**2).sum(axis=1).mean()))
    if not scale > 0.0:
        message = "all readings are the same: turn the module through all directions"
        return refusal(METHOD, Cause.NO_TURN, message, data)
    unit = unit / scale
    extents = np.linalg.svd(unit, compute_uv=False)
    if extents[2] < FLAT * extents[0]:
        message = (
            f"the readings lie in a plane (extent ratio {extents[2] / extents[0]:.3f}): "
            "tilt the module, or use min_max on a level turn"
        )
        return refusal(METHOD, Cause.TILT_TOO_SMALL, message, data, rank=5)
    held = saturated_axis(data.field_mg)
    if held is not None:
        message = f"axis {held} {STOPPED}"
        return refusal(METHOD, Cause.SATURATED, message, data)
    start = taubin_ellipsoid(unit)
    if start is None:
        return _no_ellipsoid(data, unit, scale / float(np.linalg.norm(centre) + scale))
    return _refined(data, unit, centre, scale, start)


def _no_ellipsoid(data: CalibrationData, unit: NDArray[np.float64], spread: float) -> Fit:
    coverage = sphere_coverage(unit)
    if coverage > DISTURBED_COVERAGE and spread > DISTURBED_SPREAD:
        message = (
            f"the readings cover {100.0 * coverage:.0f} % of all directions and lie on no "
            "ellipsoid: the field around the module changed, as with a magnet or iron nearby"
        )
        return refusal(METHOD, Cause.FIELD_DISTURBED, message, data, coverage=coverage)
    message = "the readings lie on no ellipsoid: turn the module through more directions"
    return refusal(METHOD, Cause.DEGENERATE, message, data, coverage=coverage)


def taubin_ellipsoid(
    points: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return (M, c): |M (points - c)| near 1, M symmetric positive; None if no ellipsoid.

    Taubin's fit minimises mean(q^2)/mean(|grad q|^2) over quadrics q [1]_.

    Parameters
    ----------
    points : ndarray, shape (n, 3), centred and of unit RMS length

    Examples
    --------
    >>> corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, 1.0]])
    >>> points = np.vstack([np.eye(3), -np.eye(3), corners / 3**0.5])
    >>> matrix, centre = taubin_ellipsoid(points)
    >>> bool(np.allclose(matrix, np.eye(3))), bool(np.allclose(centre, 0.0))
    (True, True)
    """
    found = _quadrics(points)
    if found is None:
        return None
    _, quadrics, mean = found
    quadric = quadrics[:, 0]
    return _ellipsoid_of(quadric, -float(mean @ quadric))


def _quadrics(
    points: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Return (mean square distances ascending, quadrics as columns, mean terms); None if flat."""
    x, y, z = points.T
    one, nil = np.ones_like(x), np.zeros_like(x)
    terms = np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, x, y, z])
    gradients = np.stack(
        [
            np.column_stack([2 * x, nil, nil, 2 * y, 2 * z, nil, one, nil, nil]),
            np.column_stack([nil, 2 * y, nil, 2 * x, nil, 2 * z, nil, one, nil]),
            np.column_stack([nil, nil, 2 * z, nil, 2 * x, 2 * y, nil, nil, one]),
        ]
    )
    mean = terms.mean(axis=0)
    centred = terms - mean
    moments = centred.T @ centred / len(points)
    weights = np.einsum("kni,knj->ij", gradients, gradients) / len(points)
    weight_values, weight_vectors = np.linalg.eigh(weights)
    if weight_values[0] < 1e-9 * weight_values[-1]:
        return None
    half = weight_vectors / np.sqrt(weight_values)
    distances, vectors = np.linalg.eigh(half.T @ moments @ half)
    return distances, half @ vectors, mean


def told_apart(points: NDArray[np.float64]) -> bool:
    """Return whether one quadric fits the points, shape (n, 3), clearly better than all others.

    Where it does not, the linearised covariance of any fit is worth nothing.

    >>> turn = np.arange(0.0, 6.28, 0.5)
    >>> ring = np.column_stack([0.6 * np.cos(turn), 0.6 * np.sin(turn), 0.8 + 0.0 * turn])
    >>> other = ring * [1.0, 1.0, -1.0]
    >>> told_apart(np.vstack([ring, other]))
    False
    >>> told_apart(np.vstack([ring, other, ring[:, [1, 2, 0]]]))
    True
    """
    found = _quadrics(points)
    if found is None:
        return False
    best, second = found[0][:2]
    return bool(second > max(SECOND_QUADRIC * best, SMALLEST_SECOND))


def _ellipsoid_of(
    quadric: NDArray[np.float64], constant: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    shape = np.empty((3, 3))
    shape[_ROWS, _COLUMNS] = quadric[:6]
    shape[_COLUMNS, _ROWS] = quadric[:6]
    if abs(np.linalg.det(shape)) < 1e-12:
        return None
    centre = np.asarray(-0.5 * np.linalg.solve(shape, quadric[6:9]), dtype=float)
    level = float(centre @ shape @ centre) - constant
    values, vectors = np.linalg.eigh(shape / level) if level != 0.0 else (np.zeros(3), shape)
    if not (values > 0.0).all() or values[-1] > LARGEST_AXIS_RATIO**2 * values[0]:
        return None
    return (vectors * np.sqrt(values)) @ vectors.T, centre


def sampson_residual(
    parameters: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (|w|^2 - 1)/(2 |M w|), w = M (points - c), shape (n,): distance to first order."""
    matrix = _symmetric(parameters)
    inside = (points - parameters[6:9]) @ matrix
    gradient = np.linalg.norm(inside @ matrix, axis=1)
    return np.asarray(((inside**2).sum(axis=1) - 1.0) / (2.0 * np.maximum(gradient, 1e-12)))


def _symmetric(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.empty((3, 3))
    matrix[_ROWS, _COLUMNS] = parameters[:6]
    matrix[_COLUMNS, _ROWS] = parameters[:6]
    return matrix


def _refined(
    data: CalibrationData,
    unit: NDArray[np.float64],
    centre: NDArray[np.float64],
    scale: float,
    start: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> Fit:
    from scipy.optimize import least_squares

    first = np.concatenate([start[0][_ROWS, _COLUMNS], start[1]])
    result = least_squares(sampson_residual, first, args=(unit,), method="lm", x_scale="jac")
    matrix = _symmetric(result.x)
    values = np.linalg.eigvalsh(matrix)
    coverage = sphere_coverage((unit - result.x[6:9]) @ matrix)
    if not result.success:
        message = "the ellipsoid fit did not settle: cover more directions"
        return refusal(METHOD, Cause.NOT_CONVERGED, message, data, coverage=coverage)
    if not (values > 0.0).all() or values[-1] > LARGEST_AXIS_RATIO * values[0]:
        return _no_ellipsoid(data, unit, scale / float(np.linalg.norm(centre) + scale))
    jacobian = np.asarray(result.jac, dtype=float)
    lengths = np.linalg.norm(jacobian, axis=0)
    singular = np.linalg.svd(jacobian / lengths, compute_uv=False)
    inverse = np.linalg.pinv(jacobian / lengths) / lengths[:, None]
    return _judged(
        data,
        _Optimum(
            solution=result.x,
            covariance=inverse @ inverse.T,
            residual_rms=float(np.sqrt((result.fun**2).mean())),
            rank=min(int((singular > 1e-6 * singular[0]).sum()), 9 if told_apart(unit) else 8),
            condition=float(singular[0] / max(singular[-1], 1e-300)),
            coverage=coverage,
            centre=centre,
            scale=scale,
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Optimum:
    """Solution in readings centred and divided by `scale`; covariance for unit variance."""

    solution: NDArray[np.float64]
    covariance: NDArray[np.float64]
    residual_rms: float
    rank: int
    condition: float
    coverage: float
    centre: NDArray[np.float64]
    scale: float


def _judged(data: CalibrationData, best: _Optimum) -> Fit:
    matrix = _symmetric(best.solution)
    relative = best.residual_rms * float(np.linalg.det(matrix) ** (1.0 / 3.0))
    refuse = partial(
        refusal,
        METHOD,
        data=data,
        rank=best.rank,
        condition=best.condition,
        coverage=best.coverage,
        residual_rms_mg=best.residual_rms * best.scale,
    )
    if relative > LARGEST_RESIDUAL:
        message = (
            f"the residual of {100.0 * relative:.1f} % of the field exceeds "
            f"{100.0 * LARGEST_RESIDUAL:.0f} %: the field around the module changed"
        )
        return refuse(Cause.RESIDUAL_TOO_LARGE, message)
    if best.rank < 9:
        message = f"the readings determine {best.rank} of 9 parameters: tilt in pitch and in roll"
        return refuse(Cause.NOT_OBSERVABLE, message)
    fit = _fit_of(data, best, relative)
    assert fit.predicted_heading_rms_deg is not None  # noqa: S101
    if fit.predicted_heading_rms_deg > LARGEST_PREDICTED_DEG:
        message = (
            f"the readings cover {100.0 * best.coverage:.0f} % of all directions and would leave "
            f"a heading error of {fit.predicted_heading_rms_deg:.0f} deg RMS: turn through more"
        )
        return refuse(Cause.NOT_OBSERVABLE, message)
    return fit


def _fit_of(data: CalibrationData, best: _Optimum, relative: float) -> Fit:
    strength = _strength(data, _symmetric(best.solution), best.scale)
    matrix = _symmetric(best.solution) / best.scale * strength
    offset = best.centre + best.scale * best.solution[6:9]
    residual_rms_mg = best.residual_rms * best.scale
    dof = len(data) - 9
    chi2_reduced = len(data) * (residual_rms_mg / data.field_sd_mg) ** 2 / max(dof, 1)
    sd = data.field_sd_mg / best.scale * np.sqrt(max(chi2_reduced, 1.0))
    units = sd * np.repeat([strength / best.scale, best.scale], [6, 3])
    covariance = best.covariance * units[:, None] * units
    dip_deg = _dip_deg(data, matrix, offset)
    rms_deg, max_deg = _predicted(matrix, covariance, strength, dip_deg, data)
    return Fit(
        method=METHOD,
        message="the rotation between sensor and body is unobservable and not in the prediction",
        samples=len(data),
        offset_mg=offset,
        matrix=matrix,
        field_mg=strength,
        dip_deg=dip_deg,
        parameters=PARAMETERS,
        covariance=covariance,
        residual_rms_mg=residual_rms_mg,
        chi2_reduced=chi2_reduced,
        dof=dof,
        rank=best.rank,
        condition=best.condition,
        coverage=best.coverage,
        predicted_heading_rms_deg=rms_deg,
        predicted_heading_max_deg=max_deg,
        extra={"residual_relative": relative},
    )


def _strength(data: CalibrationData, matrix: NDArray[np.float64], scale: float) -> float:
    if data.station_field_mg is not None:
        return float(np.linalg.norm(data.station_field_mg))
    return scale / float(np.linalg.det(matrix) ** (1.0 / 3.0))


def _dip_deg(
    data: CalibrationData, matrix: NDArray[np.float64], offset: NDArray[np.float64]
) -> float | None:
    if data.accel_g is None:
        return None
    corrected = (data.field_mg - offset) @ matrix.T
    pitch_deg, roll_deg = attitude_deg(data.accel_g)
    pitch_rad, roll_rad = np.deg2rad(pitch_deg), np.deg2rad(roll_deg)
    lateral = corrected[:, 1] * np.sin(roll_rad) + corrected[:, 2] * np.cos(roll_rad)
    down = lateral * np.cos(pitch_rad) - corrected[:, 0] * np.sin(pitch_rad)
    ratio = np.clip(down / np.linalg.norm(corrected, axis=1), -1.0, 1.0)
    return float(np.rad2deg(np.median(np.arcsin(ratio))))


def _predicted(
    matrix: NDArray[np.float64],
    covariance: NDArray[np.float64],
    strength: float,
    dip_deg: float | None,
    data: CalibrationData,
) -> tuple[float, float]:
    station = data.station_field_mg
    if station is None:
        dip_rad = np.deg2rad(60.0 if dip_deg is None else np.clip(dip_deg, -85.0, 85.0))
        station = strength * np.array([np.cos(dip_rad), 0.0, np.sin(dip_rad)])
    level = np.array([np.hypot(station[0], station[1]), 0.0, station[2]])
    grid = heading_grid(level)
    raw = np.linalg.solve(matrix, grid.field_mg.T).T
    jacobian = np.zeros((len(raw), 9))
    gradient = grid.field_gradient_deg
    for index, (row, column) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
        jacobian[:, index] = gradient[:, row] * raw[:, column]
        if row != column:
            jacobian[:, index] += gradient[:, column] * raw[:, row]
    jacobian[:, 6:] = -gradient @ matrix
    return predicted_heading_deg(jacobian, covariance)
