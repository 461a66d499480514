"""One recording, one method or all: the object that `fit --json` prints."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.calibration.compensation import Order
from bench.calibration.fit import rows_of
from bench.calibration.methods import fit_all, fit_named, require_finite
from bench.calibration.ranking import (
    TILT_METHODS,
    HeadingError,
    achieved_by_order,
    borrowed_tilt,
    heading_error,
    orders_of,
    rank,
    study,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit

BLOCK_ROWS: Final = 20
HOLDOUTS: Final = ("blocks", "none")
ALL: Final = "all"


def fit_report(
    data: CalibrationData, method: str, holdout: str = "blocks", order: str = Order.BODY
) -> dict[str, Any]:
    """Return the JSON object of one method, or of all with ``method="all"``.

    Parameters
    ----------
    data : CalibrationData
        Rows of a recording. Where it has azimuths, `holdout` decides which rows are fitted and
        which judge; without azimuths every row is fitted.
    method : str
        A name of `METHODS`, or "all": then the object holds ``ranking``, a list of the objects
        of every method, best first, refused ones last.
    holdout : {"blocks", "none"}
        "blocks" fits the first, third, ... block of 20 rows and judges the others; a recording
        of less than 80 rows takes every second row. "none" fits and judges all rows.
    order : str
        Order of compensation (`compensation.Order`) of ``heading_error_deg`` and of the ranking.

    Returns
    -------
    dict
        Keys method, samples, cause, message, offset, matrix, field, dip_deg, extended_dip_deg,
        covariance, residual_rms, chi2_reduced, rank, condition, coverage,
        predicted_heading_rms_deg, extra, order, tilt_from and, where there are azimuths,
        heading_error_deg with ``before`` and ``after`` (None if refused), each rms, max, mean,
        orders: by order of compensation the level and the tilted error (empty if refused), and
        raw: the same without coefficients (beside ``ranking`` where there is one).
        A method for two axes knows the order "body" only, and its object says so. Every number
        is finite; what is not known is None.

    Raises
    ------
    ValueError
        If method, holdout or order has no such name, or the data are not finite or not of one
        length.

    Examples
    --------
    >>> fit_report(data_of_a_turn(), "min_max")["offset"]
    [40.0, -30.0, 0.0]
    >>> fit_report(data_of_a_turn(), "ellipsoid")["cause"]
    'tilt_too_small'
    """
    chosen = _order(order)
    if method != ALL:
        fit, judged = fitted(data, method, holdout)
        report = report_of(fit, judged, _lenders(data, fit, holdout), chosen)
    else:
        require_finite(data)
        used, judged = split(data, holdout)
        fits = fit_all(used)
        ranked = rank(list(fits.values()), judged, order=chosen)
        ranking = [report_of(entry.fit, judged, fits, chosen) for entry in ranked]
        report = {"method": ALL, "order": str(chosen), "ranking": ranking}
    if judged.azimuth_deg is not None:
        report["raw"] = study({}, judged).as_dict()["raw"]
    return report


def _order(name: str) -> Order:
    if name not in tuple(Order):
        message = f"order must be one of {', '.join(Order)}; instead received {name}"
        raise ValueError(message)
    return Order(name)


def _lenders(data: CalibrationData, fit: Fit, holdout: str) -> dict[str, Fit]:
    """Return the fits of the same rows whose tilt this one may need."""
    if fit.refused or fit.accel_matrix is not None or data.accel_g is None:
        return {}
    return {name: fitted(data, name, holdout)[0] for name in TILT_METHODS}


def fitted(
    data: CalibrationData, method: str, holdout: str = "blocks"
) -> tuple[Fit, CalibrationData]:
    """Return a method's fit, whose message says why it refused, and the rows that judge it."""
    require_finite(data)
    used, judged = split(data, holdout)
    return fit_named(method, used), judged


def split(data: CalibrationData, holdout: str) -> tuple[CalibrationData, CalibrationData]:
    """Return (rows to fit, rows to judge).

    Raises
    ------
    ValueError
        If holdout has no such name.
    """
    if holdout not in HOLDOUTS:
        message = f"holdout must be one of {', '.join(HOLDOUTS)}; instead received {holdout}"
        raise ValueError(message)
    if holdout == "none" or data.azimuth_deg is None or len(data) < 2:
        return data, data
    block = BLOCK_ROWS if len(data) >= 4 * BLOCK_ROWS else 1
    odd = np.arange(len(data)) // block % 2 == 1
    return rows_of(data, ~odd), rows_of(data, odd)


def report_of(
    fit: Fit, judged: CalibrationData, fits: Mapping[str, Fit], order: Order = Order.BODY
) -> dict[str, Any]:
    """Return the JSON object of one fit, with heading errors on the rows that judge it.

    Parameters
    ----------
    fits : mapping of str to Fit
        Fits of the same rows by method, whose tilt this one may borrow.
    """
    source, tilt = borrowed_tilt(fit, fits, judged)
    order = order if order in orders_of(fit) else Order.BODY
    report: dict[str, Any] = {
        "method": fit.method,
        "samples": fit.samples,
        "cause": None if fit.cause is None else str(fit.cause),
        "message": fit.message,
        "offset": _listed(fit.offset_mg),
        "matrix": _listed(fit.matrix),
        "field": _number(fit.field_mg),
        "dip_deg": _number(fit.dip_deg),
        "extended_dip_deg": _number(fit.extended_dip_deg),
        "covariance": _listed(fit.covariance),
        "residual_rms": _number(fit.residual_rms_mg),
        "chi2_reduced": _number(fit.chi2_reduced),
        "rank": fit.rank,
        "condition": _number(fit.condition),
        "coverage": _number(fit.coverage),
        "predicted_heading_rms_deg": _number(fit.predicted_heading_rms_deg),
        "extra": {name: _number(value) for name, value in fit.extra.items()},
        "order": str(order),
        "tilt_from": None if fit.refused else source,
    }
    if judged.azimuth_deg is not None:
        before = _error(heading_error(judged, None))
        after = None
        if not fit.refused:
            after = _error(heading_error(judged, fit, tilt=tilt, order=order))
        report["heading_error_deg"] = {"before": before, "after": after}
        report["orders"] = {} if fit.refused else _by_order(fit, judged, tilt)
    return report


def _by_order(fit: Fit, judged: CalibrationData, tilt: Fit | None) -> dict[str, Any]:
    found = achieved_by_order(fit, judged, tilt=tilt)
    return {order: asdict(achieved) for order, achieved in found.items()}


def _error(error: HeadingError) -> dict[str, float]:
    return {"rms": error.rms_deg, "max": error.max_deg, "mean": error.mean_deg}


def _listed(values: NDArray[np.float64] | None) -> list[Any] | None:
    return None if values is None else list(values.tolist())


def _number(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None


def data_of_a_turn() -> CalibrationData:
    """Return a level turn of 24 headings with a hard iron of (40, -30, 0) mG, for examples."""
    from bench.calibration.fit import CalibrationData

    turn_rad = np.deg2rad(np.arange(0.0, 360.0, 15.0))
    x_mg, y_mg = 40.0 + 250.0 * np.cos(turn_rad), -30.0 - 250.0 * np.sin(turn_rad)
    field = np.column_stack([x_mg, y_mg, np.full_like(turn_rad, 433.0)])
    return CalibrationData(field_mg=field)
