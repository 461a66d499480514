"""junit.xml: failure is the unit's, error is the bench's."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest

from bench.acceptance.measurement import Limit, Measurement
from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import verdict_of
from bench.record.recorder import RunRecorder
from protocols.clock import SimulatedClock

LEVEL = Limit(name="level_max", unit="deg", high=0.5)
GUARDED = Limit(name="level_max", unit="deg", high=0.5, uncertainty=0.1, guard_factor=1.0)
DIP = Limit(name="dip_difference", unit="deg", high=0.1, missed=Outcome.ERROR)


@pytest.fixture
def junit_after(tmp_path, wall_clock):
    def after(*measurements, **ended):
        recorder = RunRecorder(
            tmp_path, "SN1", "eol", clock=SimulatedClock(), wall_clock=wall_clock
        )
        for measurement in measurements:
            recorder.measurement(measurement)
        folder = recorder.close(verdict_of(measurements, **ended))
        return ET.parse(folder / "junit.xml").getroot()

    return after


def row(name, value, limit, step="verify", attempt=1):
    fresh = Measurement(name=name, value=value, step=step, unit="deg", attempt=attempt)
    return fresh.judged(limit)


def counts(root):
    return tuple(int(root.get(key)) for key in ("tests", "failures", "errors"))


def test_a_passed_run_has_no_failures(junit_after):
    root = junit_after(row("level_max", 0.2, LEVEL))

    assert counts(root) == (2, 0, 0)
    case = root.find("testsuite[@name='verify']/testcase")
    assert case.get("classname") == "eol.verify"
    values = {p.get("name"): p.get("value") for p in case.findall("properties/property")}
    assert values["value"] == "0.2"
    assert values["high"] == "0.5"


def test_ratio_conformity_and_rule_are_told_where_the_uncertainty_is_known(junit_after):
    root = junit_after(row("level_max", 0.2, GUARDED))

    case = root.find("testsuite[@name='verify']/testcase")
    values = {p.get("name"): p.get("value") for p in case.findall("properties/property")}
    assert float(values["tur"]) == pytest.approx(5.0)
    assert float(values["conformity"]) == pytest.approx(1.0)
    assert values["rule"] == "guarded, w = 1 U"


def test_a_missed_limit_is_a_failure_of_case_and_verdict(junit_after):
    root = junit_after(row("level_max", 0.7, LEVEL))

    assert counts(root) == (2, 2, 0)
    failure = root.find("testsuite/testcase/failure")
    assert failure.get("message") == "level_max 0.7 deg is above 0.5 deg"


def test_a_bench_limit_that_is_missed_is_an_error(junit_after):
    root = junit_after(row("dip_difference", 0.7, DIP, step="fit"))

    assert counts(root) == (2, 0, 2)


def test_an_aborted_run_cannot_look_green(junit_after):
    root = junit_after(row("level_max", 0.2, LEVEL), aborted="ended by the operator")

    assert counts(root) == (2, 0, 1)
    assert root.find("testsuite[@name='verdict']//error").get("message") == "ended by the operator"


def test_earlier_attempts_are_told_but_do_not_fail(junit_after):
    first = row("level_max", 0.7, LEVEL)

    root = junit_after(first, replace(row("level_max", 0.2, LEVEL), attempt=2))

    assert counts(root) == (2, 0, 0)
    assert "attempt 1: level_max 0.7 deg is above 0.5 deg" in root.findtext(
        "testsuite/testcase/system-out"
    )
