"""No estimator is confidently wrong: bad data are refused, flagged, or as good as predicted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pytest

from bench.calibration.ellipsoid_batch import CAUSES as ELLIPSOID_CAUSES
from bench.calibration.ellipsoid_batch import ellipsoid_batch
from bench.calibration.fit import CalibrationData, Cause
from bench.calibration.methods import METHODS, fit_named
from bench.calibration.prediction import grid_attitudes_deg
from bench.calibration.tilt import ned_from_body, tilt_compensated_heading_deg
from bench.calibration.tilt_aided_batch import CAUSES as TILT_CAUSES
from bench.calibration.tilt_aided_batch import tilt_aided_batch
from bench.calibration.truth_aided_batch import CAUSES as TRUTH_CAUSES
from bench.calibration.truth_aided_batch import truth_aided_batch
from bench.calibration.truth_aided_linear import CAUSES as LINEAR_CAUSES
from bench.calibration.truth_aided_linear import truth_aided_linear
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Spoil = Callable[["Unit", np.random.Generator], "Unit"]

FIELD_SD_MG, ACCEL_SD_G, RIG_SD_DEG = 0.35, 0.0005, 0.02
STATION: Final = 500.0 * np.array([np.cos(np.deg2rad(62.0)), 0.0, np.sin(np.deg2rad(62.0))])
LARGEST_RATIO: Final = 3.0
"""True over predicted error from which a fit that says nothing is confidently wrong."""
ESTIMATORS: Final = ("ellipsoid", "tilt_aided", "truth_aided")
SEEDS: Final = range(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Unit:
    """A module, what it read at attitudes, and what it reads on the verification grid."""

    angles_deg: NDArray[np.float64]
    gain: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    field_mg: NDArray[np.float64]
    accel_g: NDArray[np.float64]

    def data(self) -> CalibrationData:
        azimuth_deg, pitch_deg, roll_deg = self.angles_deg.T
        return CalibrationData(
            field_mg=self.field_mg,
            accel_g=self.accel_g,
            azimuth_deg=azimuth_deg,
            pitch_deg=pitch_deg,
            roll_deg=roll_deg,
            field_sd_mg=FIELD_SD_MG,
            accel_sd_g=ACCEL_SD_G,
            rig_sd_deg=RIG_SD_DEG,
            noise_known=True,
            station_field_mg=STATION,
        )


ACCEL_GAIN: Final = np.eye(3) + 0.01 * np.array(
    [[1.0, 0.4, -0.8], [-0.5, -1.2, 0.3], [0.9, -0.2, 0.6]]
)
ACCEL_OFFSET_G: Final = np.array([0.02, -0.015, 0.01])


def read(
    angles_deg: NDArray[np.float64], rng: np.random.Generator, *, strength: float = 1.0
) -> Unit:
    """Draw a module and read it at attitudes."""
    gain = np.eye(3) + rng.normal(0.0, 0.06, (3, 3))
    offset_mg = rng.normal(0.0, 80.0, 3)
    ned = ned_from_body(*(angles_deg + rng.normal(0.0, RIG_SD_DEG, angles_deg.shape)).T)
    field = strength * np.einsum("nji,j->ni", ned, STATION) @ gain.T + offset_mg
    force = -ned[:, 2] @ ACCEL_GAIN.T + ACCEL_OFFSET_G
    return Unit(
        angles_deg=angles_deg,
        gain=gain,
        offset_mg=offset_mg,
        field_mg=field + rng.normal(0.0, FIELD_SD_MG, field.shape),
        accel_g=force + rng.normal(0.0, ACCEL_SD_G, force.shape),
    )


def all_round(rng: np.random.Generator, count: int = 48, tilt: float = 45.0) -> Unit:
    azimuth_deg = np.arange(count) * 222.5
    return read(np.column_stack([azimuth_deg, *rng.uniform(-tilt, tilt, (2, count))]), rng)


def ring(pitch_deg: float = 0.0, roll_deg: float = 0.0, count: int = 16) -> list[tuple[float, ...]]:
    return [(360.0 * index / count, pitch_deg, roll_deg) for index in range(count)]


def disturbed(unit: Unit, rng: np.random.Generator, count: int, size_mg: float) -> Unit:
    field_mg = unit.field_mg.copy()
    chosen = rng.choice(len(field_mg), count, replace=False)
    field_mg[chosen] += size_mg * rng.normal(size=(count, 3))
    return replace(unit, field_mg=field_mg)


def beside_a_magnet(unit: Unit, size_mg: float, *, fixed: bool) -> Unit:
    """Return the readings with a dipole at the rig's arm (fixed), or one that swings along."""
    ned = ned_from_body(*unit.angles_deg.T)
    arm = ned[:, :, 0] if fixed else ned[:, :, 1]
    away = np.array([0.9, 0.5, 0.3]) - 0.25 * arm
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    moment = np.array([0.3, -0.8, 0.5])
    along = (away @ moment)[:, None] / distance**2
    dipole = size_mg * (3.0 * along * away - moment) / distance**3
    return replace(
        unit, field_mg=unit.field_mg + np.einsum("nji,nj->ni", ned, dipole) @ unit.gain.T
    )


