"""The methods of a record side by side, in words and in rows that report and dashboard show."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from bench.calibration.compensation import Order
from bench.calibration.expectation import UNIT_MODEL
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
CLAIM_COVERS: Final = {
    "": ("level", "tilt"),
    "level only": ("level",),
    "without vertical iron": ("level",),
}
"""Poses that a method's own claim is about, by what the claim leaves out; none if not named."""
UNSAID: Final = 2.0
"""A method is wrong without saying so beyond this many times its claim and the noise together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodRow:
    """One row of the comparison; errors are None where there were no such poses.

    Attributes
    ----------
    key, name : str
        The method as recorded, and in words.
    cause, message : str
        Why it was refused, in words; empty if it was not.
    level_rms_deg, level_max_deg, tilt_rms_deg, tilt_max_deg : float or None
        Achieved on the verification poses.
    expected : dict
        The same four by the unit's model before the verification; empty where there is none.
    claimed_rms_deg, claimed_max_deg : float or None
        The method's own claim, from its own covariance.
    claim_without : str
        What that claim leaves out, in words; empty where it is whole.
    unsaid : bool
        Whether the achieved error is more than twice what claim and reading noise explain, on
        poses that the claim covers: the method is wrong without saying so.
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
    expected: Mapping[str, float | None] = field(default_factory=dict)
    claimed_rms_deg: float | None = None
    claimed_max_deg: float | None = None
    claim_without: str = ""
    unsaid: bool = False
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


def error_words(error_deg: float | None) -> str:
    """Return a heading error in degrees: thousandths below one degree, else three digits.

    >>> error_words(0.0353), error_words(1.4008), error_words(23.54), error_words(None)
    ('0.035', '1.40', '23.5', '–')
    """
    if error_deg is None:
        return "–"
    return f"{error_deg:.3f}" if abs(error_deg) < 1.0 else f"{error_deg:#.3g}".rstrip(".")


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
        row = _with_errors(RAW, raw, tilt_from=_TILTS[GIVEN if given else RAW])
        rows.append(replace(row, expected=_expected(study, RAW)))
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
    study = record.get("study") or {}
    row = replace(
        row,
        expected=_expected(study, method),
        claimed_rms_deg=entry.get("predicted_heading_rms_deg"),
        claimed_max_deg=entry.get("predicted_heading_max_deg"),
        claim_without=(study.get("claim_without") or {}).get(method, ""),
        residual_mg=entry.get("residual_rms_mg"),
        written=method == written,
    )
    return replace(row, unsaid=_unsaid(row, study))


def no_model(record: Mapping[str, Any]) -> str:
    """Return why there is no expected error, in words; empty where there is one."""
    study = record.get("study") or {}
    if study.get("expected"):
        return ""
    entries = {str(entry["method"]): entry for entry in record.get("fits", [])}
    model = entries.get(UNIT_MODEL)
    if model is None:
        return f"the run fitted no model of the unit ({method_words(UNIT_MODEL)})"
    if model.get("cause"):
        return f"the model of the unit ({method_words(UNIT_MODEL)}) was refused"
    return "the record has none"


def _expected(study: Mapping[str, Any], method: str) -> dict[str, float | None]:
    return dict((study.get("expected") or {}).get(method) or {})


def _unsaid(row: MethodRow, study: Mapping[str, Any]) -> bool:
    """Return whether a method is wrong beyond its claim; never where noise is not known."""
    noise = study.get("expected_noise") or {}
    achieved_deg = {"level": row.level_rms_deg, "tilt": row.tilt_rms_deg}
    for kind in CLAIM_COVERS.get(row.claim_without, ()):
        noise_deg, rms_deg = noise.get(f"{kind}_deg"), achieved_deg[kind]
        if row.claimed_rms_deg is None or noise_deg is None or rms_deg is None:
            continue
        if rms_deg > UNSAID * math.hypot(row.claimed_rms_deg, noise_deg):
            return True
    return False


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
