"""The module's cross-axis correction in single precision, against the bridge's physics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from devices.bridge import Bridge3, BridgeParameters, Strap
from devices.crossed_field import CrossedField
from devices.firmware import Converters, HeadingFormula
from devices.two_axis import TwoAxisFormula
from protocols.uds import DEFAULT_COEFFICIENTS

CONVERTERS = Converters()
MG, G = CONVERTERS.mag_mg_per_count, CONVERTERS.accel_g_per_count
HK_MG = (8000.0, 7600.0, 8300.0)
KNOWING = replace(DEFAULT_COEFFICIENTS, hk_mg=HK_MG)
LEVEL = (0, 0, -round(1.0 / G))


def difference_counts(field_mg):
    """Set minus reset, in counts without rounding, of bridges that lie in a field."""
    x, y, z = (BridgeParameters(hk_mg=hk_mg) for hk_mg in HK_MG)
    levels = Bridge3((x, y, z), Strap(), lambda: 0.0).levels_mg(field_mg, 25.0)
    return tuple((levels[axis] - levels[axis + 3]) / MG for axis in range(3))


def wrapped(difference_deg):
    return (difference_deg + 180.0) % 360.0 - 180.0


def test_the_field_along_the_bridges_is_left(rng):
    crossed = CrossedField(KNOWING, CONVERTERS)
    for _ in range(200):
        field_mg = rng.uniform(-500.0, 500.0, 3)
        raw = np.array((*difference_counts(tuple(field_mg)), *LEVEL), dtype=np.float32)

        left = crossed.taken_out(raw)

        assert left[:3] * MG / 2.0 == pytest.approx(field_mg, abs=0.02)
        assert (left[3:] == raw[3:]).all(), "the acceleration is none of it"
        assert left.dtype == np.float32


@pytest.mark.parametrize("formula", [HeadingFormula, TwoAxisFormula])
def test_a_heading_between_the_axes_is_right_with_it_and_bent_without(formula):
    field_mg = (
        90.0 + 250.0 * math.cos(math.radians(30.0)),
        -200.0 - 250.0 * math.sin(math.radians(30.0)),
        433.0,
    )
    offset = {"mag_offset_mg": (90.0, -200.0, 0.0)}
    counts = difference_counts(field_mg)

    corrected, bent = (
        formula(replace(coefficients, **offset), CONVERTERS).solve(counts, LEVEL)[0]
        for coefficients in (KNOWING, DEFAULT_COEFFICIENTS)
    )

    assert wrapped(corrected - 30.0) == pytest.approx(0.0, abs=0.003)
    assert abs(wrapped(bent - 30.0)) > 0.03


@pytest.mark.parametrize("formula", [HeadingFormula, TwoAxisFormula])
def test_without_anisotropy_fields_nothing_is_computed_anew(formula):
    counts = (4000, -3000, 8000)
    zero = replace(KNOWING, hk_mg=(0.0, 0.0, 0.0))

    assert formula(zero, CONVERTERS).solve(counts, LEVEL) == formula(
        DEFAULT_COEFFICIENTS, CONVERTERS
    ).solve(counts, LEVEL)


def test_one_axis_may_be_corrected_alone():
    raw = np.array((4000.0, -3000.0, 8000.0, *LEVEL), dtype=np.float32)

    left = CrossedField(replace(KNOWING, hk_mg=(0.0, 8000.0, 0.0)), CONVERTERS).taken_out(raw)

    changed = (left != raw).tolist()
    assert changed == [False, True, False, False, False, False]
