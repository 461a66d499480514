"""Limits files: which value each measurement may have, with U, guard band and what to do."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, Strict, StringConstraints, model_validator

from bench.acceptance.catalogue import BUDGETED, MEASUREMENTS
from bench.acceptance.measurement import Limit
from bench.acceptance.outcome import Outcome
from bench.errors import ConfigError
from bench.part_data import PartData  # noqa: TC001  (pydantic reads it)
from bench.quantity import parse_quantity
from bench.shipped import file_sha256, find_file
from bench.typed_yaml import FileModel, load_model

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from bench.uncertainty.unit_data import UnitData

Number = Annotated[float, Strict()]
"""A plain number; true and false are none."""


class LimitEntry(FileModel):
    """One measurement's limits, as they stand in a file."""

    low: str | Number | None = None
    """Lower tolerance limit with its unit."""
    high: str | Number | None = None
    """Upper tolerance limit with its unit."""
    unit: str = ""
    """Unit of the measured value; empty for a plain number."""
    uncertainty: str | Number = 0.0
    """Expanded uncertainty U (k = 2) of the measured value; none where it is computed."""
    guard_band: str | Number = 0.0
    """Width inside the tolerance limits in which the outcome is MARGINAL."""
    guard_factor: Annotated[float, Strict(), Field(ge=0.0, le=10.0)] | None = None
    """In the place of guard_band: the width is this many U."""
    missed: Literal["FAIL", "ERROR"] = "FAIL"
    """Outcome outside the limits: FAIL for the unit, ERROR for the bench."""
    description: str
    """What the measurement is, in one sentence."""
    action: str
    """What the operator does when it is missed."""

    @model_validator(mode="after")
    def _limits_make_sense(self) -> Self:
        low, high = self._value("low"), self._value("high")
        if low is None and high is None:
            message = "limits must have low or high; instead received neither"
            raise ValueError(message)
        band = self._value("guard_band") or 0.0
        if (self._value("uncertainty") or 0.0) < 0.0 or band < 0.0:
            message = "uncertainty and guard_band must not be negative"
            raise ValueError(message)
        if self.guard_factor is not None and "guard_band" in self.model_fields_set:
            message = "guard_factor and guard_band must not stand together"
            raise ValueError(message)
        if low is not None and high is not None and low + 2.0 * band > high:
            message = (
                "low must lie below high by twice the guard band; instead received "
                f"{self.low} and {self.high}"
            )
            raise ValueError(message)
        return self

    def _value(self, key: str) -> float | None:
        value: object = getattr(self, key)
        if value is None or key not in self.model_fields_set:
            return None if value is None else 0.0
        return parse_quantity(value, self.unit)

    def limit(self, name: str) -> Limit:
        """Return the limit of the measurement `name`."""
        return Limit(
            name=name,
            unit=self.unit,
            low=self._value("low"),
            high=self._value("high"),
            uncertainty=self._value("uncertainty") or 0.0,
            guard_band=self._value("guard_band") or 0.0,
            guard_factor=self.guard_factor,
            missed=Outcome(self.missed),
            description=self.description,
            action=self.action,
        )


class LimitsFile(FileModel):
    """A limits file; `axes` of an entry's name spread it: ``noise_{x,y,z}`` is three limits."""

    id: Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$")]
    """Identity of the limits in every record."""
    version: Annotated[str, StringConstraints(pattern=r"^\d+\.\d+$")]
    """Version, major.minor; every change of the file raises it."""
    description: str = ""
    """For which units and site the limits were computed."""
    unit: PartData | None = None
    """Data of the part; with them U of level_max, level_rms, tilt_max and tilt_rms is computed."""
    measurements: Annotated[dict[str, LimitEntry], Field(min_length=1)]
    """Limits by name of the measurement."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitSet:
    """The limits of a run by name of the measurement, with their identity.

    `unit` are the part's type B data, None where the file has none.
    """

    id: str
    version: str
    sha256: str
    path: Path
    by_name: Mapping[str, Limit]
    unit: UnitData | None = None

    def get(self, name: str) -> Limit | None:
        """Return the limit of a measurement, or None if it only informs."""
        return self.by_name.get(name)

    def require(self, names: Iterable[str]) -> None:
        """Check that every measurement that will be judged has limits.

        Raises
        ------
        ConfigError
            If one has none; the sentence names them all.
        """
        missing = [name for name in names if name not in self.by_name]
        if missing:
            message = (
                f"{self.path}: limits {self.id} {self.version} lack {', '.join(missing)}: "
                "add them under 'measurements' or name another file with --limits"
            )
            raise ConfigError(message)


def load_limits(name: str, *, beside: Path | None = None) -> LimitSet:
    """Return the limits of a shipped file (by name) or of any file (by path).

    Raises
    ------
    ConfigError
        One sentence with file, line and column if it cannot be used.
    """
    path = find_file("limits", name, beside=beside)
    file = load_model(path, LimitsFile)
    by_name: dict[str, Limit] = {}
    for key, entry in file.measurements.items():
        for each in _spread(key):
            if each in by_name:
                message = f"{path}: measurement {each!r} has limits twice"
                raise ConfigError(message)
            _require_known(path, each, entry.unit)
            _require_uncertainty(path, each, entry, computed=file.unit is not None)
            by_name[each] = entry.limit(each)
    return LimitSet(
        id=file.id,
        version=file.version,
        sha256=file_sha256(path),
        path=path,
        by_name=by_name,
        unit=file.unit.data() if file.unit else None,
    )


def _require_known(path: Path, name: str, unit: str) -> None:
    kind = MEASUREMENTS.get(name)
    if kind is None:
        close = difflib.get_close_matches(name, MEASUREMENTS, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        message = f"{path}: unknown measurement {name!r}{hint}"
        raise ConfigError(message)
    if unit != kind.unit:
        message = (
            f"{path}: unit of {name} must be {kind.unit or 'left out'}; "
            f"instead received {unit or 'none'}"
        )
        raise ConfigError(message)


def _require_uncertainty(path: Path, name: str, entry: LimitEntry, *, computed: bool) -> None:
    """Check that a guard band in multiples of U has one U, the file's or the computed one."""
    stated = "uncertainty" in entry.model_fields_set
    if computed and name in BUDGETED:
        if stated:
            message = (
                f"{path}: uncertainty of {name} must be left out: it is computed from section unit"
            )
            raise ConfigError(message)
    elif entry.guard_factor is not None and not stated:
        message = (
            f"{path}: guard_factor of {name} needs its uncertainty"
            f"{' or a section unit' if name in BUDGETED else ''}"
        )
        raise ConfigError(message)


def _spread(key: str) -> list[str]:
    """Return the names that a key means.

    >>> _spread("hk_{x,y}")
    ['hk_x', 'hk_y']
    """
    head, brace, rest = key.partition("{")
    if not brace:
        return [key]
    choices, _, tail = rest.partition("}")
    return [f"{head}{choice.strip()}{tail}" for choice in choices.split(",")]