def saturated(unit: Unit, axis: int) -> Unit:
    field_mg = unit.field_mg.copy()
    field_mg[:, axis] = np.minimum(field_mg[:, axis], np.quantile(field_mg[:, axis], 0.8))
    return replace(unit, field_mg=field_mg)


def scaled(unit: Unit, factor: float) -> Unit:
    return replace(
        unit,
        field_mg=factor * unit.field_mg,
        gain=factor * unit.gain,
        offset_mg=factor * unit.offset_mg,
    )


def rewired(unit: Unit, wiring: NDArray[np.float64]) -> Unit:
    return replace(
        unit,
        field_mg=unit.field_mg @ wiring.T,
        gain=wiring @ unit.gain,
        offset_mg=wiring @ unit.offset_mg,
    )


def moved(unit: Unit, offset_mg: float) -> Unit:
    return replace(unit, field_mg=unit.field_mg + offset_mg, offset_mg=unit.offset_mg + offset_mg)


def drifting(unit: Unit, size_mg: float) -> Unit:
    time = np.linspace(-0.5, 0.5, len(unit.field_mg))[:, None]
    return replace(unit, field_mg=unit.field_mg + size_mg * time * [1.0, -0.6, 0.8])


UNITS: Final[dict[str, Callable[[np.random.Generator], Unit]]] = {
    "good": all_round,
    "good, 12 poses": lambda rng: all_round(rng, 12),
    "level only": lambda rng: read(np.array(ring()), rng),
    "single tilt": lambda rng: read(np.array(ring(20.0)), rng),
    "level and one tilt": lambda rng: read(np.array(ring() + ring(25.0)), rng),
    "pitch only": lambda rng: read(np.array(ring() + ring(30.0) + ring(-30.0)), rng),
    "clustered": lambda rng: read(5.0 * rng.normal(size=(40, 3)), rng),
    "clustered wider": lambda rng: read(15.0 * rng.normal(size=(40, 3)), rng),
    "few poses twice": lambda rng: read(np.repeat(all_round(rng, 6).angles_deg, 6, axis=0), rng),
    "two the same": lambda rng: read(all_round(rng).angles_deg[[0, *range(47)]], rng),
    "saturated x": lambda rng: saturated(all_round(rng), 0),
    "saturated z": lambda rng: saturated(all_round(rng), 2),
    "4 poses by 400 mG": lambda rng: disturbed(all_round(rng), rng, 4, 400.0),
    "4 poses by 20 mG": lambda rng: disturbed(all_round(rng), rng, 4, 20.0),
    "4 poses by 2 mG": lambda rng: disturbed(all_round(rng), rng, 4, 2.0),
    "14 poses by 20 mG": lambda rng: disturbed(all_round(rng), rng, 14, 20.0),
    "30 poses by 20 mG": lambda rng: disturbed(all_round(rng), rng, 30, 20.0),
    "30 poses by 3 mG": lambda rng: disturbed(all_round(rng), rng, 30, 3.0),
    "magnet beside, 30 mG": lambda rng: beside_a_magnet(all_round(rng), 30.0, fixed=True),
    "magnet beside, 3 mG": lambda rng: beside_a_magnet(all_round(rng), 3.0, fixed=True),
    "magnet swings, 300 mG": lambda rng: beside_a_magnet(all_round(rng), 300.0, fixed=False),
    "magnet swings, 10 mG": lambda rng: beside_a_magnet(all_round(rng), 10.0, fixed=False),
    "drift of 10 mG": lambda rng: drifting(all_round(rng), 10.0),
    "drift of 2 mG": lambda rng: drifting(all_round(rng), 2.0),
    "constant": lambda rng: replace(all_round(rng), field_mg=np.full((48, 3), 100.0)),
    "all zero": lambda rng: replace(all_round(rng), field_mg=np.zeros((48, 3))),
    "no field": lambda rng: read(all_round(rng).angles_deg, rng, strength=0.0),
    "weak field": lambda rng: read(all_round(rng).angles_deg, rng, strength=0.01),
    "in microtesla": lambda rng: scaled(all_round(rng), 0.1),
    "in gauss": lambda rng: scaled(all_round(rng), 0.001),
    "in nanotesla": lambda rng: scaled(all_round(rng), 100.0),
    "1e6 times": lambda rng: scaled(all_round(rng), 1e6),
    "1e150 times": lambda rng: scaled(all_round(rng), 1e150),
    "mirrored y": lambda rng: rewired(all_round(rng), np.diag([1.0, -1.0, 1.0])),
    "x and y swapped": lambda rng: rewired(all_round(rng), np.eye(3)[[1, 0, 2]]),
    "axes turned": lambda rng: rewired(all_round(rng), np.eye(3)[[1, 2, 0]]),
    "offset of 5 G": lambda rng: moved(all_round(rng), 5e3),
    "offset of 1e6 mG": lambda rng: moved(all_round(rng), 1e6),
    "y reads as x": lambda rng: rewired(all_round(rng), np.eye(3)[[0, 0, 2]]),
    "angles of another run": lambda rng: replace(
        all_round(rng), angles_deg=all_round(rng).angles_deg[::-1]
    ),
}


