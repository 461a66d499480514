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

    def measured(self, path: str, part: str) -> NDArray[np.float64]:
        """Return the values or the variances of a band."""
        column = f"Measurements:{part}"
        values = [
            batch.column(column).flatten().to_numpy(zero_copy_only=False)
            for batch in self.chunks(path)
            if column in batch.schema.names
        ]
        return np.concatenate(values)

    def value(self, name: str) -> float:
        return float(next(m["value"] for m in self.record["measurements"] if m["name"] == name))


def run(out: Path, *, procedure: str = "eol_three_axis", **options: Any) -> Recorded:
    request = RunRequest(
        procedure=procedure, serial="SN0001", out=out, no_input=True, quiet=True, **options
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


@pytest.fixture(scope="session")
def two_axis(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return run(tmp_path_factory.mktemp("two_axis"), procedure="eol_two_axis")


@pytest.fixture(scope="session")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return run(tmp_path_factory.mktemp("compared"), procedure="min_max")


@pytest.fixture(scope="session")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    folder = tmp_path_factory.mktemp("replayed")
    vectors = np.random.default_rng(5).standard_normal((600, 3))
    field_mg = np.round(480.0 * vectors / np.linalg.norm(vectors, axis=1, keepdims=True) + 40.0)
    rows = [f"{0.01 * i:.2f},{x:.0f},{y:.0f},{z:.0f}" for i, (x, y, z) in enumerate(field_mg)]
    head = ["# mag_unit: mG", "# mag_resolution_mg: 1", "# rate_hz: 100", "t_s,mx,my,mz"]
    (folder / "sphere.csv").write_text("\n".join([*head, *rows, ""]), encoding="utf-8")
    return run(folder / "runs", procedure="recording", replay=folder / "sphere.csv")


@pytest.fixture
def again(recorded: Recorded, tmp_path: Path) -> Path:
    for name in ("record.json", "samples.parquet", "events.ndjson"):
        (tmp_path / name).write_bytes((recorded.folder / name).read_bytes())
    write_recording(tmp_path / "run.rrd")
    return tmp_path / "run.rrd"
