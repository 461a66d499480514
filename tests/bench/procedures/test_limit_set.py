from __future__ import annotations

import pytest

from bench.acceptance.outcome import Outcome
from bench.errors import ConfigError
from bench.limit_set import load_limits
from bench.uncertainty.unit_data import UnitData

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


UNIT = {
    "repeatability": "0.32 mG",
    "hysteresis": "0.16 mG",
    "converter": "0.1 mG",
    "accelerometer_tempco": "2 mg/degC",
    "accelerometer_wander": "0.3 mg",
}
GUARDED = "  level_max:\n    unit: deg\n    high: 1 deg\n    guard_factor: 1.0\n" + ENTRY


@pytest.fixture
def with_part(tmp_path):
    """Return what loads limits with a section `unit` and one measurement."""

    def load(measurements=GUARDED, **changed):
        rows = {**UNIT, **changed}
        lines = "".join(f"  {key}: {value}\n" for key, value in rows.items() if value is not None)
        path = tmp_path / "limits.yaml"
        text = f'id: own\nversion: "1.0"\nunit:\n{lines}measurements:\n{measurements}'
        path.write_text(text, encoding="utf-8")
        return load_limits(str(path))

    return load


def test_the_data_of_the_part_are_read_in_their_units(with_part):
    limits = with_part(repeatability="32 nT", accelerometer_tempco="0.002 g/K")

    assert limits.unit == UnitData(
        repeatability_mg=0.32,
        hysteresis_mg=0.16,
        converter_mg=0.1,
        accel_tempco_g_per_c=0.002,
        accel_wander_g=3e-4,
    )
    assert limits.by_name["level_max"].guard_factor == 1.0


def test_limits_without_the_data_of_a_part_compute_no_uncertainty(limits_of):
    assert limits_of("  level_max:\n    unit: deg\n    high: 1 deg\n" + ENTRY).unit is None


@pytest.mark.parametrize(
    ("changed", "place", "sentence"),
    [
        ({"repeatability": "0.32 deg"}, "limits.yaml:4:", "number with its unit"),
        ({"hysteresis": "-0.1 mG"}, "limits.yaml:3:", "hysteresis must not be negative"),
        ({"accelerometer_tempco": "2 mg"}, "limits.yaml:7:", "(g/degC or mg/degC"),
        ({"converter": None}, "limits.yaml:", "key 'converter' is missing"),
        ({"repeatibility": "1 mG"}, "limits.yaml:9:3:", "did you mean 'repeatability'?"),
    ],
)
def test_data_of_a_part_that_make_no_sense_are_refused_with_their_place(
    with_part, changed, place, sentence
):
    with pytest.raises(ConfigError) as refusal:
        with_part(**changed)

    assert place in str(refusal.value)
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_an_uncertainty_is_stated_or_computed_but_never_both(with_part):
    body = GUARDED.replace("    guard_factor", "    uncertainty: 0.1 deg\n    guard_factor")

    with pytest.raises(ConfigError, match="uncertainty of level_max must be left out"):
        with_part(body)


def test_a_guard_band_in_multiples_of_u_needs_a_u(limits_of):
    with pytest.raises(ConfigError, match="guard_factor of level_max needs its uncertainty or a"):
        limits_of(GUARDED)
    noise = "  noise_x:\n    unit: mG\n    high: 1 mG\n    guard_factor: 1.0\n" + ENTRY
    with pytest.raises(ConfigError, match="guard_factor of noise_x needs its uncertainty$"):
        limits_of(noise)
    stated = limits_of(noise.replace("high", "uncertainty: 0.1 mG\n    high"))
    assert stated.by_name["noise_x"].guard_factor == 1.0


@pytest.mark.parametrize("factor", ["-0.1", "11.0", "true"])
def test_a_guard_factor_that_makes_no_sense_is_refused_with_its_place(with_part, factor):
    with pytest.raises(ConfigError, match=r"limits.yaml:\d+:\d+: .*guard_factor"):
        with_part(GUARDED.replace("1.0", factor))


def test_a_guard_band_stands_once(with_part):
    both = GUARDED.replace("    guard_factor", "    guard_band: 0.1 deg\n    guard_factor")

    with pytest.raises(ConfigError, match="must not stand together"):
        with_part(both)
