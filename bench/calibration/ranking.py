"""Heading error that each method achieves on readings that it did not fit, in every order.

The tilt of a method without accelerometer coefficients comes from the accepted `accelerometer`
fit, else from `truth_aided`, else it is raw; raw readings keep the raw tilt. So the table compares
magnetometer methods under the same tilt, and `tilt_from` says whose it is. `tilt_aided` keeps the
tilt against which it was fitted.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.calibration.compensation import Order, compensated_heading_deg
from bench.calibration.fixture import perfect_heading_deg
from bench.calibration.level_turn import level_rows
from protocols.angles import wrap_180_deg, wrap_360_deg

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit

RAW: Final = "raw"
"""Key of the readings without coefficients, and of a tilt without coefficients."""
OWN: Final = "own"
GIVEN: Final = "given"
"""Tilt of readings without specific force: their own pitch and roll, or level."""
TILT_METHODS: Final = ("accelerometer", "truth_aided")
"""Methods whose accelerometer coefficients others borrow, the first accepted one."""
LEVEL_DEG: Final = 1.0
"""Rows whose pitch and roll are both smaller count as level."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingError:
    """Statistics of heading errors in degrees; `max_deg` is the largest magnitude."""

    rms_deg: float
    max_deg: float
    mean_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelAndTilt:
    """Heading errors of level and of tilted rows in degrees; None where there is no such row."""

    level_rms_deg: float | None
    level_max_deg: float | None
    tilt_rms_deg: float | None
    tilt_max_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RankedFit:
    """A fit, whose tilt it used, and the heading error achieved, if there was truth."""

    fit: Fit
    error: HeadingError | None
    tilt_from: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What raw readings and every accepted method achieve, in every order of compensation.

    Attributes
    ----------
    raw : LevelAndTilt
        Without coefficients: raw field, raw tilt.
    tilt_from : dict
        By accepted method: "own", "accelerometer", "truth_aided", "raw", or "given" where the
        readings hold no specific force.
    orders : dict
        By accepted method, then by order; a method for two axes knows the order "body" only.
    """

    raw: LevelAndTilt
    tilt_from: dict[str, str]
    orders: dict[str, dict[str, LevelAndTilt]]

    def as_dict(self) -> dict[str, Any]:
        """Return plain dictionaries, as the record and `fit --json` keep them."""
        return asdict(self)


def study(fits: Mapping[str, Fit], data: CalibrationData) -> Study:
    """Return the heading errors of raw readings and of each accepted fit in each order.

    Parameters
    ----------
    fits : mapping of str to Fit
        By method; refused ones are left out.
    data : CalibrationData
        Readings with the rig's azimuth that none of the fits used.

    Raises
    ------
    ValueError
        If the data have no azimuth.
    """
    accepted = {name: fit for name, fit in fits.items() if not fit.refused}
    borrowed = {name: borrowed_tilt(fit, fits, data) for name, fit in accepted.items()}
    return Study(
        raw=level_and_tilt(data, heading_errors_deg(data, None)),
        tilt_from={name: source for name, (source, _) in borrowed.items()},
        orders={
            name: achieved_by_order(fit, data, tilt=borrowed[name][1])
            for name, fit in accepted.items()
        },
    )


def achieved_by_order(
    fit: Fit, data: CalibrationData, *, tilt: Fit | None = None
) -> dict[str, LevelAndTilt]:
    """Return the heading errors of an accepted fit in each order of compensation.

    Parameters
    ----------
    tilt : Fit, optional
        Whose accelerometer coefficients it borrows (`borrowed_tilt`).
    """
    return {
        str(order): level_and_tilt(data, heading_errors_deg(data, fit, tilt=tilt, order=order))
        for order in orders_of(fit)
    }


def orders_of(fit: Fit) -> tuple[Order, ...]:
    """Return the orders of compensation in which a fit can be applied, the product's first."""
    return (Order.BODY,) if fit.two_axis else tuple(Order)


def borrowed_tilt(
    fit: Fit | None, fits: Mapping[str, Fit], data: CalibrationData
) -> tuple[str, Fit | None]:
    """Return whose accelerometer coefficients a fit uses: a name, and the fit where borrowed.

    Parameters
    ----------
    fit : Fit or None
        None for raw readings, which keep the raw tilt.
    fits : mapping of str to Fit
        All fits of the same readings by method.
    data : CalibrationData
        Where it holds no specific force, the tilt is given with the readings.
    """
    if data.accel_g is None:
        return GIVEN, None
    if fit is None:
        return RAW, None
    if fit.accel_from:
        return fit.accel_from, None
    if fit.accel_matrix is not None:
        return OWN, None
    for name in TILT_METHODS:
        other = fits.get(name)
        if other is not None and not other.refused and other.accel_matrix is not None:
            return name, other
    return RAW, None


