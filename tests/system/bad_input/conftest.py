"""The command line as a user meets it: arguments in, exit code and two streams out."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest

from bench.cli.main import main
from bench.limit_set import load_limits
from bench.procedure_loader import procedure_path

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@dataclass(frozen=True)
class Ended:
    """What a command left behind."""

    code: int
    out: str
    err: str
    folder: Path

    @property
    def sentence(self) -> str:
        """The one sentence on standard error."""
        lines = self.err.strip().splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("compass-bench: "), self.err
        return lines[0].removeprefix("compass-bench: ")

    @property
    def record(self) -> dict[str, Any]:
        """The record of the run; there is exactly one, and it is closed."""
        (path,) = self.folder.glob("*/*/*/record.json")
        assert path.parent.suffix != ".part"
        return json.loads(path.read_text(encoding="utf-8"))

    @property
    def recorded(self) -> bool:
        """Whether a run left anything in the output folder."""
        return self.folder.exists() and any(self.folder.iterdir())


@pytest.fixture
def command(monkeypatch, capfd, tmp_path) -> Callable[..., Ended]:
    """Return what runs `compass-bench ARGV` in this process, as its own `main` does."""

    def run(*argv: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["compass-bench", *map(str, argv)])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        return Ended(code, out, err, tmp_path / "runs")

    return run


@pytest.fixture
def bench_run(command, tmp_path) -> Callable[..., Ended]:
    """Return what runs a procedure without dashboard and questions into this test's folder."""

    def run(procedure: object, *argv: object, serial: str | None = "SN0001") -> Ended:
        label = [] if serial is None else ["--serial", serial]
        rest = ["--no-input", "--no-dashboard", "--out", tmp_path / "runs", *argv]
        return command("run", procedure, *label, *rest)

    return run


@pytest.fixture
def edited(tmp_path) -> Callable[..., Path]:
    """Return what copies a shipped file with one passage replaced."""
    shipped = {
        "procedure": procedure_path("set_reset"),
        "limits": load_limits("set_reset").path,
        "station": procedure_path("set_reset").parents[1] / "stations" / "default.yaml",
    }

    def edit(kind: str, old: str, new: str) -> Path:
        text = shipped[kind].read_text(encoding="utf-8")
        assert old in text
        path = tmp_path / f"{kind}.yaml"
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        return path

    return edit
