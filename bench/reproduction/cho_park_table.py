"""Cho & Park's first experiment: extended dip angles from tilting at known azimuths (Table 1).

The module is levelled and turned once, normalised by its extremes (27)-(28), then tilted at six
azimuths that are set by hand. Each sample gives an angle by (26); the paper adopts those beyond
30 deg of tilt. Beside it stands the product's weighted least squares over all samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import CalibrationData
from bench.calibration.min_max import fit_min_max
from bench.calibration.tilt import ned_from_body, two_axis_attitude_deg
from bench.calibration.two_axis import extended_dip_batch
from bench.errors import BenchNotReady
from bench.pose import Attitude
from bench.reproduction.printed_formulas import printed_extended_dip_deg
from bench.reproduction.setup import Setup

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.calibration.fit import Fit
    from bench.reproduction.laboratory import Laboratory

SITE_DIP_DEG: Final = 48.72
HORIZONTAL_MG: Final = 300.0
ADOPTED_TILT_DEG: Final = 30.0
HAND_SD_DEG: Final = 2.0
"""Azimuth of a module that is set by hand on a table and tilted by hand."""
NOISE_MG: Final = 2.0
ACCEL_NOISE_G: Final = 0.002
DWELL_SAMPLES: Final = 5
READING_SD_MG: Final = NOISE_MG / math.sqrt(2.0 * DWELL_SAMPLES)
"""Of (set - reset)/2, mean of one dwell."""
TILT_SD_DEG: Final = math.degrees(ACCEL_NOISE_G / math.sqrt(DWELL_SAMPLES))
TWO_AXES: Final = Setup(
    part="CB-AMR2",
    horizontal_mg=HORIZONTAL_MG,
    dip_deg=SITE_DIP_DEG,
    hard_iron_mg=(30.0, -20.0, 0.0),
    sensitivity=(1.05, 0.95, 1.0),
    noise_mg=NOISE_MG,
    accel_noise_g=ACCEL_NOISE_G,
    accel_bias_g=(0.010, -0.006, 0.0),
    seed=2005,
)
"""Fluxgate and accelerometers of the paper's class: one setting for all of its experiments.

ADXL202E: 0.0002 g/sqrt(Hz) is 0.002 g at 60 Hz; a zero off by 0.01 g is 5 deg C of its drift.
The paper gives no noise of its fluxgate; 2 mG is 0.4 % of the field.
"""
LEVEL_TURN: Final = tuple(Attitude(azimuth_deg=float(a)) for a in range(0, 360, 10))
STEP_DEG: Final = 4.0
_FIELD: Final = np.array([1.0, 0.0, math.tan(math.radians(SITE_DIP_DEG))])
REPEATS: Final = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One row of Table 1.

    Attributes
    ----------
    key : str
        Letter of the figure.
    azimuth_deg : float
        As set by hand.
    legs : tuple of (pitch, roll)
        Tilts, one after the other, each there and back.
    published_deg : float
    condition : str
        As printed.
    """

    key: str
    azimuth_deg: float
    legs: tuple[tuple[float, float], ...]
    published_deg: float
    condition: str

    def poses(self, twist_deg: float = 0.0) -> list[Attitude]:
        """Return the attitudes; the azimuth is off by a twist that nobody knows of."""
        poses = []
        for pitch_deg, roll_deg in self.legs:
            steps = round(max(abs(pitch_deg), abs(roll_deg)) / STEP_DEG)
            there = np.arange(steps + 1) / steps
            poses += [
                Attitude(
                    azimuth_deg=self.azimuth_deg + twist_deg,
                    pitch_deg=float(part * pitch_deg),
                    roll_deg=float(part * roll_deg),
                )
                for part in np.concatenate([there, there[-2::-1]])
            ]
        return poses


