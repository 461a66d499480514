"""Progress of a run on stderr and its verdict on stdout."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, TextIO

from rich.console import Console
from rich.panel import Panel
from rich.text import Text

from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import last_attempts
from bench.cli.limit_bar import limit_bar, limits_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from bench.acceptance.measurement import Measurement
    from bench.acceptance.verdict import Verdict
    from bench.progress import RunState

STYLES: Final = {
    Outcome.PASS: "green",
    Outcome.MARGINAL: "yellow",
    Outcome.FAIL: "red",
    Outcome.ABORTED: "magenta",
    Outcome.ERROR: "red reverse",
}
_SHAPES: Final = {
    Outcome.PASS: "[ok]",
    Outcome.MARGINAL: "[~~]",
    Outcome.FAIL: "[XX]",
    Outcome.ABORTED: "[--]",
    Outcome.ERROR: "[!!]",
}
_NEWS_EVERY: Final = 0.5
LARGEST: Final = ("level_max", "tilt_max", "achieved_level_max", "achieved_tilt_max")
"""Measurements of which the banner tells how sure they are."""


class ConsoleProgress:
    """Shows step, position, elapsed and expected time, and a limit bar a measurement.

    On a terminal one line is rewritten in place; elsewhere each step and each measurement
    is a line of its own.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._console = _OpenConsole(file=stream or sys.stderr, highlight=False, soft_wrap=True)
        self._live = self._console.is_terminal
        self._shown_s = -1.0

    def step_started(self, state: RunState) -> None:
        """Announce a step."""
        self._clear()
        line = Text(f"{_clock(state)}  {state.step.replace('_', ' ')}", style="bold")
        if state.positions:
            line.append(f"  position {state.position} of {state.positions}", style="not bold dim")
        self._print(line)

    def position_reached(self, state: RunState) -> None:
        """Move the line on; not more often than twice a second of the run."""
        if not self._live or state.elapsed_s - self._shown_s < _NEWS_EVERY:
            return
        self._shown_s = state.elapsed_s
        done = state.elapsed_s / state.expected_s if state.expected_s > 0.0 else 0.0
        filled = min(30, int(30 * done))
        line = (
            f"{_clock(state)}  position {state.position} of {state.positions}  "
            f"|{'=' * filled}{' ' * (30 - filled)}|"
        )
        self._write(f"\r{line}\x1b[K")

    def measured(self, measurement: Measurement) -> None:
        """Show one measurement between its limits."""
        self._clear()
        outcome = measurement.outcome or Outcome.ERROR
        judged = measurement.limit is not None
        line = Text("  ")
        line.append(_SHAPES[outcome] if judged else "    ", style=STYLES[outcome] if judged else "")
        line.append(f" {measurement.name:<26}")
        line.append(f"{_value(measurement.value):>9} ")
        line.append(
            limit_bar(measurement), style="dim" if outcome is Outcome.PASS else STYLES[outcome]
        )
        line.append(f" {limits_text(measurement)}", style="dim")
        if outcome is not Outcome.PASS and measurement.note:
            line.append(f"  {measurement.note}")
        self._print(line)

    def step_ended(self, state: RunState, outcome: Outcome) -> None:
        """Say how a step ended where it did not pass."""
        self._clear()
        if outcome is not Outcome.PASS:
            self._print(Text(f"{_clock(state)}  {state.step}: {outcome}", style=STYLES[outcome]))

    def _clear(self) -> None:
        if self._live:
            self._write("\r\x1b[K")

    def _print(self, line: Text) -> None:
        with suppress(OSError, ValueError):  # the run goes on where nobody can watch any more
            self._console.print(line)

    def _write(self, text: str) -> None:
        with suppress(OSError, ValueError):
            self._console.file.write(text)
            self._console.file.flush()


class _OpenConsole(Console):
    """A console whose reader may go away without ending the program."""

    def on_broken_pipe(self) -> None:
        """Let the writer know, instead of leaving with an exit code that means FAIL."""
        raise BrokenPipeError


def print_verdict(
    verdict: Verdict,
    serial: str,
    folder: Path | None,
    *,
    measurements: Iterable[Measurement] = (),
    record: Mapping[str, Any] | None = None,
) -> None:
    """Print the methods, the banner, the reason, the next action and where the record is.

    Parameters
    ----------
    measurements : iterable of Measurement
        Judged; the largest heading errors among them are told with U and conformity.
    record : mapping, optional
        Its methods are told in a short table; without it there is none.
    """
    console = _OpenConsole(highlight=False)
    if record is not None:
        from bench.cli.method_table import method_table  # numpy and scipy come with it

        for line in method_table(record):
            console.print(Text(line, style="dim"), soft_wrap=True)
    style = STYLES[verdict.outcome]
    text = Text(justify="center")
    text.append(
        f"{_SHAPES[verdict.outcome]}  {verdict.outcome}  {_SHAPES[verdict.outcome]}\n",
        style=f"bold {style}",
    )
    text.append(f"{serial}\n{verdict.reason}\n")
    for line in certainty_lines(measurements):
        text.append(f"{line}\n", style="dim")
    text.append(verdict.next_action, style="bold")
    console.print(Panel(text, border_style=style, width=min(100, console.width)))
    if folder is not None:
        for name, what in (
            ("report.html", "report"),
            ("run.rrd", "recording (compass-bench view)"),
            ("record.json", "record"),
        ):
            if (folder / name).exists():
                console.print(f"{what:<32}{folder / name}", soft_wrap=True)


def certainty_lines(measurements: Iterable[Measurement]) -> list[str]:
    """Return a line for each largest heading error whose uncertainty is known: U and conformity.

    ``level max 0.221 deg, U 0.09: inside 0.5 deg with 99.9 %``
    """
    from bench.record.certainty import probability_words  # the drawings of the report come with it

    lines = []
    for measurement in last_attempts(measurements):
        limit, probability = measurement.limit, measurement.conformity
        if measurement.name not in LARGEST or limit is None or probability is None:
            continue
        name, u = measurement.name.replace("_", " "), limit.uncertainty
        lines.append(
            f"{name} {measurement.value:.3f} {limit.unit}, U {u:.2g}: inside {limit.high:g} "
            f"{limit.unit} with {probability_words(probability)}"
        )
    return lines


def _value(value: float) -> str:
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e6 else f"{value:.4g}"


def _clock(state: RunState) -> str:
    return f"{_minutes(state.elapsed_s)}/{_minutes(state.expected_s)}"


def _minutes(seconds: float) -> str:
    return f"{int(seconds) // 60:d}:{int(seconds) % 60:02d}"
