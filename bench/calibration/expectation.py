"""Heading error to expect of every method's coefficients, known before the verification.

The accepted truth-aided fit is a model of the unit: W and b of both sensors, field direction, base
level, their covariance, and what one reading is off. At an attitude it predicts the raw readings,
a method's coefficients make a heading of them, and that heading is off by a bias that is known
and by a part that is not: the model's covariance, carried through those same coefficients, the
next reading's own noise, and what the accelerometer's zero moves on until then. So it tells what
a method's own covariance cannot: what the method does not model.

Given the calibration readings, a method's coefficients are fixed numbers and only the unit is
uncertain; so one rule serves all methods, the truth-aided one among them (posterior predictive
distribution, JCGM 101 5.6). The errors of different poses count as independent in the maximum.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.special import ndtr

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.crossed_field import with_cross_axis
from bench.calibration.ranking import (
    RAW,
    LevelAndTilt,
    borrowed_tilt,
    expected_heading_deg,
    is_level,
)
from bench.calibration.truth_aided import ACCELEROMETER_PARAMETERS, MAGNETOMETER_PARAMETERS
from bench.calibration.truth_model import rig_poses
from bench.calibration.truth_rows import TruthModel, truth_rows
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit

UNIT_MODEL: Final = "truth_aided"
"""Method whose fit is taken for the unit itself."""
STEP: Final = 1e-4
"""Step of the heading's derivative by a reading, as a part of the field or of 1 g."""
CLAIM_WITHOUT: Final = {
    "set_reset": "nothing claimed",
    "min_max": "level only",
    "four_position": "level only",
    "soft_iron": "level only",
    "three_headings": "level only",
    "ellipsoid": "without rotation",
    "tilt_aided": "",
    "accelerometer": "tilt only",
    "two_axis": "without vertical iron",
    "two_axis_aided": "without vertical iron",
    "truth_aided": "",
}
"""What a method's own predicted error leaves out, as its fit says; empty where it is whole."""
REACH: Final = 8.0
NODES: Final = 1024
"""Standard deviations and steps over which the largest error is integrated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """RMS heading error in degrees that the noise of one pose's reading alone makes."""

    level_deg: float | None
    tilt_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """Heading errors to expect of raw readings and of every accepted method, and the noise's part.

    `errors` is by method; each largest error is the mean of the largest magnitude over the poses.
    """

    errors: dict[str, LevelAndTilt]
    noise: Noise

    def as_dict(self) -> dict[str, Any]:
        """Return plain dictionaries, as the record keeps them."""
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnitReadings:
    """What the unit's model makes of attitudes.

    Attributes
    ----------
    raw : ndarray, shape (n, 6) or (n, 3)
        Noiseless readings: magnetometer in mG, then accelerometer in g.
    jacobian : ndarray, shape (n, 6 or 3, p)
        Their derivative by the model's parameters.
    covariance : ndarray, shape (p, p)
    sd : ndarray, shape (6 or 3,)
        Standard deviation of one pose's reading: noise, repeatability, hysteresis, encoder, and
        what a linear sensor leaves.
    """

    raw: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    covariance: NDArray[np.float64]
    sd: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseErrors:
    """Heading error to expect at each pose, all shape (n,): its mean and standard deviations.

    `noise_sd_deg` is the part of the next reading's own noise; `sd_deg` holds all parts.
    """

    mean_deg: NDArray[np.float64]
    sd_deg: NDArray[np.float64]
    noise_sd_deg: NDArray[np.float64]


def expectation(
    fits: Mapping[str, Fit], data: CalibrationData, zero_change_g: float = 0.0
) -> Expectation | None:
    """Return the statistics of `expected_errors` over level and over tilted attitudes."""
    poses = expected_errors(fits, data, zero_change_g)
    if poses is None:
        return None
    level = is_level(data)
    noise = poses[UNIT_MODEL].noise_sd_deg ** 2
    return Expectation(
        errors={
            name: _level_and_tilt(errors.mean_deg, errors.sd_deg, level)
            for name, errors in poses.items()
        },
        noise=Noise(level_deg=_rms(noise[level]), tilt_deg=_rms(noise[~level])),
    )


