"""The measurements of a run computed anew from its folder, step by step."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.acceptance.fit_evaluation import evaluate_claim, evaluate_fit
from bench.acceptance.heading_evaluation import (
    evaluate_field_strength,
    evaluate_raw_heading,
    evaluate_returns,
    evaluate_temperature,
    evaluate_verification,
)
from bench.acceptance.heading_uncertainty import verification_budget
from bench.acceptance.method_comparison import (
    achieved_by,
    evaluate_comparison,
    evaluate_rank,
    study_of,
)
from bench.acceptance.reversal_evaluation import evaluate_reversal, reversal_of, values_of
from bench.acceptance.sensor_evaluation import (
    evaluate_noise,
    evaluate_peaks,
    evaluate_senses,
    evaluate_set_reset,
    evaluate_sweep,
)
from bench.acceptance.site import calibration_data, recording_data
from bench.acceptance.two_axis_evaluation import evaluate_z_estimate
from bench.calibration.cross_axis import UNKNOWN_THEN, no_cross_axis
from bench.calibration.heading_claim import claimed
from bench.calibration.mountings import Mounting
from bench.calibration.reversal_effects import BenchDoubts
from bench.errors import ConfigError
from bench.record.entries import coefficients_of, pose_of
from bench.record.spoiled_poses import used_in_order
from bench.record.swing import site_of
from bench.sample_file import read_samples
from bench.samples import readings_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from bench.acceptance.measurement import Measurement
    from bench.calibration.fit import CalibrationData, Fit
    from bench.station import Station
    from bench.uncertainty.heading_budget import HeadingBudget
    from bench.uncertainty.unit_data import UnitData

CALIBRATION_KINDS: Final = ("sweep", "poses", "adaptive_poses")


class RunSamples:
    """Samples, poses and station of a finished run.

    Parameters
    ----------
    run_dir : Path
    record : mapping
    methods : mapping of str to sequence of str, optional
        What each fit step fits, by its name; where it is not known, all methods of the record.
    station : Station, optional
        The run's own station file, with its uncertainties.
    unit : UnitData, optional
        The part's type B data; with it and the station, the uncertainty of the heading errors
        is computed again.

    Raises
    ------
    ConfigError
        If there are no samples, or the record names no station.
    """

    def __init__(
        self,
        run_dir: Path,
        record: Mapping[str, Any],
        methods: Mapping[str, Sequence[str]] | None = None,
        *,
        station: Station | None = None,
        unit: UnitData | None = None,
    ) -> None:
        self._record = record
        self._methods = methods or {}
        self._station, self._unit = station, unit
        self.verifications: list[tuple[NDArray[np.void], HeadingBudget]] = []
        """Readings and budget of every verification, once `measurements` has computed them."""
        path = run_dir / "samples.parquet"
        if not path.exists():
            message = f"{run_dir} must hold samples.parquet to be judged again; instead it has none"
            raise ConfigError(message)
        site = site_of(record)
        if site is None:
            message = f"{run_dir}: the record must hold the station's field; instead it has none"
            raise ConfigError(message)
        self.site = site
        """The station as the record has it."""
        self._samples = read_samples(path)
        self._readings = readings_of(self._samples)
        self._poses = [pose_of(entry) for entry in record["poses"]]
        self._fits: dict[str, Fit] = {}
        self._judged: Fit | None = None
        self._seen: list[Mapping[str, Any]] = []

    def measurements(self) -> dict[tuple[str, str, int], Measurement]:
        """Return what the samples give, by (step, name, attempt)."""
        found: dict[tuple[str, str, int], Measurement] = {}
        for entry in self._record["steps"]:
            self._seen.append(entry)
            for measurement in self._of_step(entry):
                one = replace(measurement, attempt=entry["attempt"])
                found[one.step, one.name, one.attempt] = one
        return found

    def _of_step(self, entry: Mapping[str, Any]) -> list[Measurement]:
        step, kind = entry["name"], entry["kind"]
        if kind == "fit":
            return self._fit(step, entry["attempt"])
        if kind == "reversal":
            return self._reversal(step)
        readings = self._readings_at(self._positions(step, entry["attempt"]))
        if not len(readings):
            return []
        if kind == "noise":
            return evaluate_noise(step, readings)
        if kind == "set_reset":
            return self._set_reset(step, readings)
        if kind == "sweep":
            raw = evaluate_raw_heading(step, readings, self.site)
            return evaluate_sweep(step, readings, self._poses) + raw
        if kind == "poses":
            return evaluate_peaks(step, readings)
        if kind == "adaptive_poses":
            return evaluate_peaks(step, readings) + self._claim(step, len(readings))
        if kind == "returns":
            return evaluate_returns(step, readings, self._poses, self.site)
        if kind == "compare":
            return self._compare(step, readings) + self._rank(step, readings)
        if kind == "verify":
            return self._verify(step, readings) + self._rank(step, readings)
        return []

    def _claim(self, step: str, poses: int) -> list[Measurement]:
        fitted = claimed(self._calibration_data())
        return [] if fitted.claim is None else evaluate_claim(step, fitted.claim, poses)

    def _set_reset(self, step: str, readings: NDArray[np.void]) -> list[Measurement]:
        found = evaluate_peaks(step, readings)
        if not self._record["module"].get("synthesised"):
            found += evaluate_set_reset(step, readings, self.site)
        return found + evaluate_senses(step, readings, self.site)

    def _fit(self, step: str, attempt: int) -> list[Measurement]:
        from bench.acceptance.bridge_terms import CorrectedFits

        noted = [
            entry["note"].split(":")[0]
            for entry in self._record["measurements"]
            if (entry["step"], entry["name"], entry["attempt"]) == (step, "fit_accepted", attempt)
        ]
        if not noted:
            return []
        data = self._calibration_data()
        recorded = [entry["method"] for entry in self._record["fits"]]
        methods = dict.fromkeys([*self._methods.get(step, recorded), noted[0]])
        # records of before the cross-axis term were fitted without it
        cross = None if self._record.get("bridge_terms") else no_cross_axis(UNKNOWN_THEN)
        try:
            fits = CorrectedFits(data, cross)
            self._fits |= {name: fits.fit(name) for name in methods}
        except ValueError as error:
            message = f"record cannot be judged again in step {step}: {error}"
            raise ConfigError(message) from error
        fit = self._fits[noted[0]]
        if not fit.refused:
            self._judged = fit
        return evaluate_fit(step, fit, self.site)

    def _reversal(self, step: str) -> list[Measurement]:
        entry = self._record["reversal"]
        mounted = [
            (Mounting(one["mounting"]), self._readings_at(one["positions"]))
            for one in entry["mountings"]
        ]
        paired = not self._record["module"].get("synthesised")
        doubts = BenchDoubts(**entry["doubts"])
        found = reversal_of(mounted, self.site, doubts, paired=paired)
        return evaluate_reversal(step, found, values_of(entry["former"]))

    def _compare(self, step: str, readings: NDArray[np.void]) -> list[Measurement]:
        if self._judged is None:
            return []
        return evaluate_comparison(step, self._judged.method, self._fits, readings, self.site)

    def _rank(self, step: str, readings: NDArray[np.void]) -> list[Measurement]:
        if self._judged is None:
            return []
        compared = study_of(self._fits, readings, self.site)
        return evaluate_rank(step, self._judged.method, achieved_by(self._fits, compared))

    def _calibration_data(self) -> CalibrationData:
        readings = self._readings_at(self._calibration_positions())
        if len(readings):
            paired = not self._record["module"].get("synthesised")
            return calibration_data(readings, self.site, paired=paired)
        return recording_data(self._samples)

    def _verify(self, step: str, readings: NDArray[np.void]) -> list[Measurement]:
        recorded = self._record["coefficients"]
        written = recorded.get("written")
        used = written or recorded.get("before")
        if used is None:
            return []
        coefficients = coefficients_of(used)
        samples = self._samples[np.isin(self._samples["position"], readings["position"])]
        budget = None
        if self._station is not None:
            budget = verification_budget(
                readings, coefficients, self._station, self._unit, self._baseline_mg()
            )
        if budget is not None:
            self.verifications.append((readings, budget))
        found = evaluate_verification(
            step, readings, samples, coefficients, self.site, budget=budget
        )
        if written:
            found += evaluate_field_strength(step, readings, coefficients, self.site)
        if coefficients.horizontal_mg > 0.0:
            found += evaluate_z_estimate(step, readings, coefficients)
        before = self._readings_at(self._calibration_positions())
        if len(before):
            found += evaluate_temperature(step, before, readings)
        return found

    def _baseline_mg(self) -> NDArray[np.float64] | None:
        """Return what the reference magnetometer read when the run began."""
        baseline_mg = (self._record.get("field_watch") or {}).get("baseline_mg")
        return None if baseline_mg is None else np.array(baseline_mg, dtype=float)

    def _calibration_positions(self) -> list[int]:
        """Return the positions of the last attempts of the steps so far that calibrate."""
        last = {
            entry["name"]: entry["attempt"]
            for entry in self._seen
            if entry["kind"] in CALIBRATION_KINDS
        }
        return [p for step, attempt in last.items() for p in self._positions(step, attempt)]

    def _positions(self, step: str, attempt: int) -> list[int]:
        visited = [
            entry["position"]
            for entry in self._record["poses"]
            if entry["step"] == step and entry.get("attempt", 1) == attempt
        ]
        return used_in_order(visited, self._record)

    def _readings_at(self, positions: list[int]) -> NDArray[np.void]:
        row_at = {int(position): row for row, position in enumerate(self._readings["position"])}
        return self._readings[[row_at[position] for position in positions if position in row_at]]
