"""What a run remembers of the coefficients when it writes more than once."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bench.calibration.fit import Fit
from bench.coefficient_transaction import CoefficientWrite
from bench.errors import ConfigError
from bench.steps.write import Write, coefficients_of
from protocols.uds import DEFAULT_COEFFICIENTS


class Diagnostics:
    """A module that takes every write."""

    def __init__(self) -> None:
        self.held = DEFAULT_COEFFICIENTS

    def read_coefficients(self):
        return self.held

    def write_coefficients(self, wanted):
        before, self.held = self.held, wanted
        return CoefficientWrite(before=before, written=wanted, read_back=wanted)


def whole_fit(**changes):
    fit = Fit(
        method="truth_aided", offset_mg=np.zeros(3), matrix=np.eye(3), accel_offset_g=np.zeros(3),
        accel_matrix=np.eye(3),
    )  # fmt: skip
    return replace(fit, **changes)


def test_a_second_write_keeps_what_the_unit_came_with_and_is_unjudged():
    context = SimpleNamespace(
        judged_fit=whole_fit(), module=SimpleNamespace(diagnostics=Diagnostics()), before=None,
        written=None, verified=False, on_exit=lambda *_: None, restore_coefficients=None,
        recorder=SimpleNamespace(set=lambda *_: None), measure=lambda *_, **__: None,
    )  # fmt: skip
    step = Write(kind="write", name="write")

    step.run(context)
    context.verified = True
    step.run(context)

    assert context.before == DEFAULT_COEFFICIENTS
    assert context.written == replace(context.written, version=DEFAULT_COEFFICIENTS.version + 2)
    assert not context.verified


def test_a_fit_for_two_axes_is_written_with_its_dip_and_its_horizontal_field():
    fit = whole_fit(extended_dip_deg=48.72, extra={"horizontal_mg": 300.0})

    written = coefficients_of(fit, version=3)

    assert (written.extended_dip_deg, written.horizontal_mg) == (48.72, 300.0)
    three_axes = coefficients_of(whole_fit(), version=3)
    assert (three_axes.extended_dip_deg, three_axes.horizontal_mg) == (0.0, 0.0)


def test_a_fit_without_an_accelerometer_is_not_written():
    with pytest.raises(ConfigError, match="min_max must give magnetometer and accelerometer"):
        coefficients_of(whole_fit(method="min_max", accel_matrix=None), version=1)


def test_the_anisotropy_fields_that_corrected_the_readings_are_written():
    fit = whole_fit(hk_mg=np.array([8000.0, 0.0, 7900.0]))

    assert coefficients_of(fit, version=1).hk_mg == (8000.0, 0.0, 7900.0)
    assert coefficients_of(whole_fit(), version=1).hk_mg == (0.0, 0.0, 0.0)
