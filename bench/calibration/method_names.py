"""The names of all methods, without importing what fits them."""

from __future__ import annotations

from typing import Literal

MethodName = Literal[
    "set_reset",
    "min_max",
    "four_position",
    "soft_iron",
    "three_headings",
    "ellipsoid",
    "tilt_aided",
    "accelerometer",
    "two_axis",
    "two_axis_aided",
    "truth_aided",
]
"""Keys of `methods.METHODS` in their order; a procedure may name no other."""
