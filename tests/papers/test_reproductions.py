"""Each paper is reproduced once on the virtual bench, and the page in docs is what comes out.

One test a paper, because its experiments take 10 to 25 s of the processor, several times as much
beside other work: hence the timeout too.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import pytest

from bench.cli.laboratory import open_laboratory
from bench.reproduction.figures import drawing_style, svg_of
from bench.reproduction.page import document_of, markdown_of
from bench.reproduction.papers import PAPERS, reproduce

if TYPE_CHECKING:
    from bench.reproduction.result import Reproduction

PAGE = Path(__file__).resolve().parents[2] / "docs" / "papers"
LARGEST_BYTES = 150_000


@pytest.mark.timeout(240)
@pytest.mark.parametrize("paper", PAPERS)
def test_a_paper_holds_and_docs_show_what_the_code_gives(paper: str) -> None:
    """After a change: `make papers`."""
    reproduction = reproduce(paper, open_laboratory)

    assert reproduction.numbers
    assert missed(reproduction) == []
    (ours,) = document_of([reproduction])["papers"]
    assert_same(ours, published(paper))
    assert_figures_stand_on_the_page(reproduction)


def test_no_figure_is_left_over_in_docs() -> None:
    document = json.loads((PAGE / "results.json").read_text(encoding="utf-8"))
    named = {f"{name}.svg" for entry in document["papers"] for name in entry["figures"]}

    assert named == {path.name for path in PAGE.glob("*.svg")}
    assert [entry["paper"] for entry in document["papers"]] == list(PAPERS)


def test_a_backend_of_the_environment_that_does_not_exist_is_no_obstacle() -> None:
    code = "from bench.reproduction.figures import drawing_style, panels, svg_of\n"
    code += "with drawing_style():\n    print(len(svg_of(panels()[0])))"
    environment = {**os.environ, "MPLBACKEND": "nonsense"}

    done = subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )

    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 1000


def missed(reproduction: Reproduction) -> list[str]:
    """Return a sentence for each number that does not hold."""
    return [
        f"{number.where}, {number.quantity}: {number.ours:g} for "
        f"{number.published if number.exact is None else number.exact:g} +- {number.tolerance:g}"
        for number in reproduction.numbers
        if not number.holds
    ]


def published(paper: str) -> dict[str, Any]:
    document = json.loads((PAGE / "results.json").read_text(encoding="utf-8"))
    return next(entry for entry in document["papers"] if entry["paper"] == paper)


def assert_same(ours: Any, theirs: Any) -> None:
    """Texts equal, numbers to a millionth, all the way down."""
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys()
        for key, value in ours.items():
            assert_same(value, theirs[key])
    elif isinstance(ours, list):
        assert len(ours) == len(theirs)
        for one, other in zip(ours, theirs, strict=True):
            assert_same(one, other)
    elif isinstance(ours, float):
        assert theirs == pytest.approx(ours, rel=1e-6, abs=1e-9)
    else:
        assert ours == theirs


def assert_figures_stand_on_the_page(reproduction: Reproduction) -> None:
    """Every figure draws, is small, and lies in docs where page and section show it."""
    page = (PAGE / "README.md").read_text(encoding="utf-8")
    section = markdown_of([reproduction])
    for figure in reproduction.figures:
        with drawing_style():
            svg = svg_of(figure.draw())

        assert ET.fromstring(svg).tag.endswith("svg")
        assert len(svg) < LARGEST_BYTES, figure.name
        assert (PAGE / f"{figure.name}.svg").stat().st_size < LARGEST_BYTES
        assert f"({figure.name}.svg)" in page
        assert f"({figure.name}.svg)" in section
