"""Entries of record.json from what the bench works with, and back."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from bench.acceptance.measurement import Limit, Measurement
from bench.acceptance.outcome import Outcome
from bench.errors import ConfigError
from bench.pose import Attitude, Pose
from bench.record.plain import plain
from protocols.uds import Coefficients

if TYPE_CHECKING:
    from collections.abc import Mapping

    from bench.acceptance.verdict import Verdict
    from bench.calibration.fit import Fit


def measurement_entry(measurement: Measurement) -> dict[str, Any]:
    """Return the entry of one measurement."""
    limit = measurement.limit
    return {
        "name": measurement.name,
        "step": measurement.step,
        "value": plain(float(measurement.value)),
        "unit": measurement.unit,
        "low": limit.low if limit else None,
        "high": limit.high if limit else None,
        "uncertainty": limit.uncertainty if limit else plain(measurement.uncertainty),
        "guard_band": limit.guard_band if limit else None,
        "rule": measurement.rule or None,
        "tur": plain(measurement.tur),
        "conformity": plain(measurement.conformity),
        "outcome": plain(measurement.outcome),
        "missed": plain(limit.missed) if limit else None,
        "description": limit.description if limit else "",
        "action": limit.action if limit else "",
        "attempt": measurement.attempt,
        "from_samples": measurement.from_samples,
        "note": measurement.note,
    }


def measurement_of(entry: Mapping[str, Any]) -> Measurement:
    """Return the measurement of an entry, with the limit that stands there."""
    value = entry["value"]
    return Measurement(
        name=entry["name"],
        value=math.nan if value is None else float(value),
        step=entry["step"],
        unit=entry["unit"],
        limit=_limit_of(entry),
        outcome=Outcome(entry["outcome"]) if entry["outcome"] else None,
        attempt=entry["attempt"],
        from_samples=entry["from_samples"],
        note=entry["note"],
        uncertainty=entry["uncertainty"] or None,
        # records of before the computed uncertainty do not name them
        tur=entry.get("tur"),
        conformity=entry.get("conformity"),
        rule=entry.get("rule") or "",
    )


def _limit_of(entry: Mapping[str, Any]) -> Limit | None:
    if entry["missed"] is None:
        return None
    return Limit(
        name=entry["name"],
        unit=entry["unit"],
        low=entry["low"],
        high=entry["high"],
        uncertainty=entry["uncertainty"] or 0.0,
        guard_band=entry["guard_band"] or 0.0,
        missed=Outcome(entry["missed"]),
        description=entry["description"],
        action=entry["action"],
    )


def limits_of(record: Mapping[str, Any]) -> dict[str, Limit]:
    """Return the limits, by name, that a record's measurements were judged by."""
    limits = (_limit_of(entry) for entry in record["measurements"])
    return {limit.name: limit for limit in limits if limit is not None}


def pose_entry(pose: Pose) -> dict[str, Any]:
    """Return the entry of one pose."""
    return {
        "position": pose.position,
        "step": pose.step,
        "azimuth_deg": float(pose.attitude.azimuth_deg),
        "pitch_deg": float(pose.attitude.pitch_deg),
        "roll_deg": float(pose.attitude.roll_deg),
        "direction": pose.direction,
    }


def pose_of(entry: Mapping[str, Any]) -> Pose:
    """Return the pose of an entry."""
    return Pose(
        position=entry["position"],
        step=entry["step"],
        attitude=Attitude(
            azimuth_deg=entry["azimuth_deg"],
            pitch_deg=entry["pitch_deg"],
            roll_deg=entry["roll_deg"],
        ),
        direction=entry["direction"],
    )


def fit_entry(fit: Fit, achieved: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Return the entry of one fit with the heading error that it achieved."""
    entry = plain(fit)
    if not isinstance(entry, dict):
        message = f"a fit must become a mapping; instead received {type(entry)}"
        raise TypeError(message)
    keys = ("level_rms_deg", "level_max_deg", "tilt_rms_deg", "tilt_max_deg")
    entry["achieved"] = {key: plain((achieved or {}).get(key)) for key in keys}
    return entry


def verdict_entry(verdict: Verdict) -> dict[str, Any]:
    """Return the entry of the verdict."""
    return {
        "outcome": verdict.outcome.value,
        "reason": verdict.reason,
        "next_action": verdict.next_action,
        "rule": verdict.rule,
    }


def coefficients_of(entry: Mapping[str, Any]) -> Coefficients:
    """Return the coefficients of an entry of the section `coefficients`.

    Raises
    ------
    ConfigError
        If the entry does not hold them.
    """
    try:
        return Coefficients(
            version=int(entry["version"]),
            mag_offset_mg=_flat(entry["mag_offset_mg"], 3),
            mag_matrix=_flat(entry["mag_matrix"], 9),
            accel_offset_g=_flat(entry["accel_offset_g"], 3),
            accel_matrix=_flat(entry["accel_matrix"], 9),
            # records of before the two-axis module do not name them
            extended_dip_deg=float(entry.get("extended_dip_deg", 0.0)),
            horizontal_mg=float(entry.get("horizontal_mg", 0.0)),
            # nor did those of before the cross-axis term
            hk_mg=_flat(entry.get("hk_mg", [0.0, 0.0, 0.0]), 3),
        )
    except (KeyError, TypeError, ValueError) as error:
        message = f"coefficients of the record must be a whole set; instead {error} is wrong there"
        raise ConfigError(message) from error


def _flat(values: list[Any], count: int) -> tuple[float, ...]:
    flat: list[float] = []
    for value in values:
        flat.extend(map(float, value if isinstance(value, list) else [value]))
    if len(flat) != count or not all(map(math.isfinite, flat)):
        message = f"a row of {len(flat)} numbers in the place of {count} finite ones"
        raise ValueError(message)
    return tuple(flat)
