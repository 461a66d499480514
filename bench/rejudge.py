"""Judge a run again from its raw samples: the same numbers, by its own limits or by others.

Only what no sample can tell (lost frames, serial, firmware, read-back) is taken over from
the record. Everything else is computed anew from samples.parquet, the poses and the written
coefficients of record.json, and the station's field.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import Verdict, judge_measurement, verdict_of
from bench.errors import ConfigError
from bench.record.document import read_record
from bench.record.entries import limits_of, measurement_entry, measurement_of
from bench.recorded_uncertainty import differing_uncertainty
from bench.run_samples import RunSamples
from bench.steps.fit import FitMethods

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from bench.acceptance.measurement import Limit, Measurement
    from bench.station import Station
    from bench.steps.step import Step
    from bench.uncertainty.unit_data import UnitData

LARGEST_DIFFERENCE: Final = 1e-9
"""Relative difference up to which a recomputed value is the recorded one."""
DECISION_KEYS: Final = (
    "low", "high", "uncertainty", "guard_band", "tur", "conformity", "outcome",
)  # fmt: skip
"""What follows from the value, the limits and the uncertainty, and is compared as well."""


class _Rules(NamedTuple):
    """What a run is judged by: limits, their name, the part's data, whether they are its own."""

    by_name: Mapping[str, Limit]
    name: str
    unit: UnitData | None
    own: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejudged:
    """A run judged again.

    Attributes
    ----------
    measurements : list of Measurement
        In the order of the run, with all attempts.
    verdict : Verdict
        By the limits that were asked for.
    recorded : Outcome or None
        Outcome in the record; None if the run did not end.
    differing : list of str
        ``step/name`` of measurements whose recomputed value is not the recorded one; with a word
        behind it, one whose uncertainty, guard band, TUR or conformity is not.
    limits_name : str
        Identity and version of the limits.
    """

    measurements: list[Measurement]
    verdict: Verdict
    recorded: Outcome | None
    differing: list[str]
    limits_name: str


def rejudge(run_dir: Path, limits_path: Path | None = None) -> Rejudged:
    """Judge a run from its samples.

    Parameters
    ----------
    run_dir : Path
        Folder of a run. One whose process was killed (`.part`) is refused: its samples have
        no footer.
    limits_path : Path or None
        Limits file to judge by; None for the run's own.

    Raises
    ------
    ConfigError
        If the folder holds no record, a file of it cannot be read, or the limits asked for
        lack a measurement that the run was held against, or ask for an uncertainty that the
        folder does not give.
    """
    record = read_record(run_dir)
    rules = _rules(run_dir, record, limits_path)
    steps = _own_steps(run_dir, record)
    methods = {n: tuple(s.methods) for n, s in steps.items() if isinstance(s, FitMethods)}
    station = None if rules.unit is None else _own_station(run_dir, record, rules.name)
    samples = RunSamples(run_dir, record, methods, station=station, unit=rules.unit)
    recomputed = samples.measurements()
    measurements, differing = [], []
    for entry in record["measurements"]:
        recorded = measurement_of(entry)
        fresh = _again(recorded, recomputed)
        judged = judge_measurement(fresh, rules.by_name)
        if not _same(fresh.value, recorded.value):
            differing.append(f"{recorded.step}/{recorded.name}")
        elif rules.own:
            differing += _decided_otherwise(judged, entry)
        measurements.append(judged)
    if rules.own:
        section = record.get("uncertainty") or {}
        differing += differing_uncertainty(
            section, samples.verifications, measurements, samples.site
        )
    return Rejudged(
        measurements=measurements,
        verdict=_verdict(record, measurements, steps),
        recorded=Outcome(record["verdict"]["outcome"]) if record["verdict"] else None,
        differing=differing,
        limits_name=rules.name,
    )


def _rules(run_dir: Path, record: Mapping[str, Any], limits_path: Path | None) -> _Rules:
    from bench.limit_set import load_limits

    if limits_path is not None:
        chosen = load_limits(str(limits_path))
        chosen.require(limits_of(record))
        return _Rules(chosen.by_name, f"{chosen.id} {chosen.version}", chosen.unit, own=False)
    config = record["config"]
    path = _own_file(run_dir, config.get("limits_sha256"))
    if path is not None:
        own = load_limits(str(path))
        return _Rules(own.by_name, f"{own.id} {own.version}", own.unit, own=True)
    name = f"{config.get('limits_id', '')} {config.get('limits_version', '')}".strip()
    return _Rules(limits_of(record), f"{name or 'limits'} as recorded", None, own=False)


