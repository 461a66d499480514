"""A finished (or broken off) run's folder, as the dashboard sees it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.calibration.tilt import tilt_compensated_heading_deg
from bench.sample_file import iterate_samples
from bench.samples import COMPLETE, MOVING
from protocols.angles import wrap_180_deg, wrap_360_deg

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Coefficients:
    """Coefficients that the dashboard applies to raw samples."""

    method: str
    offset_mg: NDArray[np.float64]
    matrix: NDArray[np.float64]
    accel_offset_g: NDArray[np.float64]
    accel_matrix: NDArray[np.float64]

    def field_mg(self, raw_mg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the compensated field, shape (n, 3)."""
        return (raw_mg - self.offset_mg) @ self.matrix.T

    def force_g(self, raw_g: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the compensated specific force, shape (n, 3)."""
        return (raw_g - self.accel_offset_g) @ self.accel_matrix.T


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Consecutive samples of a run with the headings that follow from them, each shape (n,)."""

    samples: NDArray[np.void]
    raw_mg: NDArray[np.float64]
    compensated_mg: NDArray[np.float64] | None
    reference_deg: NDArray[np.float64]
    raw_deg: NDArray[np.float64]
    compensated_deg: NDArray[np.float64] | None

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Samples of a dwell."""
        return np.asarray(self.samples["position"] != MOVING)

    def error_deg(self, heading_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return heading minus the rig's magnetic heading in (-180, 180]."""
        return wrap_180_deg(heading_deg - self.reference_deg)


class RunView:
    """Record and samples of one run.

    Parameters
    ----------
    folder : Path
        The run's folder with samples.parquet.
    record : dict, optional
        The run's document; read from the folder's record.json if not given.
    """

    def __init__(self, folder: Path, record: dict[str, Any] | None = None) -> None:
        self.folder = folder
        self.record: dict[str, Any] = (
            json.loads((folder / "record.json").read_text("utf-8")) if record is None else record
        )

    @cached_property
    def field_ned_mg(self) -> NDArray[np.float64]:
        """Station's field, shape (3,), with north along the rig's zero; zeros if unknown."""
        station = self.record.get("station") or {}
        horizontal_mg = float(station.get("horizontal_mg") or 0.0)
        dip_rad = np.deg2rad(float(station.get("dip_deg") or 0.0))
        azimuth_rad = np.deg2rad(self.field_azimuth_deg)
        return np.array(
            [
                horizontal_mg * np.cos(azimuth_rad),
                horizontal_mg * np.sin(azimuth_rad),
                horizontal_mg * np.tan(dip_rad),
            ]
        )

    @property
    def field_azimuth_deg(self) -> float:
        """Direction of magnetic north from the rig's zero."""
        return float((self.record.get("station") or {}).get("field_azimuth_deg") or 0.0)

    @property
    def field_mg(self) -> float:
        """Strength of the station's field, 500 mG where the record has none."""
        return float(np.linalg.norm(self.field_ned_mg)) or 500.0

    def high(self, name: str, default: float) -> float:
        """Return the upper limit of a measurement."""
        for measurement in self.record.get("measurements", []):
            if measurement["name"] == name and measurement.get("high") is not None:
                return float(measurement["high"])
        return default

    @cached_property
    def raw_error_span_deg(self) -> float:
        """Half-range of the raw error's axis, rounded up to 10 degrees."""
        largest = max((self._largest_raw_error_deg(block) for block in self.blocks()), default=10.0)
        return float(min(180.0, 10.0 * np.ceil(1.05 * largest / 10.0)))

    @staticmethod
    def _largest_raw_error_deg(block: Block) -> float:
        error_deg = block.error_deg(block.raw_deg)[block.settled]
        return float(np.abs(error_deg).max(initial=0.0))

    @cached_property
    def coefficients(self) -> Coefficients | None:
        """Coefficients of the best fit that was not refused: the one written, else the first."""
        usable = [fit for fit in self.record.get("fits", []) if fit.get("cause") is None]
        written = (self.record.get("coefficients") or {}).get("method")
        order = [written, *self.record.get("ranking", []), *[fit["method"] for fit in usable]]
        for method in order:
            for fit in usable:
                if fit["method"] == method:
                    return _coefficients(fit)
        return None

    def blocks(self) -> Iterator[Block]:
        """Yield the complete samples of the run in order, some thousands at a time."""
        path = self.folder / "samples.parquet"
        if not path.exists():
            return
        for samples in iterate_samples(path):
            complete = samples[samples["complete"] == COMPLETE]
            if len(complete):
                yield self._block(complete)

    def _block(self, samples: NDArray[np.void]) -> Block:
        raw_mg = (samples["set_mg"] - samples["reset_mg"]) / 2.0
        coefficients = self.coefficients
        compensated_mg = None if coefficients is None else coefficients.field_mg(raw_mg)
        compensated_deg = None
        if coefficients is not None and compensated_mg is not None:
            force_g = coefficients.force_g(samples["accel_g"])
            compensated_deg = tilt_compensated_heading_deg(compensated_mg, force_g)
        return Block(
            samples=samples,
            raw_mg=raw_mg,
            compensated_mg=compensated_mg,
            reference_deg=wrap_360_deg(samples["rig_azimuth_deg"] - self.field_azimuth_deg),
            raw_deg=tilt_compensated_heading_deg(raw_mg, samples["accel_g"]),
            compensated_deg=compensated_deg,
        )


def _coefficients(fit: dict[str, Any]) -> Coefficients:
    identity = np.eye(3)
    accel_matrix = fit.get("accel_matrix")
    accel_offset_g = fit.get("accel_offset_g")
    return Coefficients(
        method=fit["method"],
        offset_mg=np.asarray(fit["offset_mg"], dtype=float),
        matrix=np.asarray(fit["matrix"], dtype=float).reshape(3, 3),
        accel_offset_g=np.zeros(3) if accel_offset_g is None else np.asarray(accel_offset_g, float),
        accel_matrix=identity
        if accel_matrix is None
        else np.asarray(accel_matrix, float).reshape(3, 3),
    )