DOWN: Final = ((-80.0, 0.0),)
SWEEPS: Final = (
    Sweep(key="a", azimuth_deg=45.0, legs=DOWN, published_deg=49.01, condition="pitch"),
    Sweep(key="b", azimuth_deg=135.0, legs=DOWN, published_deg=49.22, condition="pitch"),
    Sweep(key="c", azimuth_deg=225.0, legs=DOWN, published_deg=47.64, condition="pitch"),
    Sweep(key="d", azimuth_deg=315.0, legs=DOWN, published_deg=49.85, condition="pitch"),
    Sweep(
        key="e",
        azimuth_deg=45.0,
        legs=((-48.0, 0.0), (0.0, 48.0)),
        published_deg=47.24,
        condition="pitch, then roll",
    ),
    Sweep(
        key="f",
        azimuth_deg=315.0,
        legs=((0.0, -80.0), (-80.0, 0.0)),
        published_deg=49.77,
        condition="roll, then pitch",
    ),
)
BOTH_SIDES: Final = Sweep(
    key="4", azimuth_deg=45.0, legs=(), published_deg=SITE_DIP_DEG, condition="pitch"
)
"""Fig. 4, nose down and up, closer together near level."""
BOTH_SIDES_PITCH_DEG: Final = np.concatenate(
    [np.arange(-80.0, -4.0, 4.0), np.arange(-4.0, 4.0, 0.5), np.arange(4.0, 80.1, 4.0)]
)
PUBLISHED_MEAN_DEG: Final = 48.79
PUBLISHED_SD_DEG: Final = 1.09


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tilting:
    """What one sweep gave; arrays of shape (n,).

    Attributes
    ----------
    x, y : ndarray
        Normalised by the level turn.
    pitch_deg, roll_deg : ndarray
        From two accelerometers (17).
    dip_deg : ndarray
        (26) as printed, of each sample.
    adopted_deg, fitted_deg : float
        Mean of the samples beyond 30 deg of tilt; weighted least squares over all.
    """

    sweep: Sweep
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    pitch_deg: NDArray[np.float64]
    roll_deg: NDArray[np.float64]
    dip_deg: NDArray[np.float64]
    adopted_deg: float
    fitted_deg: float


def normalisation(lab: Laboratory) -> Fit:
    """Return the min-max fit of one level turn, with the accelerometers' zeros at level."""
    turn = lab.measure(LEVEL_TURN)
    fit = fit_min_max(CalibrationData(field_mg=turn["field_mg"], field_sd_mg=READING_SD_MG))
    if fit.refused:
        raise BenchNotReady(fit.message)
    zero_g = turn["accel_g"].mean(axis=0) * [1.0, 1.0, 0.0]
    return replace(fit, accel_offset_g=zero_g, accel_matrix=np.eye(3))


def twists_deg(seed: int) -> NDArray[np.float64]:
    """Return how far each azimuth set by hand is off, shape (6,)."""
    return np.random.default_rng(seed).normal(0.0, HAND_SD_DEG, len(SWEEPS))


def tilt_at(lab: Laboratory, normal: Fit, sweep: Sweep, twist_deg: float) -> Tilting:
    """Tilt the module through one sweep and estimate its extended dip angle."""
    readings = lab.measure(sweep.poses(twist_deg))
    return tilting_of(sweep, normal, readings["field_mg"], readings["accel_g"])


def tilt_both_sides(lab: Laboratory, normal: Fit, twist_deg: float) -> Tilting:
    """Pitch the module from nose down to nose up at the azimuth of row (a)."""
    azimuth_deg = BOTH_SIDES.azimuth_deg + twist_deg
    poses = [Attitude(azimuth_deg=azimuth_deg, pitch_deg=float(p)) for p in BOTH_SIDES_PITCH_DEG]
    readings = lab.measure(poses)
    return tilting_of(BOTH_SIDES, normal, readings["field_mg"], readings["accel_g"])


def tilting_of(
    sweep: Sweep, normal: Fit, field_mg: NDArray[np.float64], accel_g: NDArray[np.float64]
) -> Tilting:
    """Estimate the extended dip angle from raw readings of one sweep, shape (n, 3)."""
    assert normal.field_mg is not None  # noqa: S101
    x, y, _ = (normal.corrected_mg(field_mg) / normal.field_mg).T
    pitch_deg, roll_deg = two_axis_attitude_deg(normal.corrected_g(accel_g))
    dip_deg, adopted_deg, fitted_deg = estimates_deg(x, y, pitch_deg, roll_deg, sweep.azimuth_deg)
    return Tilting(
        sweep=sweep,
        x=x,
        y=y,
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
        dip_deg=dip_deg,
        adopted_deg=float(adopted_deg),
        fitted_deg=float(fitted_deg),
    )