AT_GRID: Final = grid_attitudes_deg()
BLIND_TO_MIRRORS: Final = ("mirrored y", "x and y swapped")
"""What the magnetometer alone cannot see, and its message says so."""
MUST_REFUSE: Final[dict[str, tuple[str, ...]]] = {
    "level only": ESTIMATORS,
    "single tilt": ESTIMATORS,
    "level and one tilt": ESTIMATORS,
    "clustered": ESTIMATORS,
    "pitch only": ("tilt_aided", "truth_aided"),
    "few poses twice": ("ellipsoid", "tilt_aided"),
    "saturated x": ESTIMATORS,
    "saturated z": ESTIMATORS,
    "14 poses by 20 mG": ESTIMATORS,
    "30 poses by 20 mG": ESTIMATORS,
    "30 poses by 3 mG": ESTIMATORS,
    "magnet beside, 30 mG": ESTIMATORS,
    "magnet swings, 300 mG": ESTIMATORS,
    "magnet swings, 10 mG": ESTIMATORS,
    "drift of 10 mG": ESTIMATORS,
    "constant": ESTIMATORS,
    "all zero": ESTIMATORS,
    "no field": ESTIMATORS,
    "in gauss": ESTIMATORS,
    "1e6 times": ESTIMATORS,
    "1e150 times": ESTIMATORS,
    "y reads as x": ESTIMATORS,
    "mirrored y": ("tilt_aided",),
    "x and y swapped": ("tilt_aided",),
}
MUST_ACCEPT: Final = ("good", "two the same", "4 poses by 20 mG", "offset of 5 G", "axes turned")


@dataclass(frozen=True, kw_only=True, eq=False)
class Result:
    """What an estimator said; the coefficients of an accepted fit."""

    cause: Cause | None
    matrix: NDArray[np.float64] | None = None
    offset_mg: NDArray[np.float64] | None = None
    accel_matrix: NDArray[np.float64] | None = None
    accel_offset_g: NDArray[np.float64] | None = None
    predicted_deg: float = 0.0
    numbers: tuple[Any, ...] = ()


def by_wrapper(estimator: str, unit: Unit) -> Result:
    fit = fit_named(estimator, unit.data())
    assert fit.cause is None or fit.message
    return Result(
        cause=fit.cause,
        matrix=fit.matrix,
        offset_mg=fit.offset_mg,
        accel_matrix=fit.accel_matrix,
        accel_offset_g=fit.accel_offset_g,
        predicted_deg=fit.predicted_heading_rms_deg or 0.0,
        numbers=(fit.covariance, fit.predicted_heading_max_deg, *fit.extra.values()),
    )


def by_kernel(estimator: str, unit: Unit) -> Result:
    if estimator == "truth_aided":
        fits = truth_aided_batch(
            unit.angles_deg, unit.field_mg, unit.accel_g, accel_sd_g=ACCEL_SD_G, **RIG
        )
        return Result(
            cause=TRUTH_CAUSES[int(fits.cause)],
            matrix=np.linalg.inv(fits.gain),
            offset_mg=fits.offset_mg,
            accel_matrix=np.linalg.inv(fits.accel_gain),
            accel_offset_g=fits.accel_offset_g,
            predicted_deg=float(fits.predicted_rms_deg),
            numbers=tuple(getattr(fits, name) for name in fits.__slots__),
        )
    station: dict[str, Any] = {"station_field_mg": STATION}
    if estimator == "ellipsoid":
        fits: Any = ellipsoid_batch(unit.field_mg, FIELD_SD_MG, **station)
        causes = ELLIPSOID_CAUSES
    elif estimator == "tilt_aided":
        force = (unit.accel_g - ACCEL_OFFSET_G) @ np.linalg.inv(ACCEL_GAIN).T
        fits = tilt_aided_batch(unit.field_mg, force, FIELD_SD_MG, ACCEL_SD_G, **station)
        causes = TILT_CAUSES
    else:
        fits = truth_aided_linear(unit.angles_deg, unit.field_mg, **RIG)
        causes = LINEAR_CAUSES
    return Result(
        cause=causes[int(fits.cause)],
        matrix=fits.matrix,
        offset_mg=fits.offset_mg,
        predicted_deg=float(fits.predicted_rms_deg),
        numbers=tuple(getattr(fits, name) for name in type(fits).__dataclass_fields__),
    )


