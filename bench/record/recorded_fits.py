"""The fits of a record brought back to life: what each makes of readings, as it was compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.acceptance.method_comparison import comparison_data
from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.expectation import expected_errors
from bench.calibration.fit import Fit
from bench.calibration.ranking import GIVEN, OWN, RAW
from bench.record.spoiled_poses import used_in_order

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField
    from bench.calibration.expectation import PoseErrors

VERIFIED_KINDS: Final = ("verify", "compare")
"""Kinds of steps whose poses no method has fitted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedFits:
    """Fits that have coefficients.

    Attributes
    ----------
    by_method : dict
        By rank.
    tilts : dict
        By method, the fit that lends its accelerometer coefficients; None for its own or raw.
    given : bool
        Whether the methods were compared with the rig's tilt in place of the measured one.
    expected : bool
        Whether the record says what errors were to be expected.
    zero_change_g : float
        What the accelerometer's zero was to move until the verification.
    """

    by_method: dict[str, Fit]
    tilts: dict[str, Fit | None]
    given: bool = False
    expected: bool = False
    zero_change_g: float = 0.0

    def heading_deg(
        self, method: str, field_mg: NDArray[np.float64], rows: NDArray[np.void]
    ) -> NDArray[np.float64]:
        """Return headings in [0, 360), shape (n,).

        Parameters
        ----------
        method : str
            A method that has coefficients, or `RAW`.
        field_mg : ndarray, shape (n, 3)
            Raw field, (set - reset)/2.
        rows : ndarray of SAMPLE or READING, shape (n,)
            Where specific force and attitude of the rig are taken from.
        """
        return compensated_heading_deg(
            None if method == RAW else self.by_method[method],
            field_mg,
            None if self.given else np.asarray(rows["accel_g"], dtype=float),
            pitch_deg=rows["rig_pitch_deg"],
            roll_deg=rows["rig_roll_deg"],
            tilt=self.tilts.get(method),
        )

    def headings_deg(self, readings: NDArray[np.void]) -> dict[str, NDArray[np.float64]]:
        """Return the heading, shape (n,), of raw and of each method at READINGs, shape (n,)."""
        field_mg = np.asarray(readings["field_mg"], dtype=float)
        return {m: self.heading_deg(m, field_mg, readings) for m in (RAW, *self.by_method)}

    def expected_errors(self, readings: NDArray[np.void], site: SiteField) -> dict[str, PoseErrors]:
        """Return the errors that were to be expected of raw and of each method at READINGs.

        Empty where the record has none.
        """
        if not self.expected or not len(readings):
            return {}
        data = comparison_data(readings, site, self.by_method)
        return expected_errors(self.by_method, data, self.zero_change_g) or {}


def recorded_fits(record: Mapping[str, Any]) -> RecordedFits:
    """Return the fits of a record that were not refused, each with the tilt it was compared with.

    In a record without `study`, those without accelerometer coefficients took the raw tilt.
    """
    fits = {
        str(entry["method"]): fit_of(entry)
        for entry in ranked_entries(record)
        if not entry.get("cause") and entry.get("matrix") is not None
    }
    study = record.get("study") or {}
    sources = {str(entry["method"]): tilt_source(record, entry) for entry in ranked_entries(record)}
    return RecordedFits(
        by_method=fits,
        tilts={method: fits.get(sources[method]) for method in fits},
        given=GIVEN in sources.values(),
        expected=bool(study.get("expected")),
        zero_change_g=float(study.get("expected_zero_change_g") or 0.0),
    )


def tilt_source(record: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    """Return whose accelerometer coefficients the fit of an entry took: see `ranking.Study`."""
    recorded = ((record.get("study") or {}).get("tilt_from") or {}).get(entry["method"])
    if recorded:
        return str(recorded)
    return RAW if entry.get("accel_matrix") is None else OWN


def fit_of(entry: Mapping[str, Any]) -> Fit:
    """Return a record's fit with what it says of the unit; what only judges the fit is left out."""

    def array(key: str) -> NDArray[np.float64] | None:
        return None if entry.get(key) is None else np.asarray(entry[key], dtype=float)

    extra = {key: float(v) for key, v in (entry.get("extra") or {}).items() if v is not None}
    return Fit(
        method=str(entry["method"]),
        samples=int(entry.get("samples") or 0),
        offset_mg=array("offset_mg"),
        matrix=array("matrix"),
        accel_offset_g=array("accel_offset_g"),
        accel_matrix=array("accel_matrix"),
        accel_from=str(entry.get("accel_from", "")),
        field_mg=entry.get("field_mg"),
        extended_dip_deg=entry.get("extended_dip_deg"),
        parameters=tuple(entry.get("parameters") or ()),
        covariance=array("covariance"),
        residual_rms_mg=entry.get("residual_rms_mg"),
        accel_residual_rms_g=entry.get("accel_residual_rms_g"),
        extra=extra,
        hk_mg=array("hk_mg"),
    )


def ranked_entries(record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the entries of the record's fits by rank, refused ones last."""
    entries = {str(entry["method"]): entry for entry in record.get("fits", [])}
    names = dict.fromkeys([*map(str, record.get("ranking", [])), *entries])
    ranked = [entries[name] for name in names if name in entries]
    return sorted(ranked, key=lambda entry: bool(entry.get("cause")))


def judged_method(record: Mapping[str, Any]) -> str | None:
    """Return the method that the run's fit step judged, if it judged one."""
    measurements = record.get("measurements", [])
    notes = [entry.get("note") for entry in measurements if entry["name"] == "fit_accepted"]
    return str(notes[-1]).split(":")[0] if notes and notes[-1] else None


def written_method(record: Mapping[str, Any]) -> str | None:
    """Return the method whose coefficients were written to the module, if any were."""
    written = (record.get("coefficients") or {}).get("written")
    return judged_method(record) if written else None


def step_positions(record: Mapping[str, Any], kinds: Iterable[str]) -> list[int]:
    """Return the positions that steps of these kinds used in their last attempt."""
    chosen = set(kinds)
    names = {step["name"] for step in record.get("steps", []) if step.get("kind") in chosen}
    poses = [pose for pose in record.get("poses", []) if pose["step"] in names]
    last: dict[str, int] = {}
    for pose in poses:
        last[pose["step"]] = max(last.get(pose["step"], 1), pose.get("attempt", 1))
    visited = [int(p["position"]) for p in poses if p.get("attempt", 1) == last[p["step"]]]
    return used_in_order(visited, record)
