"""Runs of the command on virtual units with faults, each made once and shared by all tests."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from bench.cli.run_command import RunRequest, run_procedure
from bench.procedure_loader import procedure_path

if TYPE_CHECKING:
    from pathlib import Path

SERIAL = "SN0001"


@dataclass(frozen=True, kw_only=True)
class FaultyRun:
    """What a run left behind."""

    exit_code: int
    folder: Path
    record: dict[str, Any]

    @property
    def outcome(self) -> str:
        return self.record["verdict"]["outcome"]

    @property
    def first_failure(self) -> str | None:
        return self.record["first_failure"]

    @property
    def reason(self) -> str:
        return self.record["verdict"]["reason"]

    def value(self, name: str) -> float:
        return next(m["value"] for m in self.record["measurements"] if m["name"] == name)

    def events(self, kind: str) -> list[dict[str, Any]]:
        lines = (self.folder / "events.ndjson").read_text(encoding="utf-8").splitlines()
        return [event for event in map(json.loads, lines) if event["event"] == kind]


@dataclass(kw_only=True)
class Bench:
    """Runs procedures and remembers what came of them."""

    out: Path
    runs: dict[tuple[str, tuple[str, ...]], FaultyRun] = field(default_factory=dict)

    def run(self, *faults: str, procedure: str = "eol_three_axis", **options: Any) -> FaultyRun:
        """Run a procedure; the same one with the same faults is run only once."""
        key = (procedure, faults)
        if options or key not in self.runs:
            self.runs[key] = self._made(procedure, faults, options)
        return self.runs[key]

    def _made(self, procedure: str, faults: tuple[str, ...], options: dict[str, Any]) -> FaultyRun:
        out = self.out / str(len(list(self.out.iterdir())))
        request = {
            "procedure": procedure, "serial": SERIAL, "faults": faults, "out": out,
            "no_input": True, "dashboard": False, "quiet": True, **options,
        }  # fmt: skip
        exit_code = run_procedure(RunRequest(**request))
        folder = (out / "latest").resolve()
        record = json.loads((folder / "record.json").read_text(encoding="utf-8"))
        return FaultyRun(exit_code=exit_code, folder=folder, record=record)


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return Bench(out=tmp_path_factory.mktemp("faults"))


@pytest.fixture(scope="session")
def short_procedure(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The main procedure with all its steps and limits on fewer poses."""
    document = yaml.safe_load(procedure_path("eol_three_axis").read_text(encoding="utf-8"))
    for step in document["steps"]:
        if step["kind"] == "sweep":
            step["headings"]["count"] = 8
        if step["kind"] in ("poses", "verify"):
            for ring in step["rings"]:
                ring["count"] = max(1, ring["count"] // 3)
        if step["kind"] == "returns":
            step["visits"] = 2
    path = tmp_path_factory.mktemp("procedures") / "short.yaml"
    path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    return str(path)
