"""The record of a run, from its first second: events at once, the document when it ends."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import Verdict, not_recorded
from bench.errors import BenchNotReady, ConfigError
from bench.record.document import RECORD_FILE, SCHEMA, validate_record
from bench.record.entries import fit_entry, measurement_entry, pose_entry, verdict_entry
from bench.record.events import EVENTS_FILE, EventLog, Sink
from bench.record.junit import write_junit
from bench.record.plain import plain
from bench.record.report import write_report
from bench.record.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from bench.acceptance.measurement import Measurement
    from bench.calibration.fit import Fit
    from bench.pose import Pose
    from protocols.clock import Clock

_log = logging.getLogger(f"compassbench.{__name__}")

Product = Callable[[Path, dict[str, Any]], object]
"""Writes one file of the folder from the document."""
PRODUCTS: Final[dict[str, Product]] = {"junit.xml": write_junit, "report.html": write_report}
FILES: Final = {
    RECORD_FILE: "this document",
    EVENTS_FILE: "events as they happened, one JSON object a line",
    "samples.parquet": "every sample in physical units, one row a tick",
    "bus.blf": "every frame on the bus",
    "run.rrd": "recording for the viewer, with its blueprint",
    "junit.xml": "measurements as test cases",
    "report.html": "report of one page",
    "config": "procedure, limits and station as they were used",
}
_STATUS: Final = {Outcome.ABORTED: "aborted", Outcome.ERROR: "error"}


def utc_now() -> datetime:
    """Return the wall clock in UTC."""
    return datetime.now(UTC)


class RunRecorder:
    """Record of one run.

    The folder, events.ndjson and a first record.json exist when the constructor returns.
    Every event is flushed. A sink that fails is dropped, and the run's verdict becomes ERROR.

    Parameters
    ----------
    out_dir : Path
        Folder that holds all runs.
    serial, procedure : str
        Serial number of the unit and name of the procedure.
    clock : Clock
        The bench's clock; events count seconds from its time at the start.
    wall_clock : callable
        Returns the time of day in UTC; only fields named `_utc` and `wall_` come from it.
    seed : int or None
        Seed of a simulated run.
    sinks : sequence of Sink
        Further consumers of the events.
    products : mapping of str to callable, optional
        Further files to make from the document when the run ends: name in the folder to
        ``write(path, record)``. One that fails makes the verdict ERROR.

    Raises
    ------
    ConfigError
        If the folder cannot be made.
    BenchNotReady
        If it cannot be written.
    """

    def __init__(
        self,
        out_dir: Path,
        serial: str,
        procedure: str,
        *,
        clock: Clock,
        wall_clock: Callable[[], datetime] = utc_now,
        procedure_version: str = "",
        seed: int | None = None,
        sinks: Sequence[Sink] = (),
        products: Mapping[str, Product] | None = None,
    ) -> None:
        self._clock = clock
        self._wall_clock = wall_clock
        self._start_ns = clock.now_ns()
        self._started = wall_clock()
        self._faults: list[str] = []
        self._products = {**PRODUCTS, **(products or {})}
        self._sequence = 0
        self._closed: Path | None = None
        self.verdict: Verdict | None = None
        """The final verdict, known after `close`: ERROR where the record has a hole."""
        self._folder = RunFolder(out_dir, serial, procedure, self._started)
        run = _begun_run(serial, procedure, procedure_version, seed, self._started)
        self._record = _empty_record(run)
        self._sinks: list[Sink] = []
        try:
            self._sinks.append(EventLog(self.path(EVENTS_FILE)))
            self._write_record()
        except OSError as fault:
            message = f"run folder {self._folder.path} must be writable; instead received {fault}"
            raise BenchNotReady(message) from fault
        self._sinks.extend(sinks)
        self.event("run_started", run=run)

    @property
    def folder(self) -> Path:
        """The run's folder: `.part` until it is closed."""
        return self._folder.path

    @property
    def record(self) -> dict[str, Any]:
        """The document as it stands."""
        return self._record

    def path(self, name: str) -> Path:
        """Return the path of a file of the run, in the folder as it is called now."""
        return self._folder.path / name

    def event(self, kind: str, **fields: object) -> None:
        """Write one event to all sinks; a sink that fails is dropped and remembered."""
        event: dict[str, object] = {
            "seq": self._sequence,
            "t_s": self._now_s(),
            "wall_utc": self._wall_clock().isoformat(),
            "event": kind,
            **{name: plain(value) for name, value in fields.items()},
        }
        self._sequence += 1
        for sink in tuple(self._sinks):
            try:
                sink.on_event(event)
            except Exception as fault:  # a sink's fault must not stop the run, only its PASS
                self._drop(sink, fault)

    def step_started(self, name: str, kind: str, attempt: int = 1) -> None:
        """Begin an attempt of a step."""
        started_s = self._now_s()
        entry = {"name": name, "kind": kind, "started_s": started_s, "attempt": attempt}
        self._record["steps"].append({**entry, "ended_s": None, "outcome": None, "message": ""})
        self.event("step_started", name=name, step_kind=kind, attempt=attempt)

    def step_ended(self, name: str, outcome: Outcome, message: str = "") -> None:
        """End the newest open attempt of a step.

        Raises
        ------
        ValueError
            If no attempt of that name is open.
        """
        for entry in reversed(self._record["steps"]):
            if entry["name"] == name and entry["ended_s"] is None:
                entry.update(ended_s=self._now_s(), outcome=outcome.value, message=message)
                attempt = entry["attempt"]
                self.event(
                    "step_ended", name=name, outcome=outcome, message=message, attempt=attempt
                )
                return
        message = f"step {name} was ended but is not open"
        raise ValueError(message)

    def pose(self, pose: Pose) -> None:
        """Record a dwell that begins."""
        attempts = (e["attempt"] for e in self._record["steps"] if e["name"] == pose.step)
        entry = {**pose_entry(pose), "attempt": max(attempts, default=1)}
        self._record["poses"].append(entry)
        self.event("pose", **entry)

    def measurement(self, measurement: Measurement) -> None:
        """Record a judged measurement; every attempt stays."""
        entry = measurement_entry(measurement)
        self._record["measurements"].append(entry)
        self.event("measurement", **entry)

    def fit(self, fit: Fit, achieved: Mapping[str, float] | None = None) -> None:
        """Record a fit; a later call for the same method replaces it (with what it achieved)."""
        entry = fit_entry(fit, achieved)
        fits = self._record["fits"]
        fits[:] = [other for other in fits if other["method"] != fit.method] + [entry]
        self.event("fit", **entry)

    def set(self, section: str, value: Mapping[str, object] | Sequence[object]) -> None:
        """Merge a mapping into a section of the record, or replace a list (`ranking`, ...).

        Raises
        ------
        ValueError
            If the record has no such section, or it is of the other kind.
        """
        present = self._record.get(section)
        fresh = plain(value)
        if isinstance(present, dict) and isinstance(fresh, dict):
            present.update(fresh)
        elif isinstance(present, list) and isinstance(fresh, list):
            present[:] = fresh
        else:
            message = f"record has no section {section!r} that takes a {type(value).__name__}"
            raise ValueError(message)  # noqa: TRY004
        self.event("section", section=section, value=fresh)

    def fault(self, sentence: str) -> None:
        """Note that something which belongs into the record is missing: the verdict is ERROR."""
        self._faults.append(sentence)
        self.event("record_fault", message=sentence)

    def close(self, verdict: Verdict) -> Path:
        """Write the document, JUnit file and report, rename the folder and return its path.

        Files of others in the folder (samples, frames, recording) must be closed before. A
        second call changes nothing. `self.verdict` is the verdict that was recorded.

        Raises
        ------
        BenchNotReady
            If the document cannot be written or the folder not renamed.
        """
        if self._closed is not None:
            return self._closed
        self._end_sinks(verdict)
        self._conclude(verdict)
        failed = [*self._invalid(), *self._write_products()]
        if failed:
            self._faults.extend(failed)
            self._conclude(verdict)
            self._write_products()
        try:
            self._write_record()
        except OSError as fault:
            message = f"{self.path(RECORD_FILE)} must be writable; instead received {fault}"
            raise BenchNotReady(message) from fault
        self._closed = self._folder.complete()
        return self._closed

    def _now_s(self) -> float:
        return (self._clock.now_ns() - self._start_ns) / 1e9

    def _drop(self, sink: Sink, fault: Exception) -> None:
        if sink in self._sinks:
            self._sinks.remove(sink)
            with suppress(Exception):  # it gives back what it holds, as far as it still can
                sink.close()
        sentence = f"{type(sink).__name__} failed and its part of the record is missing: {fault}"
        self._faults.append(sentence)
        _log.error("%s", sentence)

    def _end_sinks(self, verdict: Verdict) -> None:
        final = self._final(verdict)
        self.event("run_ended", **verdict_entry(final), first_failure=final.first_failure)
        for sink in tuple(self._sinks):
            try:
                sink.close()
            except Exception as fault:  # as in `event`
                self._drop(sink, fault)

    def _final(self, verdict: Verdict) -> Verdict:
        return not_recorded(verdict, "; ".join(self._faults)) if self._faults else verdict

    def _conclude(self, verdict: Verdict) -> None:
        self.verdict = self._final(verdict)
        ended = self._wall_clock()
        self._record["run"].update(
            ended_utc=ended.isoformat(),
            simulated_s=self._now_s(),
            wall_s=(ended - self._started).total_seconds(),
            status=_STATUS.get(self.verdict.outcome, "complete"),
        )
        self._record["verdict"] = verdict_entry(self.verdict)
        self._record["first_failure"] = self.verdict.first_failure
        names = {entry.name for entry in self._folder.path.iterdir()} | set(self._products)
        ordered = [*(name for name in FILES if name in names), *sorted(names - set(FILES))]
        self._record["files"] = {name: FILES.get(name, "") for name in ordered}

    def _write_products(self) -> list[str]:
        """Write what is made from the document; return the sentences of what failed."""
        failed = []
        for name, write in self._products.items():
            try:
                write(self.path(name), self._record)
            except (OSError, ConfigError) as fault:
                failed.append(f"{name} could not be written: {fault}")
            except Exception as fault:  # a missing product is an ERROR, never a lost record
                _log.exception("%s could not be written", name)
                failed.append(f"{name} could not be written: {fault}")
        return failed

    def _invalid(self) -> list[str]:
        try:
            validate_record(self._record)
        except ConfigError as fault:
            return [str(fault)]
        return []

    def _write_record(self) -> None:
        fresh = self.path(f"{RECORD_FILE}.new")
        with fresh.open("w", encoding="utf-8", newline="\n") as file:
            json.dump(self._record, file, allow_nan=False, indent=1)
            file.write("\n")
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(self.path(RECORD_FILE))


def _begun_run(
    serial: str, procedure: str, procedure_version: str, seed: int | None, started: datetime
) -> dict[str, Any]:
    return {
        "id": "-".join([procedure, serial, *([f"seed{seed}"] if seed is not None else [])]),
        "procedure": procedure,
        "procedure_version": procedure_version,
        "serial": serial,
        "started_utc": started.isoformat(),
        "seed": seed,
        "status": "running",
    }


def _empty_record(run: Mapping[str, object]) -> dict[str, Any]:
    sections = ("software", "config", "bus", "station", "module", "rig")
    rows = ("poses", "steps", "measurements", "fits", "ranking")
    return {
        "schema": SCHEMA,
        "run": dict(run),
        **{name: {} for name in sections},
        **{name: [] for name in rows},
        "study": {},
        "bridge_terms": {},
        "field_watch": {},
        "adaptive": {},
        "uncertainty": {},
        "reversal": {},
        "coefficients": {},
        "deviation": {},
        "first_failure": None,
        "verdict": None,
        "injected_faults": [],
        "files": {},
    }
