"""Every fault of the catalogue, through the whole bench: named, caught early, harmless when small.

Given a fault at full strength the run is FAIL where the unit is at fault and ERROR where the
bench is, and the first failure is the one that the catalogue names. What only passes by is
repeated, and the run passes with a record of it. At negligible strength
the unit passes, and in between the measurement gets worse with the strength.
"""

from __future__ import annotations

import itertools
import json

import pytest
from typer.testing import CliRunner

from bench.cli.main import app
from devices.faults import FAULTS, FaultKind

OF_THE_BENCH = ("module_silent", "rig_fault", "field_changed", "reference_silent")
"""First failures that are no measurements: the bench could not judge the unit."""
FAILING = [name for name, fault in FAULTS.items() if not fault.passes]
OF_THE_SEAT = [name for name, fault in FAULTS.items() if fault.kind is FaultKind.SEAT]
"""What only a reversal sees: the error of the bench stands in a measurement."""
BEFORE_THE_WRITE = [
    name
    for name in FAILING
    if name not in OF_THE_SEAT and FAULTS[name].detects not in (*OF_THE_BENCH, "read_back")
]
KINDS = {
    kind: tuple(names)
    for kind, names in itertools.groupby(
        sorted(FAULTS), lambda name: name.removesuffix(name[-2:]) if name[-2] == "_" else name[:12]
    )
}
FEW = 3
SOME_KINDS = [tuple(KINDS)[first : first + FEW] for first in range(0, len(KINDS), FEW)]
"""A few kinds of the catalogue for one run each, as a run costs two seconds."""
WORSE_WITH_STRENGTH = {
    "dead_strap_y": ("set_reset_amplitude_y", -1, (0.5, 1.0)),
    "stuck_axis_z": ("set_reset_amplitude_z", -1, (0.5, 1.0)),
    "inverted_axis_x": ("axis_sense_x", -1, (0.5, 1.0)),
    "swapped_axes": ("axis_sense_x", -1, (0.5, 1.0)),
    "accel_sign_z": ("accel_sense_z", -1, (0.5, 1.0)),
    "excess_noise": ("noise_x", +1, (0.1, 1.0)),
    "saturated_axis": ("peak_reading", +1, (0.1, 0.3)),
}
"""Measurement, which way is worse, and strengths between none and the end of its scale."""


def run_that_sees(bench, name):
    return bench.run(name, procedure="bench_verify" if name in OF_THE_SEAT else "eol_three_axis")


def negligible(kinds):
    return [f"{name}=0.001" for kind in kinds for name in KINDS[kind]]


def test_the_catalogue_has_fifteen_kinds():
    assert len(FAULTS) == 25
    assert len(KINDS) == 15
    assert sorted(itertools.chain(*KINDS.values())) == sorted(FAULTS)


def test_the_command_lists_the_catalogue_with_what_finds_each_fault_first():
    listed = json.loads(CliRunner().invoke(app, ["faults", "--json"]).stdout)

    assert {each["name"]: each["detects"] for each in listed} == {
        name: fault.detects for name, fault in FAULTS.items()
    }
    assert all(each["kind"] and each["breaks"].endswith(".") for each in listed)


@pytest.mark.parametrize("name", FAILING)
def test_a_full_fault_is_found_first_by_what_the_catalogue_names(bench, name):
    detects = FAULTS[name].detects
    run = run_that_sees(bench, name)

    of_the_bench = detects in OF_THE_BENCH or name in OF_THE_SEAT
    assert run.first_failure == detects
    assert (run.outcome, run.exit_code) == (("ERROR", 4) if of_the_bench else ("FAIL", 1))
    assert run.record["injected_faults"] == [name]


@pytest.mark.parametrize("name", [name for name in FAULTS if FAULTS[name].passes])
def test_what_passes_by_is_repeated_and_the_section_that_the_catalogue_names_says_so(
    bench, short_procedure, name
):
    run = bench.run(name, procedure=short_procedure)

    assert (run.outcome, run.exit_code, run.first_failure) == ("PASS", 0, None), run.reason
    spoiled = run.record[FAULTS[name].detects]["spoiled"]
    assert spoiled
    assert all(each["repeated_as"] > each["position"] for each in spoiled)
    assert len(run.events("pose_spoiled")) == len(spoiled)