RIG: Final[dict[str, Any]] = {
    "field_sd_mg": FIELD_SD_MG,
    "rig_sd_deg": RIG_SD_DEG,
    "station_field_mg": STATION,
}


def true_rms_deg(unit: Unit, result: Result, *, without_rotation: bool) -> float:
    """Return the heading error that the coefficients leave on the verification grid."""
    ned = ned_from_body(*AT_GRID.T)
    truth = np.einsum("nji,j->ni", ned, STATION)
    corrected = (truth @ unit.gain.T + unit.offset_mg - result.offset_mg) @ result.matrix.T
    if without_rotation:
        left, _, right = np.linalg.svd(corrected.T @ truth)
        proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
        corrected = corrected @ left @ proper @ right
    force = -ned[:, 2]
    if result.accel_matrix is not None:
        raw = force @ ACCEL_GAIN.T + ACCEL_OFFSET_G
        force = (raw - result.accel_offset_g) @ result.accel_matrix.T
    heading_deg = tilt_compensated_heading_deg(corrected, force)
    return float(np.sqrt((wrap_180_deg(heading_deg - AT_GRID[:, 0]) ** 2).mean()))


CASES: Final = [
    (name, estimator, by)
    for name in UNITS
    for by, estimators in (
        (by_wrapper, ESTIMATORS),
        (by_kernel, (*ESTIMATORS, "truth_aided_linear")),
    )
    for estimator in estimators
]


@pytest.mark.parametrize(
    ("name", "estimator", "by"), CASES, ids=[f"{a}-{b}-{c.__name__[3:]}" for a, b, c in CASES]
)
def test_bad_data_are_refused_or_as_good_as_predicted(
    name: str, estimator: str, by: Callable[[str, Unit], Result]
) -> None:
    for seed in SEEDS:
        unit = UNITS[name](np.random.default_rng(seed))
        result = by(estimator, unit)
        assert all(np.isfinite(np.asarray(one)).all() for one in result.numbers if one is not None)
        if estimator in MUST_REFUSE.get(name, ()):
            assert result.cause is not None
        if name in MUST_ACCEPT and (by is by_wrapper or name[0] != "4"):
            assert result.cause is None
        if result.cause is not None:
            continue
        assert np.isfinite(result.matrix).all()
        assert estimator != "ellipsoid" or (np.linalg.eigvalsh(result.matrix) > 0.0).all()
        if estimator == "ellipsoid" and name in BLIND_TO_MIRRORS:
            assert by is by_kernel  # the wrapper has force and station to tell
            continue
        error_deg = true_rms_deg(unit, result, without_rotation=estimator == "ellipsoid")
        assert error_deg < LARGEST_RATIO * result.predicted_deg, (seed, error_deg)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_values_that_are_no_numbers_are_errors_and_never_a_fit(estimator: str) -> None:
    unit = all_round(np.random.default_rng(1))
    for value in (np.nan, np.inf):
        unit.field_mg[7, 1] = value
        with pytest.raises(ValueError, match="must be finite"):
            by_wrapper(estimator, unit)
        with pytest.raises(ValueError, match="must be finite"):
            by_kernel(estimator, unit)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_guessed_noise_refuses_no_unit_for_it_and_is_no_less_honest(estimator: str) -> None:
    for name in ("30 poses by 3 mG", "drift of 2 mG", "weak field"):
        unit = UNITS[name](np.random.default_rng(2))
        fit = METHODS[estimator](replace(unit.data(), noise_known=False))
        if fit.refused:
            assert name == "weak field"
            continue
        result = Result(
            cause=None,
            matrix=fit.matrix,
            offset_mg=fit.offset_mg,
            accel_matrix=fit.accel_matrix,
            accel_offset_g=fit.accel_offset_g,
        )
        error_deg = true_rms_deg(unit, result, without_rotation=estimator == "ellipsoid")
        assert error_deg < LARGEST_RATIO * fit.predicted_heading_rms_deg


@pytest.mark.parametrize("size_mg", [5.0, 20.0, 60.0])
def test_forty_of_seventy_two_disturbed_poses_are_never_accepted(size_mg: float) -> None:
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        unit = disturbed(all_round(rng, 72), rng, 40, size_mg)
        for estimator in ESTIMATORS:
            for by in (by_wrapper, by_kernel):
                assert by(estimator, unit).cause in {
                    Cause.RESIDUAL_TOO_LARGE,
                    Cause.FIELD_DISTURBED,
                    Cause.NOT_CONVERGED,
                }
