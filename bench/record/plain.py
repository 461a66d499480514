"""Values as JSON has them: no NaN, no numpy, no enum, no date."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from datetime import date
from enum import Enum
from pathlib import PurePath

import numpy as np


def plain(value: object) -> object:  # noqa: PLR0911
    """Return a value of None, bool, int, float, str, list and dict only.

    Numbers that are not finite become None: JSON has no NaN.

    Raises
    ------
    TypeError
        If the value is of a kind that a record does not hold.

    >>> plain({"a": np.array([1.0, np.nan]), 2: (True,)})
    {'a': [1.0, None], '2': [True]}
    """
    if isinstance(value, Enum):
        return plain(value.value)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, bytes):
        return value.hex()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(plain(key)): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        rows = sorted(value, key=str) if isinstance(value, set | frozenset) else value
        return [plain(entry) for entry in rows]
    message = f"a record holds numbers, texts, lists and mappings; instead received {type(value)}"
    raise TypeError(message)
