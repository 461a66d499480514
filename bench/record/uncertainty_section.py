"""Section `uncertainty` of record.json: each verified heading error with U, and the budget."""

from __future__ import annotations

from typing import Literal

from bench.record.section import StrictSection


class VerifiedHeading(StrictSection):
    """One verified heading error; `u_deg` of the unit's own error, `u_test_deg` of the test."""

    position: int
    azimuth_deg: float
    pitch_deg: float
    roll_deg: float
    error_deg: float
    u_deg: float
    u_test_deg: float


class BudgetLine(StrictSection):
    """One contribution: standard uncertainty of its quantity, RMS of its part of the heading."""

    name: str
    source: Literal["A", "B"]
    distribution: str
    group: Literal["unit", "bench"]
    shared: bool
    value: float
    unit: str
    level_deg: float | None
    tilt_deg: float | None


class GroupUncertainty(StrictSection):
    """Expanded uncertainty of the largest and the RMS error, and how the largest one decides."""

    u_max_deg: float | None = None
    u_rms_deg: float | None = None
    tur: float | None = None
    conformity: float | None = None


class UncertaintySection(StrictSection):
    """Uncertainty of the verified heading errors; empty where the part's data are not known."""

    coverage_factor: float = 2.0
    rule: str = ""
    headings: list[VerifiedHeading] = []
    budget: list[BudgetLine] = []
    level: GroupUncertainty = GroupUncertainty()
    tilt: GroupUncertainty = GroupUncertainty()