def level_and_tilt(data: CalibrationData, errors_deg: NDArray[np.float64]) -> LevelAndTilt:
    """Return RMS and largest of errors, shape (n,), level and tilted apart."""
    level = is_level(data)
    level_rms_deg, level_max_deg = _rms_and_max(errors_deg[level])
    tilt_rms_deg, tilt_max_deg = _rms_and_max(errors_deg[~level])
    return LevelAndTilt(
        level_rms_deg=level_rms_deg,
        level_max_deg=level_max_deg,
        tilt_rms_deg=tilt_rms_deg,
        tilt_max_deg=tilt_max_deg,
    )


def is_level(data: CalibrationData) -> NDArray[np.bool_]:
    """Return, shape (n,), which rows are level: by the rig, else by the raw force, else all."""
    return level_rows(data, LEVEL_DEG)


def computed_heading_deg(
    data: CalibrationData,
    fit: Fit | None,
    *,
    tilt: Fit | None = None,
    order: Order = Order.BODY,
) -> NDArray[np.float64]:
    """Return the magnetic heading, shape (n,), that a fit makes of raw readings.

    Tilt is taken from the (corrected) specific force, without one from the rig's pitch and
    roll, without those as level. A fit of None leaves the readings raw.
    """
    pitch_deg = 0.0 if data.pitch_deg is None else data.pitch_deg
    roll_deg = 0.0 if data.roll_deg is None else data.roll_deg
    return compensated_heading_deg(
        fit,
        data.field_mg,
        data.accel_g,
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
        tilt=tilt,
        order=order,
    )


def expected_heading_deg(data: CalibrationData) -> NDArray[np.float64]:
    """Return the true magnetic heading, shape (n,), in [0, 360): azimuth less field azimuth.

    In a seat with iron it is what a perfect module would send there.

    Raises
    ------
    ValueError
        If the data have no azimuth.
    """
    if data.azimuth_deg is None:
        message = "azimuth_deg must be given for a heading error; instead received none"
        raise ValueError(message)
    if data.fixture_mg is not None:
        return perfect_heading_deg(data)
    return wrap_360_deg(data.azimuth_deg - data.field_azimuth_deg)


def heading_errors_deg(
    data: CalibrationData,
    fit: Fit | None,
    *,
    tilt: Fit | None = None,
    order: Order = Order.BODY,
) -> NDArray[np.float64]:
    """Return heading errors in (-180, 180], shape (n,); a fit of None leaves readings raw."""
    heading_deg = computed_heading_deg(data, fit, tilt=tilt, order=order)
    return wrap_180_deg(heading_deg - expected_heading_deg(data))


def heading_error(
    data: CalibrationData,
    fit: Fit | None,
    *,
    tilt: Fit | None = None,
    order: Order = Order.BODY,
) -> HeadingError:
    """Return RMS, maximum and mean of the heading errors."""
    errors_deg = heading_errors_deg(data, fit, tilt=tilt, order=order)
    return HeadingError(
        rms_deg=float(np.sqrt((errors_deg**2).mean())),
        max_deg=float(np.abs(errors_deg).max()),
        mean_deg=float(errors_deg.mean()),
    )


def rank(
    fits: Sequence[Fit], data: CalibrationData, *, order: Order = Order.BODY
) -> list[RankedFit]:
    """Return the fits, best first: by heading error where there is truth, else as predicted.

    Parameters
    ----------
    fits : sequence of Fit
        Of one set of readings; they borrow each other's tilt. Refused ones come last.
    data : CalibrationData
        Readings that none of the fits used.
    order : Order
        Order of compensation; fits for two axes keep the product's.
    """
    by_method = {fit.method: fit for fit in fits}
    has_truth = data.azimuth_deg is not None and len(data) > 0
    ranked = []
    for fit in fits:
        source, tilt = borrowed_tilt(fit, by_method, data)
        judged = has_truth and not fit.refused
        error = heading_error(data, fit, tilt=tilt, order=order) if judged else None
        ranked.append(RankedFit(fit=fit, error=error, tilt_from=source))
    return sorted(ranked, key=_place)


def _place(ranked: RankedFit) -> tuple[bool, float]:
    if ranked.error is not None:
        return (False, ranked.error.rms_deg)
    predicted = ranked.fit.predicted_heading_rms_deg
    return (ranked.fit.refused, float("inf") if predicted is None else predicted)


def _rms_and_max(errors_deg: NDArray[np.float64]) -> tuple[float | None, float | None]:
    if not len(errors_deg):
        return None, None
    return float(np.sqrt((errors_deg**2).mean())), float(np.abs(errors_deg).max())