def expected_errors(
    fits: Mapping[str, Fit], data: CalibrationData, zero_change_g: float = 0.0
) -> dict[str, PoseErrors] | None:
    """Return the heading errors to expect at the attitudes of `data`; its readings take no part.

    Parameters
    ----------
    fits : mapping of str to Fit
        By method, all of the same readings; refused ones are left out.
    data : CalibrationData
        Attitudes by the rig and the station's field. `accel_g` of None says that the tilt is
        given; a method without an accelerometer's coefficients else borrows it as in `study`.
    zero_change_g : float
        Standard deviation, each axis, of what the accelerometer's zero moves from the readings
        of the fits to these.

    Returns
    -------
    dict or None
        By "raw" and each accepted method. None where nothing models the unit: `truth_aided` was
        refused or not fitted, or has no accelerometer where one levels the heading; and without
        the rig's angles.
    """
    unit = fits.get(UNIT_MODEL)
    angles = (data.azimuth_deg, data.pitch_deg, data.roll_deg)
    if unit is None or unit.refused or any(angle is None for angle in angles):
        return None
    if data.accel_g is not None and unit.accel_matrix is None:
        return None
    readings = unit_readings(unit, data)
    accepted = {name: fit for name, fit in fits.items() if not fit.refused}
    tilts = {name: borrowed_tilt(fit, fits, data)[1] for name, fit in accepted.items()}
    return {
        name: _pose_errors(readings, data, fit, tilts.get(name), zero_change_g)
        for name, fit in ((RAW, None), *accepted.items())
    }


def unit_readings(unit: Fit, data: CalibrationData) -> UnitReadings:
    """Return what a truth-aided fit predicts at the attitudes of `data`.

    Its readings hold the fixture's iron and the bridges' cross-axis term as far as the bench knows
    them; their derivative leaves out the latter, which is below 1 %.
    """
    assert unit.matrix is not None  # noqa: S101
    assert unit.offset_mg is not None  # noqa: S101
    assert unit.field_mg is not None  # noqa: S101
    assert unit.covariance is not None  # noqa: S101
    levelled = unit.accel_matrix is not None
    names = MAGNETOMETER_PARAMETERS + (ACCELEROMETER_PARAMETERS if levelled else ())
    chosen = [unit.parameters.index(name) for name in names]
    to_solver = np.array([np.pi / 180.0 if _is_angle(name) else 1.0 for name in names])
    sd = _reading_sd(unit)
    assert data.azimuth_deg is not None  # noqa: S101
    assert data.pitch_deg is not None  # noqa: S101
    assert data.roll_deg is not None  # noqa: S101
    model = TruthModel(
        poses=rig_poses(data.azimuth_deg, data.pitch_deg, data.roll_deg),
        strength=unit.field_mg,
        field_sd=sd[0],
        accel_sd=sd[-1] if levelled else None,
        rig_sd_rad=0.0,
    )
    rows = truth_rows(model, _parameters(unit)[None])
    covariance = unit.covariance[np.ix_(chosen, chosen)] * to_solver[:, None] * to_solver
    raw = rows.modelled[0]
    if data.fixture_mg is not None:
        raw[:, :3] += np.linalg.solve(unit.matrix, data.fixture_mg)
    if unit.hk_mg is not None:
        raw = np.hstack([with_cross_axis(raw[:, :3], unit.hk_mg), raw[:, 3:]])
    return UnitReadings(raw=raw, jacobian=rows.jacobian[0], covariance=covariance, sd=sd)


def largest_deg(mean_deg: NDArray[np.float64], sd_deg: NDArray[np.float64]) -> float:
    """Return the mean of the largest magnitude of independent normal errors, shapes (n,).

    E max = integral of 1 - prod P(|error| <= x) over x from 0.

    >>> round(largest_deg(np.zeros(1), np.ones(1)) / (2.0 / np.pi) ** 0.5, 4)
    1.0
    >>> round(largest_deg(np.array([2.0, -3.0]), np.full(2, 1e-9)), 6)
    3.0
    """
    size = np.abs(mean_deg)
    first = max(float((size - REACH * sd_deg).max()), 0.0)
    last = float((size + REACH * sd_deg).max())
    x = np.linspace(first, last, NODES)[:, None]
    safe = np.maximum(sd_deg, 1e-12)
    inside = (ndtr((x - mean_deg) / safe) - ndtr((-x - mean_deg) / safe)).prod(axis=1)
    return first + float(np.trapezoid(1.0 - inside, x[:, 0]))


