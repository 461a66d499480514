"""Bad files: one sentence with file, line and column, and a suggestion where one is near."""

from __future__ import annotations

import pytest

from bench.errors import ConfigError
from bench.procedure import Procedure
from bench.typed_yaml import load_model

HEAD = """name: swing
version: "1.0"
title: a title
limits: eol_three_axis
"""
WAIT = "  - {kind: wait, name: pause, duration: 1 s}\n"


@pytest.fixture
def refusal_of(tmp_path):
    """Return what loads a text as a procedure and gives the sentence of its refusal."""

    def load(text):
        path = tmp_path / "swing.yaml"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(ConfigError) as refusal:
            load_model(path, Procedure)
        sentence = str(refusal.value)
        assert sentence.startswith(str(path))
        assert "\n" not in sentence
        return sentence.removeprefix(str(path))

    return load


def test_a_good_file_is_loaded(tmp_path):
    path = tmp_path / "swing.yaml"
    path.write_text(HEAD + "steps:\n" + WAIT, encoding="utf-8")

    procedure = load_model(path, Procedure)

    assert procedure.steps[0].duration_s() == 1.0


def test_an_unknown_key_is_named_with_its_place_and_a_suggestion(refusal_of):
    sentence = refusal_of(HEAD + "stepz: []\nsteps:\n" + WAIT)

    assert sentence == ":5:1: unknown key 'stepz'; did you mean 'steps'?"


def test_an_unknown_key_of_a_step_is_suggested_from_that_steps_keys(refusal_of):
    step = "  - kind: sweep\n    name: turn\n    heading: {count: 8}\n"

    assert ":8:5: unknown key 'heading'; did you mean 'headings'?" in refusal_of(
        HEAD + "steps:\n" + step
    )


def test_an_unknown_key_inside_a_ring_is_suggested_from_the_rings_keys(refusal_of):
    step = "  - kind: poses\n    name: tilted\n    rings:\n      - {count: 6, pich: 30 deg}\n"

    assert ":9:20: unknown key 'pich'; did you mean 'pitch'?" in refusal_of(
        HEAD + "steps:\n" + step
    )


def test_an_unknown_kind_of_step_is_suggested(refusal_of):
    sentence = refusal_of(HEAD + "steps:\n  - {kind: sweap, name: turn}\n")

    assert sentence.startswith(":6:5: unknown kind 'sweap'; did you mean 'sweep'?")


def test_a_missing_key_is_named(refusal_of):
    sentence = refusal_of(HEAD + "steps:\n  - {kind: wait, name: pause}\n")

    assert sentence == ":6:5: key 'duration' is missing"


def test_a_value_without_its_unit_is_refused_at_its_place(refusal_of):
    sentence = refusal_of(HEAD + "steps:\n  - {kind: wait, name: pause, duration: 1.5}\n")

    assert sentence.startswith(":6:")
    assert "number with its unit" in sentence
    assert "1.5" in sentence


def test_a_key_that_stands_twice_is_refused(refusal_of):
    assert ":6:1: key 'name' stands here twice" in refusal_of(
        HEAD.replace("a title", "a title\n") + "name: again\n" + "steps:\n" + WAIT
    )


def test_a_name_that_two_steps_have_is_refused(refusal_of):
    assert "names of steps must be unique; instead received 'pause' twice" in refusal_of(
        HEAD + "steps:\n" + WAIT + WAIT
    )


@pytest.mark.parametrize(
    "text",
    [
        "a: [1, 2", "\tname: x", "a: b: c", "- 1\n- 2\n", "", "just words", "a: *nothing",
        "a: &x [*x]", "? [1, 2]\n: 3", "a: !!int b", "a: !!python/name:os.system", "a: 2026-99-99",
    ],
)  # fmt: skip
def test_what_is_no_yaml_mapping_is_refused_in_one_sentence(refusal_of, text):
    assert refusal_of(text)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read"):
        load_model(tmp_path / "none.yaml", Procedure)


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "bytes.yaml"
    path.write_bytes(b"name: \xff\xfe\n")

    with pytest.raises(ConfigError, match="cannot be read"):
        load_model(path, Procedure)


FIT = "  - {kind: fit, name: fit, methods: [truth_aided], judged: [truth_aided]}\n"
WRITE = "  - {kind: write, name: write}\n"
VERIFY = "  - {kind: verify, name: verify, rings: [{count: 4, first: 359.5 deg}]}\n"
SWEEP = "  - {kind: sweep, name: turn, headings: {count: 4}}\n"


@pytest.mark.parametrize(
    ("steps", "sentence"),
    [
        (WRITE + FIT + VERIFY, "step write must come after a fit"),
        (FIT + WRITE, "step write must be followed by a verify step"),
        (FIT + VERIFY + WRITE, "step write must be followed by a verify step"),
        (
            FIT + VERIFY + WRITE + VERIFY.replace("name: v", "name: w"),
            "step verify must come after",
        ),
        (SWEEP + FIT + WRITE + VERIFY, "step verify must verify at poses of its own"),
        (
            "  - kind: group\n    name: g\n    steps:\n    " + SWEEP + VERIFY,
            "instead received the calibration pose azimuth 359.5, pitch 0, roll 0 deg",
        ),
    ],
    ids=["no fit", "no verify", "verify before", "two", "calibration poses", "in a group"],
)
def test_steps_that_would_release_what_nothing_judged_are_refused(refusal_of, steps, sentence):
    assert sentence in refusal_of(HEAD + "steps:\n" + steps)


COMPARE = "  - {kind: compare, name: compare, rings: [{count: 4, first: 359.5 deg}]}\n"


@pytest.mark.parametrize(
    ("steps", "sentence"),
    [
        (COMPARE + FIT, "step compare must come after a fit; there is none"),
        (
            SWEEP + FIT + COMPARE,
            "step compare must verify at poses of its own; instead received the calibration pose "
            "azimuth 359.5, pitch 0, roll 0 deg",
        ),
        (
            FIT.replace("methods: [truth_aided]", "methods: [min_max, ellipsoid]"),
            "judged must name methods that are fitted (min_max, ellipsoid); "
            "instead received truth_aided",
        ),
        (FIT.replace("truth_aided]", "truth_aidde]"), "'truth_aided'"),
    ],
    ids=["before a fit", "calibration poses", "judged not fitted", "unknown method"],
)
def test_a_comparison_that_would_judge_nothing_is_refused(refusal_of, steps, sentence):
    assert sentence in refusal_of(HEAD + "steps:\n" + steps)


def test_rounds_that_never_end_are_refused(refusal_of):
    inner = "{kind: repeat, name: b, times: 1000, steps: [{kind: wait, name: c, duration: 1 s}]}"
    steps = f"  - {{kind: repeat, name: a, times: 1000, steps: [{inner}]}}\n"

    assert "must be at most 10000; instead received 1001001" in refusal_of(
        HEAD + "steps:\n" + steps
    )


def test_noise_of_a_few_readings_is_refused(refusal_of):
    steps = "  - {kind: noise, name: noise, dwell: 20 ms}\n"

    assert "greater than or equal to 0.5" in refusal_of(HEAD + "steps:\n" + steps)
