"""The worst outcome wins, in words."""

from __future__ import annotations

import math

import pytest

from bench.acceptance.measurement import Limit, Measurement
from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import (
    judge_measurement,
    last_attempts,
    not_recorded,
    sentence_of,
    verdict_of,
)
from bench.errors import ConfigError


def judged(name, value, *, high=0.5, guard_band=0.0, missed=Outcome.FAIL, attempt=1, action=""):
    limit = Limit(
        name=name, unit="deg", high=high, guard_band=guard_band, missed=missed, action=action
    )
    row = Measurement(name=name, value=value, step="verify", unit="deg", attempt=attempt)
    return row.judged(limit)


def test_all_inside_is_pass():
    verdict = verdict_of([judged("level_max", 0.2), judged("tilt_max", 0.3)])

    assert verdict.outcome is Outcome.PASS
    assert verdict.reason == "all 2 limited measurements are inside their limits"
    assert verdict.first_failure is None
    assert "ISO 14253-1" in verdict.rule


@pytest.mark.parametrize(
    ("value", "outcome"),
    [
        (0.44, Outcome.PASS),
        (0.45, Outcome.PASS),
        (0.450001, Outcome.MARGINAL),
        (0.5, Outcome.MARGINAL),
        (0.500001, Outcome.FAIL),
        (math.nan, Outcome.ERROR),
        (math.inf, Outcome.ERROR),
    ],
)
def test_the_guard_band_lies_inside_the_limit(value, outcome):
    assert judged("level_max", value, guard_band=0.05).outcome is outcome
    assert verdict_of([judged("level_max", value, guard_band=0.05)]).outcome is outcome


def test_an_error_of_the_bench_outweighs_a_bad_unit_but_the_first_failure_is_named():
    rows = [
        judged("level_max", 0.7),
        judged("temperature_change", 0.9, missed=Outcome.ERROR),
    ]

    verdict = verdict_of(rows)

    assert verdict.outcome is Outcome.ERROR
    assert verdict.first_failure == "level_max"
    assert verdict.reason == "temperature_change 0.9 deg is above 0.5 deg"


def test_the_action_of_the_missed_limit_is_the_next_action():
    verdict = verdict_of([judged("a", 0.1), judged("b", 0.9, action="Call the engineer.")])

    assert verdict.next_action == "Call the engineer."


def test_further_missed_limits_are_counted():
    verdict = verdict_of([judged("a", 0.9), judged("b", 0.8), judged("c", 0.7)])

    assert verdict.reason == "a 0.9 deg is above 0.5 deg, and 2 more"


def test_a_passed_retry_counts_and_the_missed_attempt_stays():
    rows = [judged("level_max", 0.7, attempt=1), judged("level_max", 0.3, attempt=2)]

    assert verdict_of(rows).outcome is Outcome.PASS
    assert last_attempts(rows) == [rows[1]]


def test_a_missed_retry_counts_over_a_passed_first_attempt():
    rows = [judged("level_max", 0.3, attempt=1), judged("level_max", 0.7, attempt=2)]

    assert verdict_of(rows).outcome is Outcome.FAIL


def test_nothing_judged_is_an_error():
    assert verdict_of([]).outcome is Outcome.ERROR
    assert verdict_of([Measurement(name="a", value=1.0, step="s")]).outcome is Outcome.ERROR


def test_a_required_measurement_that_is_absent_is_an_error():
    verdict = verdict_of([judged("level_max", 0.2)], required=["level_max", "tilt_max"])

    assert verdict.outcome is Outcome.ERROR
    assert verdict.reason == "not measured: tilt_max"


def test_a_failed_unit_that_was_stopped_early_stays_failed():
    verdict = verdict_of([judged("noise_x", 0.9)], required=["noise_x", "tilt_max"])

    assert verdict.outcome is Outcome.FAIL


def test_an_error_sentence_makes_an_error_and_an_abort_an_abort():
    rows = [judged("level_max", 0.2)]

    assert verdict_of(rows, error="module silent").outcome is Outcome.ERROR
    assert verdict_of(rows, error="module silent").reason == "module silent"
    assert verdict_of(rows, aborted="signal 2").outcome is Outcome.ABORTED
    assert verdict_of(rows, aborted="signal 2", error="rig not parked").outcome is Outcome.ERROR


def test_a_run_with_a_hole_in_its_record_never_passes():
    verdict = not_recorded(verdict_of([judged("level_max", 0.2)]), "disk full")

    assert (verdict.outcome, verdict.reason) == (Outcome.ERROR, "disk full")
    again = not_recorded(verdict, "no report")
    assert again.reason == "disk full; no report"


def test_a_limit_in_another_unit_is_a_configuration_error():
    row = Measurement(name="noise_x", value=0.1, step="noise", unit="mG")

    with pytest.raises(ConfigError, match="noise_x must be in mG; instead received uT"):
        judge_measurement(row, {"noise_x": Limit(name="noise_x", unit="uT", high=1.0)})


def test_a_check_that_is_not_met_says_what_was_found():
    limit = Limit(name="serial_match", unit="", low=1.0)
    row = Measurement(name="serial_match", value=0.0, step="s", note="module says SN2")

    assert sentence_of(row.judged(limit)) == "serial_match was not met (module says SN2)"


def test_a_measurement_without_a_limit_informs():
    row = judge_measurement(Measurement(name="a", value=9.0, step="s"), {})

    assert row.outcome is Outcome.PASS
    assert row.limit is None


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.7, "a 0.7 deg is above 0.5 deg"),
        (0.49, "a 0.49 deg is within the guard band w = 0.1 deg of its limit 0.5 deg"),
        (0.1, "a 0.1 deg is inside its limits"),
        (math.nan, "a could not be measured"),
    ],
)
def test_a_measurement_says_its_value_and_its_limit(value, words):
    assert sentence_of(judged("a", value, guard_band=0.1)) == words