def _pose_errors(
    readings: UnitReadings,
    data: CalibrationData,
    fit: Fit | None,
    tilt: Fit | None,
    zero_change_g: float,
) -> PoseErrors:
    heading_deg = _heading_deg(readings.raw, data, fit, tilt)
    columns = []
    for axis, scale in enumerate(_scales(readings.raw)):
        change = np.zeros(readings.raw.shape[1])
        change[axis] = STEP * scale
        ends = [_heading_deg(readings.raw + sign * change, data, fit, tilt) for sign in (1.0, -1.0)]
        columns.append(wrap_180_deg(ends[0] - ends[1]) / (2.0 * STEP * scale))
    gradient = np.stack(columns, axis=1)
    by_parameter = np.einsum("ni,nip->np", gradient, readings.jacobian)
    by_unit = np.einsum("np,pq,nq->n", by_parameter, readings.covariance, by_parameter)
    by_noise = (gradient**2 * readings.sd**2).sum(axis=1)
    by_zero = (gradient[:, 3:] ** 2).sum(axis=1) * zero_change_g**2
    return PoseErrors(
        mean_deg=wrap_180_deg(heading_deg - expected_heading_deg(data)),
        sd_deg=np.sqrt(np.maximum(by_unit, 0.0) + by_noise + by_zero),
        noise_sd_deg=np.sqrt(by_noise),
    )


def _heading_deg(
    raw: NDArray[np.float64], data: CalibrationData, fit: Fit | None, tilt: Fit | None
) -> NDArray[np.float64]:
    """Return the heading of predicted readings, levelled by them or by the given tilt."""
    return compensated_heading_deg(
        fit,
        raw[:, :3],
        None if data.accel_g is None else raw[:, 3:],
        pitch_deg=0.0 if data.pitch_deg is None else data.pitch_deg,
        roll_deg=0.0 if data.roll_deg is None else data.roll_deg,
        tilt=tilt,
    )


def _scales(raw: NDArray[np.float64]) -> list[float]:
    field_mg = float(np.linalg.norm(raw[:, :3], axis=1).mean())
    return ([field_mg] * 3 + [1.0] * 3)[: raw.shape[1]]


def _parameters(unit: Fit) -> NDArray[np.float64]:
    """Return the fit's parameters in the order and the units of `truth_rows`."""
    assert unit.matrix is not None  # noqa: S101
    angles = (unit.extra[f"{name}_deg"] for name in ("field_azimuth", "dip"))
    parts = [np.linalg.inv(unit.matrix).ravel(), unit.offset_mg, np.deg2rad([*angles])]
    if unit.accel_matrix is not None:
        levels = (unit.extra[f"base_level_{way}_deg"] for way in ("north", "east"))
        parts += [np.linalg.inv(unit.accel_matrix).ravel(), unit.accel_offset_g]
        parts += [np.deg2rad([*levels])]
    return np.concatenate([np.asarray(part, dtype=float) for part in parts])


def _is_angle(name: str) -> bool:
    return name.startswith(("field_azimuth", "dip", "base_level"))


def _reading_sd(unit: Fit) -> NDArray[np.float64]:
    """Return the standard deviation of one pose's reading, by the residual and its freedom."""
    assert unit.residual_rms_mg is not None  # noqa: S101
    equations = 3 * unit.samples * (1 if unit.accel_residual_rms_g is None else 2)
    freedom = (equations - len(unit.parameters)) / equations
    sds = [unit.residual_rms_mg, unit.accel_residual_rms_g]
    known = np.repeat([sd for sd in sds if sd is not None], 3)
    return np.asarray(known / np.sqrt(max(freedom, 1e-3)))


def _level_and_tilt(
    mean_deg: NDArray[np.float64], sd_deg: NDArray[np.float64], level: NDArray[np.bool_]
) -> LevelAndTilt:
    found: dict[str, float | None] = {}
    for kind, rows in (("level", level), ("tilt", ~level)):
        found[f"{kind}_rms_deg"] = _rms(mean_deg[rows] ** 2 + sd_deg[rows] ** 2)
        some = bool(rows.any())
        found[f"{kind}_max_deg"] = largest_deg(mean_deg[rows], sd_deg[rows]) if some else None
    return LevelAndTilt(**found)


def _rms(squares: NDArray[np.float64]) -> float | None:
    return float(np.sqrt(squares.mean())) if len(squares) else None
