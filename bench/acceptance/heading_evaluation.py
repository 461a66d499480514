"""Numbers about headings: verification, repeatability, closing error, bench against module.

Judged is the heading that the module itself sends, against the rig's azimuth less the
azimuth of the station's field. Level and tilted poses are judged apart, each by its RMS and
by its maximum: a sheet that mixes the two, or leaves the tilt unsaid, cannot be compared.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.acceptance.measurement import Measurement
from bench.acceptance.site import expected_strength_mg, heading_error_deg, is_level
from bench.acceptance.two_axis_evaluation import fit_of, horizontal_mg
from bench.calibration.compensation import compensated_heading_deg
from bench.samples import COMPLETE, MOVING
from bench.uncertainty.decision import heading_decision
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField
    from bench.pose import Pose
    from bench.uncertainty.decision import HeadingDecision
    from bench.uncertainty.heading_budget import HeadingBudget
    from protocols.uds import Coefficients


def evaluate_verification(
    step: str,
    readings: NDArray[np.void],
    samples: NDArray[np.void],
    coefficients: Coefficients,
    site: SiteField,
    *,
    budget: HeadingBudget | None = None,
) -> list[Measurement]:
    """Return level_max, level_rms, tilt_max, tilt_rms and bench_against_module, in deg.

    Parameters
    ----------
    readings : ndarray of READING, shape (n,)
        The verification poses.
    samples : ndarray of SAMPLE, shape (m,)
        The samples of those poses.
    coefficients : Coefficients
        What was written to the module.
    budget : HeadingBudget, optional
        Of the same readings; with it the first four carry their own uncertainty.
    """
    error_deg = heading_error_deg(readings["heading_deg"], readings, site)
    level = is_level(readings)
    found: list[Measurement] = []
    for name, mask in (("level", level), ("tilt", ~level)):
        if mask.any():
            spread = heading_decision(error_deg, budget, mask) if budget else None
            found += error_measurements(name, step, error_deg[mask], readings[mask], spread=spread)
    return [*found, *evaluate_agreement(step, samples, coefficients)]


def error_measurements(
    name: str,
    step: str,
    error_deg: NDArray[np.float64],
    readings: NDArray[np.void],
    *,
    note: str = "",
    spread: HeadingDecision | None = None,
) -> list[Measurement]:
    """Return `name`_max and `name`_rms, deg, of heading errors, shape (n,), at poses."""
    worst = int(np.argmax(np.abs(error_deg)))
    position = int(readings["position"][worst])
    where = f"{error_deg[worst]:+.3f} deg at position {position}"
    note = f"{where}; {note}" if note else where
    maximum_deg = float(abs(error_deg[worst]))
    rms_deg = float(np.sqrt(np.mean(error_deg**2)))
    return [
        Measurement(
            name=f"{name}_max",
            value=maximum_deg,
            step=step,
            unit="deg",
            note=note,
            spread=spread.maximum if spread else None,
        ),
        Measurement(
            name=f"{name}_rms",
            value=rms_deg,
            step=step,
            unit="deg",
            spread=spread.rms if spread else None,
        ),
    ]


def evaluate_raw_heading(
    step: str, readings: NDArray[np.void], site: SiteField
) -> list[Measurement]:
    """Return raw_max: the largest error, in deg, of the heading of uncorrected level readings."""
    level = readings[is_level(readings)]
    if not len(level):
        return []
    heading_deg = compensated_heading_deg(None, level["field_mg"], level["accel_g"])
    error_deg = heading_error_deg(heading_deg, level, site)
    value_deg = float(np.max(np.abs(error_deg)))
    return [Measurement(name="raw_max", value=value_deg, step=step, unit="deg")]


def evaluate_field_strength(
    step: str, readings: NDArray[np.void], coefficients: Coefficients, site: SiteField
) -> list[Measurement]:
    """Return field_magnitude_difference: mean corrected strength against the station's, in %.

    The calibration holds the gain against the station's field; on other poses and later the
    strength differs from it where the field has changed or the calibration is wrong. Of a module
    with two axes it is the horizontal strength: its vertical field is a coefficient.
    """
    if coefficients.horizontal_mg > 0.0:
        strength_mg, station_mg = horizontal_mg(readings, coefficients), site.horizontal_mg
        note = "horizontal strength"
    else:
        corrected_mg = fit_of(coefficients).corrected_mg(readings["field_mg"])
        strength_mg, station_mg = (
            np.linalg.norm(corrected_mg, axis=1),
            expected_strength_mg(readings, site),
        )
        note = ""
    percent = 100.0 * abs(float(np.mean(strength_mg)) / station_mg - 1.0)
    name = "field_magnitude_difference"
    return [Measurement(name=name, value=percent, step=step, unit="%", note=note)]


def evaluate_agreement(
    step: str, samples: NDArray[np.void], coefficients: Coefficients
) -> list[Measurement]:
    """Return bench_against_module: largest difference of the two headings in one group, in deg.

    The bench computes the heading of every complete sample from its raw readings and the
    written coefficients, in double precision, and compares it with the module's own of the
    same group counter.
    """
    usable = samples[(samples["position"] != MOVING) & (samples["complete"] == COMPLETE)]
    if not len(usable):
        return []
    difference_deg = wrap_180_deg(bench_heading_deg(usable, coefficients) - usable["heading_deg"])
    worst = int(np.argmax(np.abs(difference_deg)))
    return [
        Measurement(
            name="bench_against_module",
            value=float(abs(difference_deg[worst])),
            step=step,
            unit="deg",
            note=f"position {int(usable['position'][worst])}, group {int(usable['group'][worst])}",
        )
    ]


def bench_heading_deg(samples: NDArray[np.void], coefficients: Coefficients) -> NDArray[np.float64]:
    """Return the bench's own heading, shape (n,), of samples of set and reset readings."""
    field_mg = (samples["set_mg"] - samples["reset_mg"]) / 2.0
    return compensated_heading_deg(fit_of(coefficients), field_mg, samples["accel_g"])


