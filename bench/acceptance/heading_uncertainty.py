"""The uncertainty of the heading errors of a verification: its budget and its record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.acceptance.site import heading_error_deg, is_level
from bench.acceptance.two_axis_evaluation import fit_of
from bench.uncertainty.bench_contributions import COVERAGE_FACTOR
from bench.uncertainty.heading_budget import heading_budget

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import NDArray

    from bench.acceptance.measurement import Measurement
    from bench.acceptance.site import SiteField
    from bench.station import Station
    from bench.uncertainty.heading_budget import HeadingBudget
    from bench.uncertainty.unit_data import UnitData
    from protocols.uds import Coefficients


def verification_budget(
    readings: NDArray[np.void],
    coefficients: Coefficients,
    station: Station,
    unit: UnitData | None,
    baseline_mg: NDArray[np.float64] | None = None,
) -> HeadingBudget | None:
    """Return the budget of the heading errors of a verification, None where the part is unknown.

    Parameters
    ----------
    readings : ndarray of READING, shape (n,)
        The verification poses in the order of visit.
    coefficients : Coefficients
        What the module computes its heading with.
    unit : UnitData or None
        Section `unit` of the limits.
    baseline_mg : ndarray, shape (3,), or None
        What the reference magnetometer read when the run began.
    """
    if unit is None:
        return None
    return heading_budget(readings, fit_of(coefficients), station, unit, baseline_mg=baseline_mg)


def uncertainty_section(
    readings: NDArray[np.void],
    budget: HeadingBudget,
    judged: Iterable[Measurement],
    site: SiteField,
) -> dict[str, Any]:
    """Return the record's section `uncertainty`.

    Parameters
    ----------
    readings : ndarray of READING, shape (n,)
        The poses of the budget.
    judged : iterable of Measurement
        Judged, among them level_max, level_rms, tilt_max and tilt_rms as far as they were made.
    """
    by_name = {one.name: one for one in judged}
    rules = [by_name[name].rule for name in ("level_max", "tilt_max") if name in by_name]
    return {
        "coverage_factor": COVERAGE_FACTOR,
        "rule": next(filter(None, rules), ""),
        "headings": _headings(readings, budget, site),
        "budget": _lines(readings, budget),
        "level": _group(by_name, "level"),
        "tilt": _group(by_name, "tilt"),
    }


def _headings(
    readings: NDArray[np.void], budget: HeadingBudget, site: SiteField
) -> list[dict[str, float | int]]:
    error_deg = heading_error_deg(readings["heading_deg"], readings, site)
    return [
        {
            "position": int(reading["position"]),
            "azimuth_deg": float(reading["rig_azimuth_deg"]),
            "pitch_deg": float(reading["rig_pitch_deg"]),
            "roll_deg": float(reading["rig_roll_deg"]),
            "error_deg": float(error),
            "u_deg": float(u),
            "u_test_deg": float(u_test),
        }
        for reading, error, u, u_test in zip(
            readings, error_deg, budget.u_deg, budget.u_test_deg, strict=True
        )
    ]


def _lines(readings: NDArray[np.void], budget: HeadingBudget) -> list[dict[str, Any]]:
    level = is_level(readings)
    return [
        {
            "name": line.name,
            "source": line.source,
            "distribution": line.distribution,
            "group": line.group,
            "shared": line.shared,
            "value": line.value,
            "unit": line.unit,
            "level_deg": line.rms_deg(level),
            "tilt_deg": line.rms_deg(~level),
        }
        for line in budget.contributions
    ]


def _group(by_name: dict[str, Measurement], name: str) -> dict[str, float | None]:
    largest, rms = by_name.get(f"{name}_max"), by_name.get(f"{name}_rms")
    return {
        "u_max_deg": largest.uncertainty if largest else None,
        "u_rms_deg": rms.uncertainty if rms else None,
        "tur": largest.tur if largest else None,
        "conformity": largest.conformity if largest else None,
    }
