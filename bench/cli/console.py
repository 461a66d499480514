"""Progress of a run on stderr and its verdict on stdout."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Final, TextIO

from rich.console import Console
from rich.panel import Panel
from rich.text import Text

from bench.acceptance.outcome import Outcome
from bench.cli.limit_bar import limit_bar, limits_text

if TYPE_CHECKING:
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


def print_verdict(verdict: Verdict, serial: str, folder: Path | None) -> None:
    """Print the banner, the reason, the next action and where the record is."""
    console = _OpenConsole(highlight=False)
    style = STYLES[verdict.outcome]
    text = Text(justify="center")
    text.append(
        f"{_SHAPES[verdict.outcome]}  {verdict.outcome}  {_SHAPES[verdict.outcome]}\n",
        style=f"bold {style}",
    )
    text.append(f"{serial}\n{verdict.reason}\n")
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


def _value(value: float) -> str:
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e6 else f"{value:.4g}"


def _clock(state: RunState) -> str:
    return f"{_minutes(state.elapsed_s)}/{_minutes(state.expected_s)}"


def _minutes(seconds: float) -> str:
    return f"{int(seconds) // 60:d}:{int(seconds) % 60:02d}"
