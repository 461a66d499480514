"""The methods of a record side by side, in words and in rows that report and dashboard show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from bench.calibration.compensation import Order
from bench.calibration.ranking import GIVEN, OWN, RAW
from bench.record.recorded_fits import ranked_entries, tilt_source, written_method

if TYPE_CHECKING:
    from collections.abc import Mapping

_METHODS: Final = {
    RAW: "raw readings",
    "set_reset": "set/reset pairs",
    "min_max": "min-max",
    "four_position": "four positions",
    "two_axis": "two axes",
    "two_axis_aided": "two axes, aided",
}
_TILTS: Final = {OWN: "its own", RAW: "raw", GIVEN: "the rig"}
_ORDERS: Final = {
    Order.BODY: "hard iron, soft iron, tilt",
    Order.SOFT_FIRST: "soft iron, hard iron, tilt",
    Order.TILT_FIRST: "tilt, hard iron, soft iron",
    Order.TILT_REVERSED: "hard iron, soft iron, tilt in reverse",
}
ORDER_REASON: Final = (
    "Hard and soft iron turn with the module: in its own axes they are one offset and one matrix "
    "at every tilt, and are taken out there; in levelled axes they change with the tilt, and no "
    "single set of coefficients takes them out. A method of level poses leaves z as it is: its "
    "tilted error is large in every order."
)
"""Why the bench compensates in the order that stands first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodRow:
    """One row of the comparison; errors are None where there were no such poses.

    Attributes
    ----------
    key, name : str
        The method as recorded, and in words.
    cause, message : str
        Why it was refused, in words; empty if it was not.
    tilt_from : str
        Whose accelerometer coefficients levelled the readings.
    written : bool
        Whether these coefficients went into the module.
    """

    key: str
    name: str
    level_rms_deg: float | None = None
    level_max_deg: float | None = None
    tilt_rms_deg: float | None = None
    tilt_max_deg: float | None = None
    predicted_rms_deg: float | None = None
    residual_mg: float | None = None
    tilt_from: str = ""
    cause: str = ""
    message: str = ""
    written: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderEffect:
    """Largest heading errors of one method in one order of compensation."""

    order: str
    name: str
    level_max_deg: float | None
    tilt_max_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderRow:
    """One method in the orders that it can show, the product's own first."""

    key: str
    name: str
    effects: tuple[OrderEffect, ...]


def method_words(method: str) -> str:
    """Return a method's name for readers.

    >>> method_words("truth_aided"), method_words("min_max")
    ('truth aided', 'min-max')
    """
    return _METHODS.get(method, method.replace("_", " "))


def order_words(order: str) -> str:
    """Return an order of compensation for readers.

    >>> order_words("tilt_first")
    'tilt, hard iron, soft iron'
    """
    return _ORDERS.get(Order(order), order) if order in list(Order) else order.replace("_", " ")


def method_rows(record: Mapping[str, Any]) -> list[MethodRow]:
    """Return raw, if it was compared with methods, then these by rank, refused ones last."""
    study = record.get("study") or {}
    raw = study.get(RAW) or {}
    rows = []
    if record.get("fits") and any(value is not None for value in raw.values()):
        given = GIVEN in (study.get("tilt_from") or {}).values()
        rows.append(_with_errors(RAW, raw, tilt_from=_TILTS[GIVEN if given else RAW]))
    written = written_method(record)
    rows += [_method_row(entry, record, written) for entry in ranked_entries(record)]
    return rows


def _method_row(
    entry: Mapping[str, Any], record: Mapping[str, Any], written: str | None
) -> MethodRow:
    method = str(entry["method"])
    if entry.get("cause"):
        cause = str(entry["cause"]).replace("_", " ")
        message = str(entry.get("message", ""))
        return MethodRow(key=method, name=method_words(method), cause=cause, message=message)
    source = tilt_source(record, entry)
    row = _with_errors(
        method, entry.get("achieved") or {}, tilt_from=_TILTS.get(source, method_words(source))
    )
    return replace(
        row,
        predicted_rms_deg=entry.get("predicted_heading_rms_deg"),
        residual_mg=entry.get("residual_rms_mg"),
        written=method == written,
    )


def _with_errors(method: str, errors: Mapping[str, Any], *, tilt_from: str) -> MethodRow:
    return MethodRow(
        key=method,
        name=method_words(method),
        level_rms_deg=errors.get("level_rms_deg"),
        level_max_deg=errors.get("level_max_deg"),
        tilt_rms_deg=errors.get("tilt_rms_deg"),
        tilt_max_deg=errors.get("tilt_max_deg"),
        tilt_from=tilt_from,
    )


def order_rows(record: Mapping[str, Any]) -> list[OrderRow]:
    """Return the effect of the order by rank of the methods; those for two axes know one only."""
    orders = (record.get("study") or {}).get("orders") or {}
    names = [str(entry["method"]) for entry in ranked_entries(record)]
    rows = []
    for method in (name for name in names if len(orders.get(name, ())) > 1):
        shown = sorted(orders[method], key=_order_rank)
        effects = tuple(
            OrderEffect(
                order=order,
                name=order_words(order),
                level_max_deg=orders[method][order].get("level_max_deg"),
                tilt_max_deg=orders[method][order].get("tilt_max_deg"),
            )
            for order in shown
        )
        rows.append(OrderRow(key=method, name=method_words(method), effects=effects))
    return rows


def _order_rank(order: str) -> int:
    known = [str(o) for o in Order]
    return known.index(order) if order in known else len(known)
