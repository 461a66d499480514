from __future__ import annotations

import io
from dataclasses import replace

from bench.acceptance.measurement import Limit, Measurement
from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import Verdict
from bench.cli.console import ConsoleProgress, certainty_lines, print_verdict
from bench.progress import RunState

STATE = RunState(step="level_sweep", position=13, positions=150, elapsed_s=42.0, expected_s=351.0)


def shown(*calls: tuple[str, object]) -> str:
    stream = io.StringIO()
    progress = ConsoleProgress(stream)
    for name, argument in calls:
        if isinstance(argument, tuple):
            getattr(progress, name)(*argument)
        else:
            getattr(progress, name)(argument)
    return stream.getvalue()


def measurement(value: float) -> Measurement:
    limit = Limit(name="level_max", unit="deg", high=0.5)
    return Measurement(
        name="level_max", value=value, step="verify", unit="deg", note="at 30 deg"
    ).judged(limit)


def test_step_is_announced_with_time_and_position() -> None:
    text = shown(("step_started", STATE))

    assert text == "0:42/5:51  level sweep  position 13 of 150\n"


def test_positions_make_no_lines_where_nobody_watches() -> None:
    assert shown(("position_reached", STATE)) == ""


def test_measurement_has_its_mark_value_and_limit() -> None:
    text = shown(("measured", measurement(0.25)))

    assert "[ok] level_max" in text
    assert "0.25" in text
    assert "<= 0.5 deg" in text
    assert "at 30 deg" not in text


def test_missed_measurement_says_more() -> None:
    text = shown(("measured", measurement(0.75)))

    assert "[XX] level_max" in text
    assert "at 30 deg" in text


def test_step_that_passed_ends_without_a_word() -> None:
    assert shown(("step_ended", (STATE, Outcome.PASS))) == ""
    assert "level_sweep: FAIL" in shown(("step_ended", (STATE, Outcome.FAIL)))


def test_verdict_has_shape_word_reason_and_next_action(capsys: object) -> None:
    verdict = Verdict(outcome=Outcome.FAIL, reason="too far off", next_action="Red bin.")

    print_verdict(verdict, "SN7", None)

    text = capsys.readouterr().out  # type: ignore[attr-defined]
    assert "[XX]  FAIL  [XX]" in text
    assert "SN7" in text
    assert "too far off" in text
    assert "Red bin." in text


def test_banner_says_how_sure_the_largest_errors_are(capsys: object) -> None:
    limit = Limit(name="level_max", unit="deg", high=0.5, uncertainty=0.1, guard_factor=1.0)
    value = {"name": "level_max", "step": "verify", "unit": "deg"}
    first = Measurement(value=0.9, **value).judged(limit)  # type: ignore[arg-type]
    second = replace(Measurement(value=0.4, **value), attempt=2).judged(limit)  # type: ignore[arg-type]
    verdict = Verdict(outcome=Outcome.PASS, reason="all inside", next_action="Release.")

    print_verdict(verdict, "SN7", None, measurements=[first, second])

    text = capsys.readouterr().out  # type: ignore[attr-defined]
    assert "level max 0.400 deg, U 0.1: inside 0.5 deg with 97.7 %" in text
    assert "0.900" not in text


def test_banner_says_nothing_of_errors_without_uncertainty() -> None:
    assert certainty_lines([measurement(0.25)]) == []


class ClosedPipe(io.StringIO):
    """A stream whose reader has gone away."""

    def write(self, text: str) -> int:
        raise BrokenPipeError


def test_a_run_goes_on_where_nobody_reads_its_progress_any_more() -> None:
    progress = ConsoleProgress(ClosedPipe())

    progress.step_started(STATE)
    progress.measured(measurement(0.25))
    progress.step_ended(STATE, Outcome.FAIL)
