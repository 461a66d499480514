"""Quantities with their unit in the value: ``"0.5 deg"``, ``"250 mG"``, ``"300 ms"``.

A number without a unit is refused wherever a physical quantity is meant, so that nobody
has to know what a file's bare ``0.5`` was. Each annotated type below is a float in one
unit once it is loaded.
"""

from __future__ import annotations

import math
import re
from functools import partial
from typing import Annotated, Final

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

_NUMBER = re.compile(r"^\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S(?:.*\S)?)?\s*$")

_UNITS: Final[dict[str, dict[str, float]]] = {
    "deg": {"deg": 1.0, "°": 1.0, "rad": math.degrees(1.0), "arcmin": 1.0 / 60.0},
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "mG": {"mG": 1.0, "G": 1e3, "uT": 10.0, "µT": 10.0, "nT": 0.01},
    "g": {"g": 1.0, "mg": 1e-3},
    "g/degC": {"g/degC": 1.0, "mg/degC": 1e-3, "g/K": 1.0, "mg/K": 1e-3},
    "mA": {"mA": 1.0, "A": 1e3},
    "degC": {"degC": 1.0, "°C": 1.0, "K": 1.0},
    "%": {"%": 1.0},
    "G": {"G": 1.0, "mG": 1e-3},
    "Hz": {"Hz": 1.0},
    "m": {"m": 1.0, "km": 1e3},
}
"""Accepted spellings by canonical unit, with the factor to it; degC only as a difference."""


def parse_quantity(value: object, unit: str) -> float:
    """Return a quantity in `unit`.

    Parameters
    ----------
    value : str
        Number and unit, such as ``"0.5 deg"``.
    unit : str
        Canonical unit to return: deg, s, mG, g, g/degC, mA, degC, %, G, Hz or m; the empty string
        means a plain number.

    Raises
    ------
    ValueError
        If the unit is missing, unknown or of another dimension, or the number is not finite.

    >>> parse_quantity("300 ms", "s")
    0.3
    >>> parse_quantity("25 uT", "mG")
    250.0
    """
    if unit == "":
        return _plain_number(value)
    accepted = _UNITS.get(unit, {unit: 1.0})
    match = _NUMBER.match(value) if isinstance(value, str) else None
    if match is None or match[2] not in accepted:
        names = " or ".join(accepted)
        message = (
            f'value must be a number with its unit ({names}), such as "1 {unit}"; '
            f"instead received {value!r}"
        )
        raise ValueError(message)
    number = float(match[1]) * accepted[match[2]]
    if not math.isfinite(number):
        message = f"value must be finite; instead received {value!r}"
        raise ValueError(message)
    return number


def format_quantity(value: float, unit: str) -> str:
    """Return a quantity as files write it.

    >>> format_quantity(0.5, "deg")
    '0.5 deg'
    """
    return f"{value:.12g} {unit}".strip()


def _plain_number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        message = f"value must be a plain finite number; instead received {value!r}"
        raise ValueError(message)
    return float(value)


def _positive(value: float) -> float:
    if value <= 0.0:
        message = f"value must be above zero; instead received {value:g}"
        raise ValueError(message)
    return value


def _schema(unit: str) -> WithJsonSchema:
    spellings = "|".join(re.escape(name) for name in _UNITS[unit])
    pattern = rf"^\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*({spellings})\s*$"
    return WithJsonSchema({"type": "string", "pattern": pattern, "examples": [f"1 {unit}"]})


def _writer(unit: str) -> PlainSerializer:
    return PlainSerializer(partial(format_quantity, unit=unit), return_type=str)


def _load(unit: str, value: object) -> float:
    return parse_quantity(value, unit)


def _load_positive(unit: str, value: object) -> float:
    return _positive(parse_quantity(value, unit))


Degrees = Annotated[float, BeforeValidator(partial(_load, "deg")), _writer("deg"), _schema("deg")]
"""An angle in degrees."""
Seconds = Annotated[
    float, BeforeValidator(partial(_load_positive, "s")), _writer("s"), _schema("s")
]
"""A duration in seconds, above zero."""
Milligauss = Annotated[float, BeforeValidator(partial(_load, "mG")), _writer("mG"), _schema("mG")]
"""A magnetic field in mG."""
Acceleration = Annotated[float, BeforeValidator(partial(_load, "g")), _writer("g"), _schema("g")]
"""A specific force in g."""
AccelerationPerDegree = Annotated[
    float, BeforeValidator(partial(_load, "g/degC")), _writer("g/degC"), _schema("g/degC")
]
"""A change of specific force with temperature, in g per deg C."""
Metres = Annotated[float, BeforeValidator(partial(_load, "m")), _writer("m"), _schema("m")]
"""A length in m."""
