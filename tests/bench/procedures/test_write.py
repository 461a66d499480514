"""What a run remembers of the coefficients when it writes more than once."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from bench.coefficient_transaction import CoefficientWrite
from bench.steps.write import Write
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


def test_a_second_write_keeps_what_the_unit_came_with_and_is_unjudged():
    fit = SimpleNamespace(
        method="truth_aided", offset_mg=np.zeros(3), matrix=np.eye(3), accel_offset_g=np.zeros(3),
        accel_matrix=np.eye(3),
    )  # fmt: skip
    context = SimpleNamespace(
        judged_fit=fit, module=SimpleNamespace(diagnostics=Diagnostics()), before=None,
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
