"""The cells of the comparison: poses and noise, the bounds there, and what each estimator did."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from estimators import (
    COUNTS,
    LARGEST_RMS_DEG,
    LARGEST_WORST_DEG,
    NOISES,
    STRENGTH_MG,
    TILTS_DEG,
    Readings,
    Unit,
    conditions_of,
    read,
    spread_attitudes_deg,
    station_mg,
)
from peer_errors import (
    Outcome,
    coefficients_outcome,
    ellipsoid_outcome,
    peer_outcome,
    tilt_aided_outcome,
    truth_aided_outcome,
    truth_linear_outcome,
)
from peer_processes import Peer, fitted_by

from bench.calibration.bound import HeadingBound, heading_bound

OURS: Final = {
    "ellipsoid": ellipsoid_outcome,
    "coefficients": coefficients_outcome,
    "tilt_aided": tilt_aided_outcome,
    "truth_aided": truth_aided_outcome,
    "truth_linear": truth_linear_outcome,
}
CELL_LIMIT_S: Final = 4.0
"""Processor time that a peer may take for the trials of one cell; the rest is left out."""
WRONG_BOUNDS: Final = 3.0
WRONG_DEG: Final = 2.0


class CellKey(NamedTuple):
    """Largest tilt, poses, and noise over the field."""

    tilt_deg: float
    poses: int
    noise: float

    def __str__(self) -> str:
        return f"{self.tilt_deg:5.0f} {self.poses:5} {100.0 * self.noise:5.1f}%"

    def words(self) -> str:
        """Return the cell in words."""
        poses = f"{self.poses} poses, noise {100.0 * self.noise:g} %"
        return f"{poses}, tilt to {self.tilt_deg:.0f} deg" if self.tilt_deg < 180.0 else poses


@dataclass(frozen=True, kw_only=True, eq=False)
class Cell:
    """One set of poses and noise: readings, bounds, and what each estimator did."""

    key: CellKey
    readings: Readings
    bounds: dict[str, HeadingBound]
    outcomes: dict[str, Outcome] = field(default_factory=dict)

    @property
    def regular(self) -> bool:
        """Whether the magnetometer alone can tell the heading here."""
        bound = self.bounds["ellipsoid"]
        return bool(bound.rms_deg <= LARGEST_RMS_DEG and bound.worst_deg <= LARGEST_WORST_DEG)

    def bound_deg(self, name: str) -> float:
        """Return the bound of one column: peers have that of the magnetometer alone."""
        return float(self.bounds[name if name in self.bounds else "ellipsoid"].rms_deg)

    def ratio(self, name: str) -> float:
        """Return the error over its bound."""
        return self.outcomes[name].error_deg() / self.bound_deg(name)

    def wrong(self, name: str, bounds: float = 0.0) -> float:
        """Return the share of results that are wrong: by 2 deg and by so many bounds."""
        limit_deg = max(bounds * self.bound_deg(name), WRONG_DEG)
        return float((self.outcomes[name].rms_deg > limit_deg).mean())

    def loss(self, peer: str, name: str = "ellipsoid") -> float:
        """Return the ellipsoid's error over the peer's, on the trials that both have fitted."""
        ours, theirs = self.outcomes[name].rms_deg, self.outcomes[peer].rms_deg
        squares = np.stack([ours[: len(theirs)] ** 2, theirs**2])
        squares = squares[:, ~np.isnan(squares).any(axis=0)]
        return float(np.sqrt(squares[0].mean() / squares[1].mean())) if squares.size else np.nan


def cells_of(unit: Unit, trials: int, seed: int) -> list[Cell]:
    """Return all cells with their readings and bounds, no outcome yet."""
    keys = [CellKey(*key) for key in product(TILTS_DEG, COUNTS, NOISES)]
    return [cell_of(key, unit, trials, seed + 1 + index) for index, key in enumerate(keys)]


def cell_of(key: CellKey, unit: Unit, trials: int, seed: int) -> Cell:
    """Return one cell with its readings and bounds."""
    attitudes_deg = spread_attitudes_deg(key.poses, key.tilt_deg)
    sd_mg = key.noise * STRENGTH_MG

    both = conditions_of(unit, sd_mg)
    alone = replace(both, accel_sd_g=None, direction_known=True)
    return Cell(
        key=key,
        readings=read(unit, attitudes_deg, sd_mg, trials, seed),
        bounds={
            "ellipsoid": heading_bound("ellipsoid", attitudes_deg, both),
            "tilt_aided": heading_bound("tilt_aided", attitudes_deg, both),
            "truth_aided": heading_bound("truth_aided", attitudes_deg, both),
            "truth_linear": heading_bound("truth_aided", attitudes_deg, alone),
        },
    )


def fit_ours(unit: Unit, cells: list[Cell]) -> None:
    """Fit all cells by the product's estimators."""
    for cell in cells:
        for name, outcome in OURS.items():
            cell.outcomes[name] = outcome(unit, cell.readings, cell.key.noise * STRENGTH_MG)


def fit_by(peer: Peer, unit: Unit, cells: list[Cell]) -> str:
    """Fit all cells by a peer; return why it did not run, or ''."""
    names = [f"cell{index}" for index in range(len(cells))]
    readings: dict[str, Any] = {"sets": names, "station_mg": station_mg()}
    for name, cell in zip(names, cells, strict=True):
        sd_mg = cell.key.noise * STRENGTH_MG
        readings |= one_set(name, cell.readings, sd_mg, passes=1, limit_s=CELL_LIMIT_S)
    found = fitted_by(peer, readings)
    if isinstance(found, str):
        return found
    for name, cell in zip(names, cells, strict=True):
        cell.outcomes[peer.name] = peer_outcome(unit, found, name)
    return ""


def one_set(
    name: str, readings: Readings, sd_mg: float, *, passes: int, limit_s: float
) -> dict[str, Any]:
    """Return one set of readings as the worker takes it."""
    return {
        f"{name}_field_mg": readings.field_mg,
        f"{name}_sd_mg": sd_mg,
        f"{name}_passes": passes,
        f"{name}_limit_s": limit_s,
    }