@pytest.mark.parametrize("name", BEFORE_THE_WRITE)
def test_a_broken_sensor_is_never_written_to(bench, name):
    run = bench.run(name)

    assert run.record["coefficients"] == {}
    assert [step["kind"] for step in run.record["steps"]].count("write") == 0


@pytest.mark.parametrize("name", FAILING)
def test_the_operator_is_told_what_was_found_and_what_to_do(bench, name):
    run = run_that_sees(bench, name)

    verdict = run.record["verdict"]
    sentence = {
        "rig_fault": f"{name.removeprefix('axis_stalled_')} axis",
        "module_silent": "sent",
        "field_changed": "field at the station",
        "reference_silent": "reference magnetometer",
    }
    assert sentence.get(FAULTS[name].detects, FAULTS[name].detects) in verdict["reason"]
    assert verdict["next_action"]
    failing = [m for m in run.record["measurements"] if m["outcome"] in ("FAIL", "ERROR")]
    assert bool(failing) is (FAULTS[name].detects not in OF_THE_BENCH)


def test_a_rig_that_stalls_during_the_run_is_an_error_that_names_the_axis(bench):
    run = bench.run("axis_stalled_roll@2500")

    assert (run.outcome, run.first_failure) == ("ERROR", "rig_fault")
    assert "roll axis" in run.reason
    assert run.record["poses"]


def test_a_lost_write_leaves_the_former_coefficients_and_says_so(bench):
    run = bench.run("lost_write")

    assert run.record["coefficients"]["read_back_equal"] is False
    assert run.record["verdict"]["next_action"].startswith("Red bin, reason: coefficient memory")


def test_a_sensor_that_breaks_after_the_write_fails_and_loses_the_coefficients_again(
    bench, short_procedure
):
    sound = bench.run(*negligible(SOME_KINDS[0]), procedure=short_procedure)
    (verify,) = (step for step in sound.record["steps"] if step["name"] == "verify")

    breaks = f"accel_sign_x@{round(100 * verify['started_s']) + 100}"
    run = bench.run(breaks, procedure=short_procedure)

    assert run.outcome == "FAIL"
    assert run.first_failure in ("level_max", "tilt_max")
    assert run.record["coefficients"]["read_back_equal"] is True
    assert run.record["coefficients"]["restored"] is True
    assert run.events("coefficients_restored")


@pytest.mark.parametrize("kinds", SOME_KINDS, ids="+".join)
def test_negligible_faults_of_a_few_kinds_pass_on_all_their_axes_at_once(
    bench, short_procedure, kinds
):
    run = bench.run(*negligible(kinds), procedure=short_procedure)

    assert (run.outcome, run.exit_code) == ("PASS", 0), run.reason
    assert run.first_failure is None
    assert run.record["coefficients"]["read_back_equal"] is True


def test_all_faults_together_at_negligible_strength_pass_the_whole_procedure(bench):
    run = bench.run(*(f"{name}=0.001" for name in FAULTS))

    assert run.outcome == "PASS", run.reason


def test_all_faults_at_strength_zero_change_no_byte_of_the_samples(bench):
    none = bench.run(procedure="set_reset")
    zero = bench.run(*(f"{name}=0" for name in FAULTS), procedure="set_reset")

    assert (none.outcome, zero.outcome) == ("PASS", "PASS")
    assert (none.folder / "samples.parquet").read_bytes() == (
        zero.folder / "samples.parquet"
    ).read_bytes()


@pytest.mark.parametrize("name", WORSE_WITH_STRENGTH)
def test_what_finds_a_fault_gets_worse_with_its_strength(bench, name):
    measurement, sign, strengths = WORSE_WITH_STRENGTH[name]
    runs = [bench.run(procedure="set_reset")]
    runs += [bench.run(f"{name}={strength}", procedure="set_reset") for strength in strengths]

    values = [sign * run.value(measurement) for run in runs]

    assert all(better < worse for better, worse in itertools.pairwise(values))


def test_a_silence_is_an_error_of_the_bus_and_a_longer_one_ends_the_run(bench):
    shorter, longer = (
        bench.run(f"module_silent={strength}@1500", procedure="set_reset")
        for strength in (0.05, 0.2)
    )

    assert (shorter.outcome, shorter.first_failure) == ("ERROR", "frames_lost")
    assert shorter.record["bus"]["lost"] == 25
    assert (longer.outcome, longer.first_failure) == ("ERROR", "module_silent")