def evaluate_returns(
    step: str, readings: NDArray[np.void], poses: Sequence[Pose], site: SiteField
) -> list[Measurement]:
    """Return repeatability and closing_error, in deg, of several visits to several poses.

    - repeatability: pooled standard deviation of the module's heading error over the visits
      to one pose (the worst range of three would reject 56 % of good units).
    - closing_error: the mean of the later half of the visits less that of the earlier half,
      averaged over the poses. One last-minus-first pair has a standard deviation of 0.11 deg
      by the sensor's repeatability alone; halves of four visits at eight headings, 0.03.
    """
    groups = _visits(readings, poses)
    error_deg = heading_error_deg(readings["heading_deg"], readings, site)
    visits_deg = [_unwrapped(error_deg[index]) for index in groups if len(index) >= 2]
    if not visits_deg:
        return []
    freedom = sum(len(visit) - 1 for visit in visits_deg)
    squares = sum(float(np.sum((visit - visit.mean()) ** 2)) for visit in visits_deg)
    halves = [
        visit[-(len(visit) // 2) :].mean() - visit[: len(visit) // 2].mean() for visit in visits_deg
    ]
    note = f"{len(visits_deg)} poses, {sum(map(len, visits_deg))} visits"
    values = {
        "repeatability": float(np.sqrt(squares / freedom)),
        "closing_error": abs(float(np.mean(halves))),
    }
    return [
        Measurement(name=name, value=value, step=step, unit="deg", note=note)
        for name, value in values.items()
    ]


def _visits(readings: NDArray[np.void], poses: Sequence[Pose]) -> list[NDArray[np.intp]]:
    attitude_of = {pose.position: pose.attitude for pose in poses}
    keys = [
        (round(a.azimuth_deg % 360.0, 6) % 360.0, round(a.pitch_deg, 6), round(a.roll_deg, 6))
        for a in (attitude_of[int(position)] for position in readings["position"])
    ]
    return [np.flatnonzero([other == key for other in keys]) for key in dict.fromkeys(keys)]


def _unwrapped(error_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(error_deg[0] + wrap_180_deg(error_deg - error_deg[0]), dtype=float)


def evaluate_temperature(
    step: str, fit_readings: NDArray[np.void], verification_readings: NDArray[np.void]
) -> list[Measurement]:
    """Return temperature_change, in deg C, between calibration and verification.

    An accelerometer of 2 mg/C moves the heading by more than the limits leave in 1 deg C.
    """
    means_c = [float(np.mean(r["temperature_c"])) for r in (fit_readings, verification_readings)]
    change_c = abs(means_c[1] - means_c[0])
    return [Measurement(name="temperature_change", value=change_c, step=step, unit="deg C")]
