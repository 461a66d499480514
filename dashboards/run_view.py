"""A finished (or broken off) run's folder, as the dashboard sees it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.acceptance.site import reference_heading_deg
from bench.calibration.compensation import completed_field_mg
from bench.calibration.ranking import RAW
from bench.calibration.tilt import two_axis_attitude_deg
from bench.record.recorded_fits import judged_method, recorded_fits
from bench.record.swing import site_of
from bench.sample_file import iterate_samples
from bench.samples import COMPLETE, MOVING
from protocols.angles import wrap_180_deg, wrap_360_deg

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField
    from bench.calibration.fit import Fit
    from bench.record.recorded_fits import RecordedFits


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

    @property
    def with_rig(self) -> bool:
        """Whether a rig held the module; a recording has none, and its heading no truth."""
        return bool(np.isfinite(self.reference_deg).all())

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

    @cached_property
    def site(self) -> SiteField | None:
        """The station's field as the record has it; None where it has none."""
        return site_of(self.record) if self.record.get("station") else None

    @property
    def field_azimuth_deg(self) -> float:
        """Direction of magnetic north from the rig's zero."""
        return float((self.record.get("station") or {}).get("field_azimuth_deg") or 0.0)

    @property
    def field_mg(self) -> float:
        """Strength of the station's field, 500 mG where the record has none."""
        return float(np.linalg.norm(self.field_ned_mg)) or 500.0

    def limit_deg(self, kind: str, default: float) -> float:
        """Return the limit of the heading error of verified poses, `kind` "level" or "tilt"."""
        band = self.band(kind)
        return default if band is None else band[0]

    def band(self, kind: str) -> tuple[float, float] | None:
        """Return limit and acceptance limit of the error of verified poses; None without them."""
        names = (f"{kind}_max", f"achieved_{kind}_max")
        for measurement in self.record.get("measurements", []):
            if measurement["name"] in names and measurement.get("high") is not None:
                high = float(measurement["high"])
                return high, high - float(measurement.get("guard_band") or 0.0)
        return None

    def heading_errors_deg(
        self, heading_deg: NDArray[np.float64], rows: NDArray[np.void]
    ) -> NDArray[np.float64]:
        """Return heading minus that of a perfect module, shape (n,), in (-180, 180]."""
        return wrap_180_deg(heading_deg - self.reference_deg(rows))

    def reference_deg(self, rows: NDArray[np.void]) -> NDArray[np.float64]:
        """Return the heading, shape (n,), that a perfect module would send at each row."""
        if self.site is None:
            return wrap_360_deg(rows["rig_azimuth_deg"] - self.field_azimuth_deg)
        return reference_heading_deg(rows, self.site)

    @cached_property
    def raw_error_span_deg(self) -> float:
        """Half-range of the raw error's axis, rounded up to 10 degrees."""
        largest_deg = 0.0
        for samples in self._samples():
            settled = samples[samples["position"] != MOVING]
            heading_deg = self.fits.heading_deg(RAW, _raw_mg(settled), settled)
            error_deg = self.heading_errors_deg(heading_deg, settled)
            largest_deg = max(largest_deg, float(np.abs(error_deg).max(initial=0.0)))
        return float(min(180.0, 10.0 * np.ceil(1.05 * (largest_deg or 10.0) / 10.0)))

    def interval_s(self, positions: Sequence[int]) -> tuple[float, float] | None:
        """Return from just before the first to just after the last sample at positions, if any."""
        times_s = [
            samples["t_s"][np.isin(samples["position"], positions)] for samples in self._samples()
        ]
        found = np.concatenate([*times_s, np.zeros(0)])
        return (float(found.min()) - 1.0, float(found.max()) + 1.0) if len(found) else None

    @cached_property
    def fits(self) -> RecordedFits:
        """Fits of the record that have coefficients."""
        return recorded_fits(self.record)

    @cached_property
    def fit(self) -> Fit | None:
        """Return the fit that is drawn: the one judged, else the best that was not refused."""
        judged = judged_method(self.record)
        usable = self.fits.by_method
        return usable.get(judged or "") or next(iter(usable.values()), None)

    def blocks(self) -> Iterator[Block]:
        """Yield the complete samples of the run in order, some thousands at a time."""
        for samples in self._samples():
            yield self._block(samples)

    def _samples(self) -> Iterator[NDArray[np.void]]:
        path = self.folder / "samples.parquet"
        if not path.exists():
            return
        for samples in iterate_samples(path):
            complete = samples[samples["complete"] == COMPLETE]
            if len(complete):
                yield complete

    def _block(self, samples: NDArray[np.void]) -> Block:
        raw_mg = _raw_mg(samples)
        compensated_mg = compensated_deg = None
        if self.fit is not None:
            compensated_mg = compensated_field_mg(self.fit, raw_mg, samples["accel_g"])
            compensated_deg = self.fits.heading_deg(self.fit.method, raw_mg, samples)
        return Block(
            samples=samples,
            raw_mg=raw_mg,
            compensated_mg=compensated_mg,
            reference_deg=self.reference_deg(samples),
            raw_deg=self.fits.heading_deg(RAW, raw_mg, samples),
            compensated_deg=compensated_deg,
        )


def _raw_mg(samples: NDArray[np.void]) -> NDArray[np.float64]:
    return np.asarray((samples["set_mg"] - samples["reset_mg"]) / 2.0)


def compensated_field_mg(
    fit: Fit, field_mg: NDArray[np.float64], accel_g: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the field, shape (n, 3), that a fit makes of raw readings; of two axes z is estimated.

    Parameters
    ----------
    field_mg, accel_g : ndarray, shape (n, 3)
        Raw field and raw specific force.
    """
    return completed_field_mg(fit, field_mg, *two_axis_attitude_deg(fit.corrected_g(accel_g)))
