"""Which methods a procedure may name, and what a judged one must tell."""

from __future__ import annotations

from typing import get_args

import pytest

from bench.acceptance.catalogue import MEASUREMENTS
from bench.calibration.method_names import MethodName
from bench.calibration.methods import METHODS
from bench.steps.fit import REQUIRED, FitMethods


def step(*judged):
    return FitMethods(kind="fit", name="fit", methods=list(METHODS), judged=list(judged))


def test_a_procedure_may_name_every_method_and_no_other():
    assert get_args(MethodName) == tuple(METHODS)


@pytest.mark.parametrize(
    ("judged", "told"),
    [
        (("truth_aided",), REQUIRED["truth_aided"]),
        (("two_axis_aided", "two_axis"), ("fit_residual", "dip_difference")),
        (("truth_aided", "two_axis"), ("fit_residual", "dip_difference")),
        (("truth_aided", "min_max"), ()),
        (("four_position",), ()),
    ],
)
def test_what_every_judged_method_tells_must_have_a_limit(judged, told):
    measured = step(*judged).measured()

    assert measured == ("fit_accepted", *told)
    assert set(measured) <= set(MEASUREMENTS)
