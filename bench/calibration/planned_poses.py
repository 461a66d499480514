"""What a method can give on poses before they are measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bench.calibration.fit import CalibrationData
from bench.calibration.methods import fit_named
from bench.calibration.prediction import DEFAULT_FIELD_MG
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from collections.abc import Iterable

    from bench.calibration.fit import Cause
    from bench.pose import Attitude


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
    angles_deg = np.array(
        [(pose.azimuth_deg, pose.pitch_deg, pose.roll_deg) for pose in attitudes], dtype=float
    ).reshape(-1, 3)
    like = data_like
    if like is None:
        like = CalibrationData(field_mg=np.zeros((0, 3)), accel_g=np.zeros((0, 3)))
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
