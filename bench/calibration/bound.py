"""The least heading error that any unbiased estimator can leave: the Cramer-Rao bound.

Every pose tells a matrix of information of the parameters; the poses' sum, inverted, bounds their
covariance, and the heading's derivative carries it to the verification grid. What is told
depends on what is known besides the magnetometer:

- `ellipsoid`: nothing. The rotation cannot be seen, and is not in this bound.
- `tilt_aided`: the direction of gravity, with the accelerometer's noise.
- `truth_aided`: the rig's angles, with their noise.

The bound holds the coefficients' error alone: not the noise of the reading that is corrected.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from bench.calibration.grid_error import correction_rows, error_deg, grid_axes, grid_field
from bench.calibration.least_squares import inverted
from bench.calibration.sphere_model import folded, sphere_rows, symmetric, tilt_rows
from bench.calibration.tilt import ned_from_body
from bench.calibration.truth_aided_batch import heading_rows
from bench.calibration.truth_model import rig_poses
from bench.calibration.truth_rows import TruthModel, truth_information

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Estimator = Literal["ellipsoid", "tilt_aided", "truth_aided"]
DIRECTION: Final = (12, 13)
BASE: Final = (26, 27)
BLOCK: Final = 4096


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Conditions:
    """Field, noise and unit under which a bound holds.

    Attributes
    ----------
    station_field_mg : ndarray, shape (3,)
        Field in the rig's frame, north east down.
    field_sd_mg : float
        Standard deviation of one pose's reading, each axis.
    accel_sd_g : float or None
        The same of the specific force; None leaves the accelerometer out of `truth_aided`.
    rig_sd_deg : float
        Standard deviation of each rig angle.
    direction_known, base_known : bool
        Whether `truth_aided` is told the field's direction and the base's level exactly.
    gain, accel_gain : ndarray, shape (3, 3)
        W of the unit's raw = W v + b.
    """

    station_field_mg: NDArray[np.float64]
    field_sd_mg: float
    accel_sd_g: float | None
    rig_sd_deg: float = 0.02
    direction_known: bool = False
    base_known: bool = False
    gain: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    accel_gain: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))

    @property
    def strength_mg(self) -> float:
        """Strength of the field."""
        return float(np.linalg.norm(self.station_field_mg))

    @property
    def sine(self) -> float:
        """Sine of the dip."""
        return float(self.station_field_mg[2]) / self.strength_mg


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeadingBound:
    """Bound of sets of poses; the leading axes (...) are sets.

    Attributes
    ----------
    rms_deg, worst_deg : ndarray, shape (...)
        Standard deviation of the heading: RMS over the verification grid, and at its worst
        attitude; infinite where the poses do not determine all parameters.
    rank, unknowns : ndarray of int, shape (...), and int
        Parameters that the poses determine, of how many.
    condition : ndarray, shape (...)
    covariance : ndarray, shape (..., p, p)
        Of the parameters: those of the matrix without unit, offsets in mG (g), angles in rad;
        the sine of the dip for `tilt_aided`.
    """

    rms_deg: NDArray[np.float64]
    worst_deg: NDArray[np.float64]
    rank: NDArray[np.intp]
    unknowns: int
    condition: NDArray[np.float64]
    covariance: NDArray[np.float64]


def heading_bound(
    estimator: Estimator, attitudes_deg: ArrayLike, conditions: Conditions
) -> HeadingBound:
    """Return the Cramer-Rao bound of the heading error for sets of poses.

    Parameters
    ----------
    estimator : {"ellipsoid", "tilt_aided", "truth_aided"}
    attitudes_deg : array-like, shape (..., n, 3)
        Azimuth, pitch and roll; the leading axes are sets of poses.
    conditions : Conditions

    Examples
    --------
    >>> level = [(heading, 0.0, 0.0) for heading in range(0, 360, 30)]
    >>> field = np.array([211.0, 0.0, 453.0])
    >>> conditions = Conditions(station_field_mg=field, field_sd_mg=0.5, accel_sd_g=0.002)
    >>> bound = heading_bound("ellipsoid", level, conditions)
    >>> bound.rank.item(), bound.unknowns, bound.rms_deg.item()
    (5, 9, inf)
    """
    information = pose_information(estimator, attitudes_deg, conditions)
    return information_bound(estimator, information.sum(axis=-3), conditions)


def information_bound(
    estimator: Estimator, information: NDArray[np.float64], conditions: Conditions
) -> HeadingBound:
    """Return the bound of summed information, shape (..., p, p), of `pose_information`."""
    found = inverted(information)
    rows = grid_rows(estimator, conditions)
    rms_deg, worst_deg = error_deg(rows, found.covariance)
    short = found.rank < information.shape[-1]
    return HeadingBound(
        rms_deg=np.where(short, np.inf, rms_deg),
        worst_deg=np.where(short, np.inf, worst_deg),
        rank=np.asarray(found.rank),
        unknowns=information.shape[-1],
        condition=found.condition,
        covariance=found.covariance,
    )


def pose_information(
    estimator: Estimator, attitudes_deg: ArrayLike, conditions: Conditions
) -> NDArray[np.float64]:
    """Return what each pose tells of the parameters, shape (..., n, p, p).

    Poses add up: a plan of poses is chosen from these without fitting anything.

    Parameters
    ----------
    estimator, attitudes_deg, conditions
        As for `heading_bound`.
    """
    angles_deg = np.asarray(attitudes_deg, dtype=float)
    flat_deg = angles_deg.reshape(-1, 3)
    parts = [
        _told(estimator, flat_deg[first : first + BLOCK], conditions)
        for first in range(0, len(flat_deg), BLOCK)
    ]
    told = np.concatenate(parts)
    return told.reshape((*angles_deg.shape[:-1], *told.shape[1:]))


def grid_rows(estimator: Estimator, conditions: Conditions) -> NDArray[np.float64]:
    """Return the heading's derivative, shape (k, p), over the grid by the bound's parameters."""
    if estimator == "truth_aided":
        model, parameters = _truth(np.zeros((1, 3)), conditions)
        return np.asarray(heading_rows(model, parameters)[0][:, _free(conditions)])
    strength, sine = np.asarray(conditions.strength_mg), np.asarray(conditions.sine)
    vectors, gradient = grid_field(grid_axes(), strength, sine)
    matrix = np.asarray(np.linalg.inv(conditions.gain), dtype=float)
    if estimator == "tilt_aided":
        rows = correction_rows(vectors, gradient, matrix)
        return np.concatenate([rows, np.zeros((len(rows), 1))], axis=1)
    rotation, shape = _polar(matrix)
    bends = symmetric(np.eye(6)) @ np.linalg.inv(shape)
    bends = rotation @ (0.5 * (bends + np.swapaxes(bends, 1, 2))) @ rotation.T
    by_shape = np.einsum("ki,pij,kj->kp", gradient, bends, vectors)
    return np.concatenate([by_shape, -gradient @ rotation @ shape], axis=1)


def _told(
    estimator: Estimator, attitudes_deg: NDArray[np.float64], conditions: Conditions
) -> NDArray[np.float64]:
    if estimator == "truth_aided":
        free = _free(conditions)
        told = truth_information(*_truth(attitudes_deg, conditions))[0]
        return np.asarray(told[:, free][:, :, free])
    strength = conditions.strength_mg
    axes = ned_from_body(*attitudes_deg.T)
    vectors = np.einsum("nji,j->ni", axes, conditions.station_field_mg)
    points = (vectors @ conditions.gain.T)[None]
    matrix = np.asarray(np.linalg.inv(conditions.gain) / strength, dtype=float)
    sd, centre = np.array([conditions.field_sd_mg]), np.zeros((1, 3))
    if estimator == "ellipsoid":
        jacobian = sphere_rows(_polar(matrix)[1][None], centre, points, sd)[1][0][:, None]
        jacobian = np.concatenate([folded(jacobian[..., :9]), jacobian[..., 9:]], axis=-1)
        jacobian[..., :6] /= strength
    else:
        accel_sd = conditions.accel_sd_g
        if accel_sd is None:
            message = "tilt_aided must have the accelerometer's noise; instead received None"
            raise ValueError(message)
        sine = np.array([conditions.sine])
        rows = tilt_rows(matrix[None], centre, sine, points, axes[None, :, 2], sd, accel_sd)[1]
        jacobian = np.moveaxis(rows[0], 0, 1)
        jacobian[..., :9] /= strength
    return np.asarray(np.swapaxes(jacobian, -1, -2) @ jacobian)


def _polar(matrix: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rotation and the symmetric positive matrix whose product is the matrix."""
    left, gains, right = np.linalg.svd(matrix)
    return np.asarray(left @ right), np.asarray(right.T * gains @ right)


