"""`reproduce`: the papers' tables and figures from the virtual bench."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from bench.cli.laboratory import open_laboratory
from bench.reproduction.page import (
    json_of,
    printed_text,
    require_folder,
    value_text,
    write_page,
)
from bench.reproduction.papers import PAPERS, reproduce, require_paper
from bench.reproduction.result import Reproduction

PIPED_WIDTH: Final = 120
"""Columns of the table where there is no terminal to fill."""


def reproduce_papers(paper: str | None, *, json: bool, out: Path | None) -> int:
    """Reproduce one paper or all and return 0 if every number holds, else 1.

    Raises
    ------
    ConfigError
        If there is no such paper or `out` cannot be written.
    """
    chosen = PAPERS if paper is None else (require_paper(paper),)
    if out is not None:
        require_folder(out)
    results = []
    for key in chosen:
        typer.echo(f"{key}: measuring", err=True)
        results.append(reproduce(key, open_laboratory))
        typer.echo(f"{key}: {_summary(results[-1])}", err=True)
    if json:
        typer.echo(json_of(results), nl=False)
    elif out is None:
        for result in results:
            _print_numbers(result)
    if out is not None:
        page = write_page(out, results)
        typer.echo(str(page), err=json)
    return 0 if all(result.holds for result in results) else 1


def _summary(result: Reproduction) -> str:
    held = sum(number.holds for number in result.numbers)
    return f"{held} of {len(result.numbers)} numbers hold"


def _print_numbers(result: Reproduction) -> None:
    table = Table(
        title=result.title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    table.add_column("quantity")
    for name in ("published", "exact", "ours", "within"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("holds")
    for number in result.numbers:
        unit = f" ({number.unit})" if number.unit else ""
        table.add_row(
            f"{number.where}: {number.quantity}{unit}",
            printed_text(number.published),
            value_text(number, number.exact),
            value_text(number, number.ours),
            f"{number.tolerance:.2g}",
            "yes" if number.holds else "NO",
        )
    console = Console(highlight=False)
    console.width = console.width if console.is_terminal else PIPED_WIDTH
    console.print(table)
