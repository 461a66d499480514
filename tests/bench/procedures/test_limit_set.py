from __future__ import annotations

import pytest

from bench.acceptance.outcome import Outcome
from bench.errors import ConfigError
from bench.limit_set import load_limits

ENTRY = "    description: what it is.\n    action: what to do.\n"


@pytest.fixture
def limits_of(tmp_path):
    """Return what loads limits whose measurements stand in a text."""

    def load(measurements):
        path = tmp_path / "limits.yaml"
        path.write_text('id: own\nversion: "1.0"\nmeasurements:\n' + measurements, encoding="utf-8")
        return load_limits(str(path))

    return load


def test_values_are_read_in_the_unit_of_the_measurement(limits_of):
    limits = limits_of(
        "  level_max:\n    unit: deg\n    high: 30 arcmin\n    uncertainty: 0.05 deg\n"
        "    guard_band: 0.1 deg\n" + ENTRY
    )

    limit = limits.by_name["level_max"]
    assert (limit.low, limit.high, limit.uncertainty, limit.guard_band) == (None, 0.5, 0.05, 0.1)
    assert limit.missed is Outcome.FAIL
    assert (limits.id, limits.version, len(limits.sha256)) == ("own", "1.0", 64)


def test_a_name_with_axes_is_one_limit_each(limits_of):
    limits = limits_of('  "noise_{x,y,z}":\n    unit: mG\n    high: 1 mG\n' + ENTRY)

    assert sorted(limits.by_name) == ["noise_x", "noise_y", "noise_z"]
    assert limits.by_name["noise_y"].name == "noise_y"


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("    unit: deg\n    low: 1 deg\n    high: 0.5 deg\n", "low must lie below high"),
        ("    unit: deg\n    low: 0 deg\n    high: 1 deg\n    guard_band: 0.6 deg\n", "guard band"),
        ("    unit: deg\n", "must have low or high"),
        ("    unit: deg\n    high: 0.5 mG\n", "number with its unit"),
        ("    unit: deg\n    high: 0.5\n", "number with its unit"),
        ("    unit: deg\n    high: 1 deg\n    uncertainty: -1 deg\n", "must not be negative"),
        ("    unit: deg\n    high: 1 deg\n    missed: ABORTED\n", "missed"),
        ("    unit: deg\n    hihg: 1 deg\n", "unknown key 'hihg'; did you mean 'high'?"),
    ],
)
def test_limits_that_make_no_sense_are_refused_with_their_place(limits_of, body, sentence):
    with pytest.raises(ConfigError) as refusal:
        limits_of("  level_max:\n" + body + ENTRY)

    assert sentence in str(refusal.value)
    assert "limits.yaml:" in str(refusal.value)


def test_limits_twice_for_one_measurement_are_refused(limits_of):
    one = "    unit: mG\n    high: 1 mG\n" + ENTRY

    with pytest.raises(ConfigError, match="'noise_x' has limits twice"):
        limits_of("  noise_x:\n" + one + '  "noise_{x,y}":\n' + one)


def test_measurements_without_limits_are_named(limits_of):
    limits = limits_of("  noise_x:\n    unit: mG\n    high: 1 mG\n" + ENTRY)

    with pytest.raises(ConfigError, match="limits own 1.0 lack noise_y, noise_z"):
        limits.require(["noise_x", "noise_y", "noise_z"])
