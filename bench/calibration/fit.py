"""What every calibration method takes and returns."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.crossed_field import without_cross_axis

if TYPE_CHECKING:
    from numpy.typing import NDArray

POSE_FIELD_SD_MG: Final = 0.35
"""Field of one pose: 0.32 mG of repeatability and the mean of 50 noise samples."""
POSE_ACCEL_SD_G: Final = 0.0004
"""Force of one pose: 2 mg over the root of 50 samples, and 0.3 mg of wander."""
POSE_RIG_SD_DEG: Final = 0.02
"""Encoder error of each angle of a pose."""


class Cause(StrEnum):
    """Why a fit was refused."""

    TOO_FEW = "too_few_samples"
    NO_TURN = "no_turn"
    POSITIONS_NOT_SQUARE = "positions_not_square"
    NOT_OBSERVABLE = "not_observable"
    BLIND_AZIMUTH = "blind_azimuth"
    TILT_TOO_SMALL = "tilt_too_small"
    DEGENERATE = "degenerate"
    NO_ACCELERATION = "no_acceleration"
    NO_TRUTH = "no_truth"
    NO_SET_RESET = "no_set_reset"
    RESIDUAL_TOO_LARGE = "residual_too_large"
    FIELD_DISTURBED = "field_disturbed"
    HARD_IRON_TOO_LARGE = "hard_iron_too_large"
    SATURATED = "saturated"
    NOT_CONVERGED = "not_converged"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationData:
    """Readings to calibrate from; rows are poses or single samples.

    Attributes
    ----------
    field_mg : ndarray, shape (n, 3)
        Raw magnetometer, (set - reset)/2 where there are pairs.
    accel_g : ndarray, shape (n, 3), or None
        Raw specific force (at rest level: 0, 0, -1).
    azimuth_deg, pitch_deg, roll_deg : ndarray, shape (n,), or None
        Attitude from the rig; azimuth counts from the rig's zero.
    field_sd_mg, accel_sd_g : float
        Standard deviation of one row, each axis, that the weights assume.
    rig_sd_deg : float
        Standard deviation of each rig angle.
    noise_known : bool
        Whether these are what is known of sensor and rig, not a guess. The fits over many
        tilts then refuse residuals that they cannot explain. A recording of a sensor of
        unknown noise leaves it False.
    offset_mg : ndarray, shape (n, 3), or None
        (set + reset)/2 of each row, None where the readings are no pairs.
    station_field_mg : ndarray, shape (3,), or None
        The station's field in NED of the *rig's* frame (north = rig zero), for comparison
        and as the start; methods that need a field strength take its norm.
    fixture_mg : ndarray, shape (3,), or None
        Field of the fixture's iron in the body frame, where the station knows of any: `fit_named`
        takes it out of the offset.
    """

    field_mg: NDArray[np.float64]
    accel_g: NDArray[np.float64] | None = None
    azimuth_deg: NDArray[np.float64] | None = None
    pitch_deg: NDArray[np.float64] | None = None
    roll_deg: NDArray[np.float64] | None = None
    field_sd_mg: float = 0.5
    accel_sd_g: float = 0.002
    rig_sd_deg: float = 0.02
    noise_known: bool = False
    offset_mg: NDArray[np.float64] | None = None
    station_field_mg: NDArray[np.float64] | None = None
    fixture_mg: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.field_mg)

    @property
    def field_azimuth_deg(self) -> float:
        """Azimuth of magnetic north from the rig's zero; 0 where the station's is not known."""
        if self.station_field_mg is None:
            return 0.0
        return float(np.rad2deg(np.arctan2(self.station_field_mg[1], self.station_field_mg[0])))


def rows_of(data: CalibrationData, rows: NDArray[np.bool_]) -> CalibrationData:
    """Return the data of the rows that are True in a mask of shape (n,)."""

    def chosen(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return None if values is None else values[rows]

    return replace(
        data,
        field_mg=data.field_mg[rows],
        accel_g=chosen(data.accel_g),
        azimuth_deg=chosen(data.azimuth_deg),
        pitch_deg=chosen(data.pitch_deg),
        roll_deg=chosen(data.roll_deg),
        offset_mg=chosen(data.offset_mg),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """Result of one method on one set of data.

    corrected field = matrix @ (raw - offset_mg), with raw less its cross-axis term where hk_mg
    is known; corrected force likewise with the accelerometer's. A refused fit has a cause, a
    sentence, and coefficients of None.

    Attributes
    ----------
    hk_mg : ndarray, shape (3,), or None
        Anisotropy fields with which the readings were corrected before the fit, 0 where an axis
        was not; None where none was.
    covariance : ndarray, shape (p, p), or None
        Covariance of the parameters in the order of `parameters`.
    accel_from : str
        Method whose accelerometer coefficients the fit took, "raw" if it took the raw force;
        empty where they are its own or where it has none.
    extended_dip_deg : float or None
        Cho & Park's extended dip angle, of a fit for two axes: z is then not read but estimated
        from the attitude, this angle and `extra["horizontal_mg"]`, and pitch and roll come from
        the x and y force alone.
    residual_rms_mg : float
        RMS of the magnetometer's residual an axis.
    predicted_heading_rms_deg, predicted_heading_max_deg : float or None
        Heading error to expect over 24 level headings and +-30 deg of pitch and roll.
    extra : dict
        Further scalar results by name with unit (``dip_deg``, ``field_azimuth_deg``,
        ``base_level_north_deg``, ``hk_g``, ...) and ``<name>_sd`` where known.
    """

    method: str
    cause: Cause | None = None
    message: str = ""
    samples: int = 0
    offset_mg: NDArray[np.float64] | None = None
    matrix: NDArray[np.float64] | None = None
    accel_offset_g: NDArray[np.float64] | None = None
    accel_matrix: NDArray[np.float64] | None = None
    accel_from: str = ""
    field_mg: float | None = None
    dip_deg: float | None = None
    extended_dip_deg: float | None = None
    parameters: tuple[str, ...] = ()
    covariance: NDArray[np.float64] | None = None
    residual_rms_mg: float | None = None
    accel_residual_rms_g: float | None = None
    chi2_reduced: float | None = None
    dof: int | None = None
    rank: int | None = None
    condition: float | None = None
    coverage: float | None = None
    predicted_heading_rms_deg: float | None = None
    predicted_heading_max_deg: float | None = None
    extra: dict[str, float] = field(default_factory=dict)
    hk_mg: NDArray[np.float64] | None = None

    @property
    def two_axis(self) -> bool:
        """Whether the heading takes x and y alone and estimates z."""
        return self.extended_dip_deg is not None

    @property
    def refused(self) -> bool:
        """Whether the method refused the data."""
        return self.cause is not None

    def corrected_mg(self, field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the corrected field, shape (..., 3), of raw readings of that shape."""
        return self.body_mg(self.bridge_mg(field_mg))

    def bridge_mg(self, field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return raw readings, shape (..., 3), without the bridges' cross-axis term."""
        return field_mg if self.hk_mg is None else without_cross_axis(field_mg, self.hk_mg)

    def body_mg(self, field_mg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return matrix @ (field - offset_mg), shape (..., 3), of fields along the bridges."""
        if self.offset_mg is None or self.matrix is None:
            message = f"fit {self.method} was refused ({self.cause}) and has no coefficients"
            raise ValueError(message)
        return (field_mg - self.offset_mg) @ self.matrix.T

    def corrected_g(self, accel_g: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the corrected specific force; raw where the method does not calibrate it."""
        if self.accel_offset_g is None or self.accel_matrix is None:
            return np.asarray(accel_g, dtype=float)
        return (accel_g - self.accel_offset_g) @ self.accel_matrix.T


def refusal(
    method: str,
    cause: Cause,
    message: str,
    data: CalibrationData,
    *,
    rank: int | None = None,
    condition: float | None = None,
    coverage: float | None = None,
    residual_rms_mg: float | None = None,
    chi2_reduced: float | None = None,
    extra: dict[str, float] | None = None,
) -> Fit:
    """Return a refused fit: a cause, one sentence, and the evidence; no coefficients."""
    return Fit(
        method=method,
        cause=cause,
        message=message,
        samples=len(data),
        rank=rank,
        condition=condition,
        coverage=coverage,
        residual_rms_mg=residual_rms_mg,
        chi2_reduced=chi2_reduced,
        extra=extra or {},
    )
