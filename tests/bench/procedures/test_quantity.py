from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from bench.quantity import Degrees, Seconds, format_quantity, parse_quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.5 deg", "deg", 0.5),
        ("-30deg", "deg", -30.0),
        ("30 arcmin", "deg", 0.5),
        ("25 uT", "mG", 250.0),
        ("25000 nT", "mG", 250.0),
        ("0.25 G", "mG", 250.0),
        ("300 ms", "s", 0.3),
        ("2 min", "s", 120.0),
        ("5e-1 A", "mA", 500.0),
        ("20 mg", "g", 0.02),
        ("0.25 deg C", "deg C", 0.25),
        ("0 frames", "frames", 0.0),
    ],
)
def test_a_quantity_is_returned_in_the_unit_asked_for(text, unit, value):
    assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    "value",
    ["0.5", 0.5, 1, True, None, "deg", "0.5 mG", "0.5 degree", "nan deg", "1e999 deg", ""],
    ids=repr,
)
def test_an_angle_without_a_right_unit_is_refused_with_what_was_received(value):
    with pytest.raises(ValueError, match="instead received") as refusal:
        parse_quantity(value, "deg")

    assert repr(value) in str(refusal.value)


@pytest.mark.parametrize("value", ["0.5", True, float("nan"), float("inf"), None], ids=repr)
def test_a_plain_number_is_a_finite_number_without_unit(value):
    with pytest.raises(ValueError, match="plain finite number"):
        parse_quantity(value, "")


@given(st.floats(-1e6, 1e6), st.sampled_from(["deg", "s", "mG", "g", "mA"]))
def test_what_is_formatted_is_parsed_to_the_same_value(value, unit):
    again = parse_quantity(format_quantity(value, unit), unit)

    assert again == pytest.approx(value, rel=1e-11, abs=1e-300)


def test_a_typed_quantity_is_a_float_and_is_written_with_its_unit():
    adapter = TypeAdapter(Degrees)

    assert adapter.validate_python("90 deg") == 90.0
    assert adapter.dump_python(90.0) == "90 deg"
    assert adapter.json_schema()["type"] == "string"


@pytest.mark.parametrize("value", ["0 s", "-1 s", 0.5])
def test_a_duration_must_be_above_zero_and_have_a_unit(value):
    with pytest.raises(ValidationError):
        TypeAdapter(Seconds).validate_python(value)
