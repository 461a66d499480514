"""Judge a run again from its raw samples: the same numbers, by its own limits or by others.

Only what no sample can tell (lost frames, serial, firmware, read-back) is taken over from
the record. Everything else is computed anew from samples.parquet, the poses and the written
coefficients of record.json, and the station's field.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from bench.acceptance.outcome import Outcome
from bench.acceptance.run_samples import RunSamples
from bench.acceptance.verdict import Verdict, judge_measurement, verdict_of
from bench.errors import ConfigError
from bench.record.document import read_record
from bench.record.entries import limits_of, measurement_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from bench.acceptance.measurement import Limit, Measurement

LARGEST_DIFFERENCE: Final = 1e-9
"""Relative difference up to which a recomputed value is the recorded one."""


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
        ``step/name`` of measurements whose recomputed value is not the recorded one.
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
        Folder of a run, also one that was cut off (`.part`).
    limits_path : Path or None
        Limits file to judge by; None for the run's own.

    Raises
    ------
    ConfigError
        If the folder holds no record, or a file of it cannot be read.
    """
    record = read_record(run_dir)
    limits, limits_name = _limits(run_dir, record, limits_path)
    recomputed = RunSamples(run_dir, record).measurements()
    measurements, differing = [], []
    for entry in record["measurements"]:
        recorded = measurement_of(entry)
        fresh = _again(recorded, recomputed)
        if not _same(fresh.value, recorded.value):
            differing.append(f"{recorded.step}/{recorded.name}")
        measurements.append(judge_measurement(fresh, limits))
    return Rejudged(
        measurements=measurements,
        verdict=_verdict(record, measurements),
        recorded=Outcome(record["verdict"]["outcome"]) if record["verdict"] else None,
        differing=differing,
        limits_name=limits_name,
    )


def _limits(
    run_dir: Path, record: Mapping[str, Any], limits_path: Path | None
) -> tuple[Mapping[str, Limit], str]:
    from bench.limit_set import load_limits
    from bench.shipped import file_sha256

    if limits_path is not None:
        chosen = load_limits(str(limits_path))
        return chosen.by_name, f"{chosen.id} {chosen.version}"
    config = record["config"]
    for path in sorted((run_dir / "config").glob("*.y*ml")):
        if file_sha256(path) == config.get("limits_sha256"):
            own = load_limits(str(path))
            return own.by_name, f"{own.id} {own.version}"
    name = f"{config.get('limits_id', '')} {config.get('limits_version', '')}".strip()
    return limits_of(record), f"{name or 'limits'} as recorded"


def _again(
    recorded: Measurement, recomputed: Mapping[tuple[str, str, int], Measurement]
) -> Measurement:
    """Return the measurement with its value from the samples, not-a-number if they have none."""
    if not recorded.from_samples:
        return recorded
    fresh = recomputed.get((recorded.step, recorded.name, recorded.attempt))
    if fresh is None:
        return replace(recorded, value=math.nan, note="the samples do not give it")
    return replace(recorded, value=fresh.value, unit=fresh.unit, note=fresh.note)


def _same(fresh: float, recorded: float) -> bool:
    if math.isnan(fresh) or math.isnan(recorded):
        return math.isnan(fresh) and math.isnan(recorded)
    return math.isclose(fresh, recorded, rel_tol=LARGEST_DIFFERENCE, abs_tol=1e-12)


def _verdict(record: Mapping[str, Any], measurements: list[Measurement]) -> Verdict:
    """Return the verdict; what ended the run early ends it here as well."""
    recorded = record["verdict"]
    if recorded is None:
        return verdict_of(measurements, error="the run did not end")
    outcome = Outcome(recorded["outcome"])
    if outcome is Outcome.ABORTED:
        return verdict_of(measurements, aborted=recorded["reason"])
    by_measurement = any(e["outcome"] == Outcome.ERROR for e in record["measurements"])
    if outcome is Outcome.ERROR and not by_measurement:
        return verdict_of(measurements, error=recorded["reason"])
    return verdict_of(measurements)


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
