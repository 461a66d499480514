"""junit.xml: a test suite a step, a test case a measurement.

`failure` is a missed limit of the unit; `error` is a measurement that the bench could not
make or judge, and a run that ended early. Earlier attempts stand in `system-out`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

from bench.acceptance.outcome import Outcome
from bench.acceptance.verdict import last_attempts, sentence_of
from bench.record.entries import measurement_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from bench.acceptance.measurement import Measurement


def write_junit(path: Path, record: Mapping[str, Any]) -> None:
    """Write the JUnit file of a record."""
    tree = ET.ElementTree(junit_of(record))
    ET.indent(tree)
    tree.write(path, encoding="utf-8", xml_declaration=True)


def junit_of(record: Mapping[str, Any]) -> ET.Element:
    """Return the JUnit document of a record."""
    run = record["run"]
    name = f"{run['procedure']} {run['serial']}"
    root = ET.Element("testsuites", name=name, time=_seconds(run.get("simulated_s")))
    measurements = [measurement_of(entry) for entry in record["measurements"]]
    for step in dict.fromkeys(
        [*(entry["name"] for entry in record["steps"]), *(m.step for m in measurements)]
    ):
        attempts = [entry for entry in record["steps"] if entry["name"] == step]
        _suite(root, step, attempts, [m for m in measurements if m.step == step], record)
    _verdict_suite(root, record)
    for count in ("tests", "failures", "errors"):
        root.set(count, str(sum(int(suite.get(count, "0")) for suite in root)))
    return root


def _suite(
    root: ET.Element,
    step: str,
    attempts: Sequence[Mapping[str, Any]],
    measurements: Sequence[Measurement],
    record: Mapping[str, Any],
) -> None:
    run = record["run"]
    taken_s = sum((a["ended_s"] or a["started_s"]) - a["started_s"] for a in attempts)
    suite = ET.SubElement(root, "testsuite", name=step, time=_seconds(taken_s))
    suite.set("timestamp", run["started_utc"])
    for measurement in last_attempts(measurements):
        case = ET.SubElement(
            suite, "testcase", name=measurement.name, classname=f"{run['procedure']}.{step}"
        )
        _judge_case(case, measurement)
        earlier = [
            f"attempt {m.attempt}: {sentence_of(m)}"
            for m in measurements
            if m.name == measurement.name and m.attempt < measurement.attempt
        ]
        text = "\n".join([sentence_of(measurement), *filter(None, [measurement.note]), *earlier])
        ET.SubElement(case, "system-out").text = text
    _count(suite)


def _judge_case(case: ET.Element, measurement: Measurement) -> None:
    properties = ET.SubElement(case, "properties")
    limit = measurement.limit
    values = {
        "value": measurement.value,
        "unit": measurement.unit,
        "low": limit.low if limit else None,
        "high": limit.high if limit else None,
        "uncertainty": limit.uncertainty if limit else measurement.uncertainty,
        "guard_band": limit.guard_band if limit else None,
        "rule": measurement.rule or None,
        "tur": measurement.tur,
        "conformity": measurement.conformity,
        "outcome": measurement.outcome,
    }
    for name, value in values.items():
        if value is not None:
            ET.SubElement(properties, "property", name=name, value=str(value))
    tag = {Outcome.FAIL: "failure", Outcome.ERROR: "error"}.get(measurement.outcome or Outcome.PASS)
    if tag is not None:
        ET.SubElement(case, tag, message=sentence_of(measurement), type=str(measurement.outcome))


def _verdict_suite(root: ET.Element, record: Mapping[str, Any]) -> None:
    """Add the verdict as a case, so that a run which ended early cannot look green."""
    verdict = record["verdict"]
    suite = ET.SubElement(root, "testsuite", name="verdict", time="0.000")
    case = ET.SubElement(
        suite, "testcase", name="verdict", classname=f"{record['run']['procedure']}.verdict"
    )
    outcome = verdict["outcome"] if verdict else Outcome.ERROR.value
    reason = verdict["reason"] if verdict else "the run did not end"
    if outcome == Outcome.FAIL:
        ET.SubElement(case, "failure", message=reason, type=outcome)
    elif outcome in (Outcome.ERROR, Outcome.ABORTED):
        ET.SubElement(case, "error", message=reason, type=outcome)
    ET.SubElement(case, "system-out").text = f"{outcome}: {reason}"
    _count(suite)


def _count(suite: ET.Element) -> None:
    cases = suite.findall("testcase")
    suite.set("tests", str(len(cases)))
    suite.set("failures", str(sum(case.find("failure") is not None for case in cases)))
    suite.set("errors", str(sum(case.find("error") is not None for case in cases)))


def _seconds(value: float | None) -> str:
    return f"{value or 0.0:.3f}"
