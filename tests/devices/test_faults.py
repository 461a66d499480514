"""The catalogue of faults and its specification string."""

from __future__ import annotations

import pytest

from devices.faults import FAULTS, FaultKind, parse_fault

EXPECTED = {
    *(f"{kind}_{axis}" for kind in ("dead_strap", "stuck_axis", "inverted_axis") for axis in "xyz"),
    *(f"accel_sign_{axis}" for axis in "xyz"),
    *(f"axis_stalled_{axis}" for axis in ("azimuth", "pitch", "roll")),
    "swapped_axes", "excess_noise", "saturated_axis", "lost_write", "module_silent",
    "forklift", "field_step", "reference_silent", "seat_turned", "fixture_iron",
}  # fmt: skip


def test_catalogue_is_complete() -> None:
    assert set(FAULTS) == EXPECTED
    assert all(name == fault.name for name, fault in FAULTS.items())


def test_every_fault_says_what_it_breaks_and_what_sees_it() -> None:
    for fault in FAULTS.values():
        assert fault.breaks.endswith(".")
        assert fault.breaks.count(".") == 1
        assert fault.detects
        assert isinstance(fault.kind, FaultKind)


@pytest.mark.parametrize(
    ("specification", "strength", "tick"),
    [
        ("swapped_axes", 1.0, 0),
        ("swapped_axes=0.25", 0.25, 0),
        ("swapped_axes@1200", 1.0, 1200),
        ("swapped_axes=1e-3@7", 0.001, 7),
        (" swapped_axes ", 1.0, 0),
    ],
)
def test_specification(specification: str, strength: float, tick: int) -> None:
    active = parse_fault(specification)

    assert (active.fault.name, active.strength, active.tick) == ("swapped_axes", strength, tick)


@pytest.mark.parametrize(
    ("specification", "sentence"),
    [
        ("dead_strp_x", "did you mean dead_strap_x"),
        ("", "must be a name of the catalogue"),
        ("excess_noise=2", "strength of 'excess_noise=2' must be within 0 and 1"),
        ("excess_noise=-0.1", "must be within 0 and 1"),
        ("excess_noise=", "must be within 0 and 1"),
        ("excess_noise=nan", "must be within 0 and 1"),
        ("excess_noise=loud", "instead received 'loud'"),
        ("excess_noise@-1", "tick of 'excess_noise@-1' must be a whole number"),
        ("excess_noise@", "must be a whole number"),
    ],
)
def test_wrong_specification_is_refused_in_one_sentence(specification: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        parse_fault(specification)
