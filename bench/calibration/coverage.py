"""How much of the sphere the readings saw, and what poses can give before they are measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.prediction import DEFAULT_FIELD_MG
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Cause
    from bench.pose import Attitude

COVERED_WITHIN_DEG: Final = 20.0
_POINTS: Final = 400


def _sphere_points(count: int) -> NDArray[np.float64]:
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    radius = np.sqrt(1.0 - height**2)
    turn_rad = index * np.pi * (3.0 - np.sqrt(5.0))
    return np.column_stack([radius * np.cos(turn_rad), radius * np.sin(turn_rad), height])


def sphere_coverage(vectors: NDArray[np.float64]) -> float:
    """Return the part 0..1 of all directions that lie within 20 deg of a reading.

    Parameters
    ----------
    vectors : ndarray, shape (n, 3)
        Corrected or centred readings; only their directions count.

    Examples
    --------
    >>> sphere_coverage(_sphere_points(200))
    1.0
    >>> round(sphere_coverage(np.array([[0.0, 0.0, 1.0]])), 2)  # (1 - cos 20 deg)/2
    0.03
    """
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    directions = vectors / np.where(lengths > 0.0, lengths, 1.0)
    points = _sphere_points(_POINTS)
    closest = np.full(_POINTS, -1.0)
    for start in range(0, len(directions), 2000):
        block = points @ directions[start : start + 2000].T
        closest = np.maximum(closest, block.max(axis=1))
    return float((closest >= np.cos(np.deg2rad(COVERED_WITHIN_DEG))).mean())


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What a method can give on poses before they are measured; field names as in Fit.

    A heading error is None where the method would refuse: `cause` and `message` say why.
    """

    method: str
    cause: Cause | None
    message: str
    rank: int | None
    condition: float | None
    coverage: float | None
    predicted_heading_rms_deg: float | None
    predicted_heading_max_deg: float | None


def predict(
    attitudes: Iterable[Attitude], method: str, data_like: CalibrationData | None = None
) -> Prediction:
    """Return rank, condition and predicted heading error of one method on planned poses.

    Fits the readings that a perfect module would give at the poses, with the noise that the
    weights assume: the covariance does not depend on the noise drawn.

    Parameters
    ----------
    attitudes : iterable of Attitude
        Planned poses.
    method : str
        Name of the method in `methods.METHODS`.
    data_like : CalibrationData, optional
        Standard deviations and the station's field (horizontal 250 mG, dip 60 deg where there
        is none); its readings are not used, but without `accel_g` no accelerometer is fitted.

    Raises
    ------
    ValueError
        If there is no such method.

    Examples
    --------
    >>> from bench.pose import Attitude
    >>> level = [Attitude(azimuth_deg=heading) for heading in range(0, 360, 15)]
    >>> prediction = predict(level, "truth_aided")
    >>> prediction.cause, prediction.rank
    (<Cause.TILT_TOO_SMALL: 'tilt_too_small'>, 12)
    """
    from bench.calibration.methods import fit_named

    fit = fit_named(method, perfect_data(attitudes, data_like))
    return Prediction(
        method=method,
        cause=fit.cause,
        message=fit.message,
        rank=fit.rank,
        condition=fit.condition,
        coverage=fit.coverage,
        predicted_heading_rms_deg=fit.predicted_heading_rms_deg,
        predicted_heading_max_deg=fit.predicted_heading_max_deg,
    )


def perfect_data(
    attitudes: Iterable[Attitude], data_like: CalibrationData | None = None
) -> CalibrationData:
    """Return the readings of a perfect module at the poses, with the weights of `data_like`."""
    from bench.calibration.fit import CalibrationData

    angles_deg = np.array(
        [(pose.azimuth_deg, pose.pitch_deg, pose.roll_deg) for pose in attitudes], dtype=float
    ).reshape(-1, 3)
    like = data_like or CalibrationData(field_mg=np.zeros((0, 3)), accel_g=np.zeros((0, 3)))
    station = DEFAULT_FIELD_MG if like.station_field_mg is None else like.station_field_mg
    rotations = ned_from_body(*angles_deg.T)
    force_g = np.einsum("nji,j->ni", rotations, np.array([0.0, 0.0, -1.0]))
    return replace(
        like,
        field_mg=np.einsum("nji,j->ni", rotations, station),
        accel_g=None if like.accel_g is None else force_g,
        azimuth_deg=angles_deg[:, 0],
        pitch_deg=angles_deg[:, 1],
        roll_deg=angles_deg[:, 2],
        station_field_mg=station,
    )