def _own_station(run_dir: Path, record: Mapping[str, Any], limits_name: str) -> Station:
    from bench.station import load_station

    path = _own_file(run_dir, record["config"].get("station_sha256"))
    if path is None:
        message = (
            f"{run_dir}: config must hold the run's own station file, unchanged, to compute the "
            f"uncertainty that limits {limits_name} ask for; instead it does not"
        )
        raise ConfigError(message)
    return load_station(str(path))


def _again(
    recorded: Measurement, recomputed: Mapping[tuple[str, str, int], Measurement]
) -> Measurement:
    """Return the measurement with its value from the samples, not-a-number if they have none."""
    if not recorded.from_samples:
        return recorded
    fresh = recomputed.get((recorded.step, recorded.name, recorded.attempt))
    if fresh is None:
        return replace(recorded, value=math.nan, note="the samples do not give it")
    return replace(
        recorded, value=fresh.value, unit=fresh.unit, note=fresh.note, spread=fresh.spread
    )


def _decided_otherwise(judged: Measurement, entry: Mapping[str, Any]) -> list[str]:
    """Return which parts of the decision are not the recorded ones, ``step/name part``."""
    again = measurement_entry(judged)
    return [
        f"{judged.step}/{judged.name} {key}"
        for key in DECISION_KEYS
        if key in entry and not _same_entry(again[key], entry[key])
    ]


def _same_entry(fresh: float | str | None, recorded: float | str | None) -> bool:
    if isinstance(fresh, str) or isinstance(recorded, str):
        return fresh == recorded
    return _same(_number(fresh), _number(recorded))


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _same(fresh: float, recorded: float) -> bool:
    if math.isnan(fresh) or math.isnan(recorded):
        return math.isnan(fresh) and math.isnan(recorded)
    return math.isclose(fresh, recorded, rel_tol=LARGEST_DIFFERENCE, abs_tol=1e-12)


def _verdict(
    record: Mapping[str, Any], measurements: list[Measurement], steps: Mapping[str, Step]
) -> Verdict:
    """Return the verdict; what ended the run early ends it here as well."""
    recorded = record["verdict"]
    if recorded is None:
        return verdict_of(measurements, error="the run did not end")
    outcome = Outcome(recorded["outcome"])
    if outcome is Outcome.ABORTED:
        return verdict_of(measurements, aborted=recorded["reason"])
    by_measurements = verdict_of([measurement_of(entry) for entry in record["measurements"]])
    if outcome is Outcome.ERROR and recorded["reason"] != by_measurements.reason:
        return verdict_of(measurements, error=recorded["reason"])
    verdict = verdict_of(measurements)
    ran = {entry["name"] for entry in record["steps"]}
    left = [name for name in steps if name not in ran]
    if left and verdict.outcome in (Outcome.PASS, Outcome.MARGINAL):
        message = f"the run stopped before step {left[0]}: what was not measured cannot be judged"
        return verdict_of(measurements, error=message)
    return verdict


def _own_steps(run_dir: Path, record: Mapping[str, Any]) -> Mapping[str, Step]:
    """Return the steps of the run's own procedure by name; none if its copy was changed."""
    from bench.procedure_loader import load_procedure

    path = _own_file(run_dir, record["config"].get("procedure_sha256"))
    return load_procedure(str(path)).named_steps() if path is not None else {}


def _own_file(run_dir: Path, sha256: str | None) -> Path | None:
    """Return the copy of a file that the run was held against, if it is unchanged."""
    from bench.shipped import file_sha256

    copies = sorted((run_dir / "config").glob("*.y*ml"))
    return next((path for path in copies if file_sha256(path) == sha256), None)


def require_same(rejudged: Rejudged, run_dir: Path) -> None:
    """Check that the samples give the numbers of the record.

    Raises
    ------
    ConfigError
        If they do not: the record or the samples were changed.
    """
    if rejudged.differing:
        message = (
            f"{run_dir}: samples must give the recorded values; instead "
            f"{', '.join(rejudged.differing)} differ: record or samples were changed"
        )
        raise ConfigError(message)