def estimates_deg(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    pitch_deg: NDArray[np.float64],
    roll_deg: NDArray[np.float64],
    azimuth_deg: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return (26) of each sample, its mean beyond 30 deg of tilt, and weighted least squares.

    All inputs have the shape (..., n); the means have (...).
    """
    dip_deg = printed_extended_dip_deg(x, y, pitch_deg, roll_deg, azimuth_deg)
    level = np.cos(np.deg2rad(pitch_deg)) * np.cos(np.deg2rad(roll_deg))
    adopted = level < np.cos(np.deg2rad(ADOPTED_TILT_DEG))
    mean_deg = np.where(adopted, dip_deg, 0.0).sum(axis=-1) / adopted.sum(axis=-1)
    fitted = extended_dip_batch(
        x,
        y,
        pitch_deg,
        roll_deg,
        azimuth_deg,
        field_sd=READING_SD_MG / HORIZONTAL_MG,
        azimuth_sd_deg=HAND_SD_DEG,
        tilt_sd_deg=TILT_SD_DEG,
    )
    return dip_deg, mean_deg, fitted.dip_deg


def exact_dip_deg(pitch_deg: NDArray[np.float64], twist_deg: float) -> NDArray[np.float64]:
    """Return (26) without noise, at row (a)'s azimuth off by a twist, shape (n,)."""
    azimuth_deg = BOTH_SIDES.azimuth_deg
    field = _FIELD @ ned_from_body(azimuth_deg + twist_deg, pitch_deg, 0.0)
    return printed_extended_dip_deg(field[:, 0], field[:, 1], pitch_deg, 0.0, azimuth_deg)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """Six rows of many repeats of the experiment, shape (repeats, 6)."""

    adopted_deg: NDArray[np.float64]
    fitted_deg: NDArray[np.float64]


def rows_of_twists_deg(twists: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return six rows by the paper's rule that azimuth errors, shape (6,), make without noise."""
    rows = []
    for sweep, twist_deg in zip(SWEEPS, twists, strict=True):
        azimuth, pitch, roll = _angles_deg(sweep.poses(float(twist_deg)))
        # Level samples, which (26) turns into anything, are not adopted.
        x, y, _ = (_FIELD @ ned_from_body(azimuth, pitch, roll)).T
        rows.append(float(estimates_deg(x, y, pitch, roll, sweep.azimuth_deg)[1]))
    return np.array(rows)


def predicted_spread(
    sweeps: Sequence[Sweep] = SWEEPS, *, hand_sd_deg: float = HAND_SD_DEG
) -> Spread:
    """Return what the stated noise makes of each row, from repeats without the bus.

    Exact fields of the site, the noise of `TWO_AXES` and of the hand, the same estimators.
    The tolerances of Table 1 come from here; its values never do.
    """
    rng = np.random.default_rng(TWO_AXES.seed + 1)
    turn = _horizontal_of(LEVEL_TURN, np.zeros((REPEATS, 1))) * HORIZONTAL_MG
    turn += rng.normal(0.0, READING_SD_MG, turn.shape)
    high, low = turn.max(axis=1), turn.min(axis=1)
    adopted, fitted = [], []
    for sweep in sweeps:
        poses = sweep.poses()
        field = _horizontal_of(poses, rng.normal(0.0, hand_sd_deg, (REPEATS, 1))) * HORIZONTAL_MG
        field += rng.normal(0.0, READING_SD_MG, field.shape)
        unit = (field - (high + low)[:, None] / 2.0) / ((high - low)[:, None] / 2.0)
        force_g = _force_g(poses)
        noise = rng.normal(0.0, ACCEL_NOISE_G / np.sqrt(DWELL_SAMPLES), (REPEATS, *force_g.shape))
        attitude_deg = two_axis_attitude_deg(force_g + noise)
        rows = estimates_deg(unit[..., 0], unit[..., 1], *attitude_deg, sweep.azimuth_deg)
        adopted.append(rows[1])
        fitted.append(rows[2])
    return Spread(adopted_deg=np.transpose(adopted), fitted_deg=np.transpose(fitted))


def _horizontal_of(
    poses: Sequence[Attitude], twist_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return x and y of the site's field over its horizontal part, shape (repeats, n, 2)."""
    azimuth, pitch, roll = _angles_deg(poses)
    return np.asarray((_FIELD @ ned_from_body(azimuth + twist_deg, pitch, roll))[..., :2])


def _force_g(poses: Sequence[Attitude]) -> NDArray[np.float64]:
    return np.asarray(np.array([0.0, 0.0, -1.0]) @ ned_from_body(*_angles_deg(poses)))


def _angles_deg(poses: Sequence[Attitude]) -> NDArray[np.float64]:
    return np.array([(p.azimuth_deg, p.pitch_deg, p.roll_deg) for p in poses]).T
