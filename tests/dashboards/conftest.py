"""One real run, made once, and what its recording holds."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from bench.cli.run_command import RunRequest, run_procedure
from dashboards.recorder import write_recording

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


@dataclass(frozen=True)
class Recorded:
    """A run's folder, its document, and access to the entities of its recording."""

    folder: Path
    record: dict[str, Any]

    def chunks(self, path: str) -> list[Any]:
        stream = RrdReader(self.folder / "run.rrd").stream()
        return [chunk.to_record_batch() for chunk in stream.filter(content=f"/{path}")]

    def entities(self) -> set[str]:
        return {chunk.entity_path for chunk in RrdReader(self.folder / "run.rrd").stream()}

    def scalars(self, path: str) -> NDArray[np.float64]:
        values = [
            batch.column("Scalars:scalars").flatten().to_numpy(zero_copy_only=False)
            for batch in self.chunks(path)
            if "Scalars:scalars" in batch.schema.names
        ]
        return np.concatenate(values)

    def value(self, name: str) -> float:
        return float(next(m["value"] for m in self.record["measurements"] if m["name"] == name))


def run(out: Path, *, procedure: str = "eol_three_axis", faults: tuple[str, ...] = ()) -> Recorded:
    request = RunRequest(
        procedure=procedure, serial="SN0001", out=out, no_input=True, quiet=True, faults=faults
    )
    run_procedure(request)
    folder = (out / "latest").resolve()
    return Recorded(folder, json.loads((folder / "record.json").read_text("utf-8")))


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return run(tmp_path_factory.mktemp("good"))


@pytest.fixture(scope="session")
def failed(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return run(tmp_path_factory.mktemp("bad"), faults=("inverted_axis_x",))


@pytest.fixture
def again(recorded: Recorded, tmp_path: Path) -> Path:
    for name in ("record.json", "samples.parquet", "events.ndjson"):
        (tmp_path / name).write_bytes((recorded.folder / name).read_bytes())
    write_recording(tmp_path / "run.rrd")
    return tmp_path / "run.rrd"
