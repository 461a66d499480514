"""Figures of docs/accuracy: how the bench knows its accuracy and what it cannot see.

Run:  compass-bench run eol_three_axis --serial SN0001 --out runs
      python benchmarks/accuracy_figures.py runs/latest

Draws the SVG files of the three pages, those of the second from the record of the run, and prints
the table of the third. The same record gives the same files, byte for byte.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core, before numpy reads it

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from accuracy_after import budget_figure, certificate_figure, methods_figure
from accuracy_before import bound_figure, poses_figure
from accuracy_unseen import hidden_errors, unseen_figure

from bench.errors import ConfigError
from bench.record.document import read_record
from bench.reproduction.figures import drawing_style, svg_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.figure import Figure

OUT = Path(__file__).parent.parent / "docs" / "accuracy"


def figures(run_dir: Path) -> Mapping[str, Callable[[], Figure]]:
    """Return what draws each figure, by its name.

    Raises
    ------
    ConfigError
        If the folder holds no record, or one without uncertainty and expected errors.
    """
    record = read_record(run_dir)
    if not record.get("uncertainty") or not record.get("study", {}).get("expected"):
        message = (
            f"{run_dir} must be a finished run of eol_three_axis; instead its record has no "
            "uncertainty or no expected errors"
        )
        raise ConfigError(message)
    return {
        "bound": bound_figure,
        "poses": poses_figure,
        "methods": lambda: methods_figure(record),
        "certificate": lambda: certificate_figure(record),
        "budget": lambda: budget_figure(record),
        "unseen": unseen_figure,
    }


def main() -> int:
    """Draw the figures and print what stays hidden."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="folder of a run of eol_three_axis")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the SVG files")
    options = parser.parse_args()
    try:
        drawn = figures(options.run)
    except ConfigError as fault:
        print(fault, file=sys.stderr)
        return 2
    with drawing_style():
        for name, draw in drawn.items():
            (options.out / f"{name}.svg").write_bytes(svg_of(draw()))
    print(f"{'one thing wrong':34} {'seen':>7} {'true':>7} {'fit tells':>9}  largest error, deg")
    for row in hidden_errors():
        print(f"{row.name:34} {row.seen_deg:7.3f} {row.true_deg:7.3f} {row.told_deg:9.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