def _free(conditions: Conditions) -> NDArray[np.intp]:
    """Return the columns of the truth-aided model that are not known beforehand."""
    known = [*DIRECTION] if conditions.direction_known else []
    if conditions.accel_sd_g is None:
        return np.setdiff1d(np.arange(14), known)
    known += BASE if conditions.base_known else ()
    return np.setdiff1d(np.arange(28), known)


def _truth(
    attitudes_deg: NDArray[np.float64], conditions: Conditions
) -> tuple[TruthModel, NDArray[np.float64]]:
    """Return the truth-aided model of the poses and the unit's parameters, shape (1, p)."""
    north, east, down = conditions.station_field_mg
    model = TruthModel(
        poses=rig_poses(*attitudes_deg.T),
        strength=conditions.strength_mg,
        field_sd=conditions.field_sd_mg,
        accel_sd=conditions.accel_sd_g,
        rig_sd_rad=float(np.deg2rad(conditions.rig_sd_deg)),
    )
    direction = np.array([np.arctan2(east, north), np.arctan2(down, np.hypot(north, east))])
    parts = [conditions.gain.ravel(), np.zeros(3), direction]
    if len(model.sensors) == 2:
        parts += [conditions.accel_gain.ravel(), np.zeros(3), np.zeros(2)]
    return model, np.concatenate(parts)[None]
