"""`reproduce`: what goes where, exit codes, sentences and a clean end."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from bench.cli import reproduce_command
from bench.cli.main import app
from bench.reproduction.figures import draw_ours, panels
from bench.reproduction.papers import PAPERS
from bench.reproduction.result import PaperFigure, Published, Reproduction

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure


def draw() -> Figure:
    figure, (axes,) = panels()
    draw_ours(axes, [0.0, 1.0, 2.0], [0.0, 1.0, 0.5], "ours")
    return figure


def paper_of(ours: float) -> Reproduction:
    number = Published(
        where="Table 1",
        quantity="dip",
        unit="deg",
        published=48.72,
        ours=ours,
        tolerance=0.1,
        reason="noise",
    )
    figure = PaperFigure(name="fig", title="Fig. 1", caption="A line.", draw=draw)
    return Reproduction(paper="skula", title="A title", numbers=[number], figures=[figure])


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Replace the experiments by one number, the list's last, for every paper."""
    values = [48.75]
    monkeypatch.setattr(reproduce_command, "reproduce", lambda *_: paper_of(values[-1]))
    return values


def test_a_number_that_does_not_hold_is_exit_code_1(given: list[float]) -> None:
    assert CliRunner().invoke(app, ["reproduce", "skula"]).exit_code == 0
    given.append(48.85)
    result = CliRunner().invoke(app, ["reproduce", "skula"])
    assert result.exit_code == 1
    assert "Table 1: dip (deg)" in result.stdout
    assert "NO" in result.stdout


@pytest.mark.usefixtures("given")
def test_json_stands_alone_on_stdout() -> None:
    result = CliRunner().invoke(app, ["reproduce", "--json"])
    document = json.loads(result.stdout)
    assert document["holds"]
    assert len(document["papers"]) == len(PAPERS)
    assert document["papers"][0]["numbers"][0]["ours"] == 48.75
    assert "1 of 1 numbers hold" in result.stderr


def test_same_seed_same_bytes(given: list[float], tmp_path: Path) -> None:
    """With --out nothing of the table is printed but the page's path."""
    assert given
    for folder in ("a", "b/deep"):
        result = CliRunner().invoke(app, ["reproduce", "skula", "--out", str(tmp_path / folder)])
        assert result.exit_code == 0
        assert result.stdout.strip() == str(tmp_path / folder / "README.md")
    files = {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    again = {path.name: path.read_bytes() for path in (tmp_path / "b/deep").iterdir()}
    assert files.keys() == {"README.md", "results.json", "fig.svg"}
    assert files == again


def test_a_paper_that_is_not_there_is_one_sentence() -> None:
    result = run("reproduce", "newton")
    assert result.returncode == 2
    assert result.stderr == (
        "compass-bench: paper must be one of cho_park, skula, caruso, konvalin; "
        "instead received newton\n"
    )


def test_a_folder_that_cannot_be_is_one_sentence_before_anything_is_measured(
    tmp_path: Path,
) -> None:
    (tmp_path / "file").touch()
    result = run("reproduce", "--out", str(tmp_path / "file"))
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "--out must be a folder that can be written" in result.stderr


def test_a_signal_ends_it_and_leaves_no_file(tmp_path: Path) -> None:
    arguments = ["reproduce", "cho_park", "--out", str(tmp_path)]
    with subprocess.Popen(command(*arguments), stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "cho_park: measuring\n"
        process.send_signal(signal.SIGTERM)
        _, rest = process.communicate(timeout=30.0)
    assert process.returncode == 143
    assert rest.count("\n") == 1
    assert "Traceback" not in rest
    assert list(tmp_path.iterdir()) == []


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "bench.cli.main", *arguments]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*arguments), capture_output=True, text=True, check=False)
